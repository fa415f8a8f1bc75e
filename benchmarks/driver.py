"""The driver: runs every job in a process of its own, interleaved, and takes medians."""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks import ale, scenes
from benchmarks.programs import HELPERS, PROGRAMS, Program
from benchmarks.programs.common import OVERHEAD
from kratos_lite.verification import errors

ROOT = Path(__file__).resolve().parents[1]
LAUNCHER = Path(__file__).with_name("launch.py")
ERRORS = ("difference", "displacement")
"""Those kept of run time against error; of the adaptive solution that in the energy norm, too."""
PLANE = ("l_domain", "hole_incompressible", "cook")
"""Scenes of one layer: their unknowns grow as n²."""
ENOUGH = 1e-4
"""Error at which a curve has gone far enough."""
LARGE = 40
"""Cells along an edge from which a scene is made in a process of its own."""
MACHINERY = {"PYTHONDONTWRITEBYTECODE": ""}
"""Environment of every process: byte code may be kept, as on any user's machine."""


@dataclass(frozen=True)
class Run:
    """One measurement to make: a program, a scene and what to do with it.

    Attributes
    ----------
    group : the set of rows it belongs to.
    scene, kind, n : as in `scenes.make`; or the path of a `.mdpa` file as the scene.
    options : further words of the job, such as ``write=True``.
    """

    group: str
    program: str
    scene: str
    kind: str
    n: int
    task: str = "solve"
    options: tuple[tuple[str, Any], ...] = ()
    variant: str = ""

    @property
    def place(self) -> tuple[str, str, int]:
        """What has to agree between programs that are compared."""
        return self.scene, self.kind, self.n

    @property
    def turns(self) -> tuple[Any, ...]:
        """What has the same value takes turns: one scene, or a whole group that is compared with itself."""
        whole = self.group in ("skips", "cube1")
        return (self.group,) if whole else (self.group, *self.place, self.variant)

    @property
    def series(self) -> tuple[str, str, str, str]:
        """What has the same name at every size."""
        return self.group, self.program, self.scene, self.kind


@dataclass
class Driver:
    """Where and how runs are made.

    Attributes
    ----------
    folder : scratch folder for scenes and answers.
    repeats : runs of each measurement, of which the median counts.
    pythons : interpreter by program name; ``""`` stands for all but kratos_lite.
    limit, memory : seconds and bytes after which a run is stopped.
    point : seconds that one run against error may be expected to take.
    budget : seconds after which no further scene is begun.
    tell : called with each line of progress.
    save : called with all rows so far after each scene.
    known : rows that need not be measured again.
    """

    folder: Path
    repeats: int = 3
    pythons: dict[str, str] = field(default_factory=dict)
    limit: float = 1800.0
    memory: float = 20e9
    point: float = 10.0
    budget: float = float("inf")
    tell: Callable[[str], None] = print
    save: Callable[[list[dict[str, Any]]], None] = list
    known: list[dict[str, Any]] = field(default_factory=list)
    absent: dict[str, str] = field(default_factory=dict)
    stems: dict[tuple[str, str, int], Path] = field(default_factory=dict)
    made: dict[tuple[str, str, int], scenes.Scene] = field(default_factory=dict)
    reference: dict[tuple[str, str, int], tuple[np.ndarray, dict[str, float]]] = field(default_factory=dict)

    def measure(self, runs: Sequence[Run]) -> list[dict[str, Any]]:
        """Make all runs and return one row each; programs on the same scene take turns."""
        rows: list[dict[str, Any]] = []
        runs = self._unknown(runs)
        beyond = {series(row) for row in self.known if self._is_last(row, runs)}
        end = perf_counter() + self.budget
        for turns in dict.fromkeys(run.turns for run in runs):
            if perf_counter() > end:
                self.tell("the time is used up; the rest is left out")
                break
            here = [run for run in runs if run.turns == turns and run.series not in beyond]
            made = self._interleaved(here)
            beyond |= {series(row) for row in made if self._is_last(row, runs)}
            rows += made
            for place in {run.place for run in here}:
                self._forget(place)
            self.save(rows)
        return rows

    def _unknown(self, runs: Sequence[Run]) -> list[Run]:
        """Return the runs of which no row is known."""
        known = {identity(row) for row in self.known}
        return [run for run in runs if (*run.series, run.n, run.variant) not in known]

    def _is_last(self, row: dict[str, Any], runs: Sequence[Run]) -> bool:
        """Return whether a curve ends here: it failed, is exact enough, or would take too long."""
        if "failed" in row or row["group"] != "error":
            return "failed" in row
        larger = [run.n for run in runs if run.series == series(row) and run.n > row["n"]]
        growth = (
            3.0
            if "variant" in row
            else (min(larger, default=row["n"]) / row["n"]) ** (2 if row["scene"] in PLANE else 3)
        )
        return row["errors"].get("displacement", 1.0) < ENOUGH or row["warm"] * growth > self.point

    def _forget(self, place: tuple[str, str, int]) -> None:
        """Remove the files and the solution of a scene."""
        self.reference.pop(place, None)
        self.made.pop(place, None)
        if (stem := self.stems.pop(place, None)) is not None:
            for old in stem.parent.glob(f"{stem.name}.*"):
                old.unlink()

    def _interleaved(self, runs: list[Run]) -> list[dict[str, Any]]:
        found: dict[int, list[dict[str, Any]]] = {i: [] for i in range(len(runs))}
        failed: dict[int, str] = {}
        for turn in range(self.repeats):
            for i, run in enumerate(runs):
                if i in failed or run.program in self.absent:
                    continue
                answer = self._once(run)
                if "failed" in answer:
                    failed[i] = answer["failed"]
                    self.tell(f"  {self._name(run)}: {answer['failed']}")
                elif "absent" not in answer:
                    found[i].append(answer)
                    self.tell(f"  {self._name(run)} ({turn + 1}/{self.repeats}): {answer['process']:.3f} s")
        return [
            self._row(run, found[i], failed.get(i, ""))
            for i, run in enumerate(runs)
            if found[i] or i in failed
        ]

    @staticmethod
    def _name(run: Run) -> str:
        words = [
            run.scene.rsplit("/", 1)[-1],
            run.kind,
            f"n={run.n}" if run.n else "",
            run.program,
            run.variant,
        ]
        return " ".join(word for word in words if word)

    # ---- one run -------------------------------------------------------------------------------

    def python(self, program: str) -> str:
        """Return the interpreter of a program."""
        if program.startswith("kratos_lite") or program == "pyamg":
            return self.pythons.get("kratos_lite", sys.executable)
        return self.pythons.get(program, self.pythons.get("", sys.executable))

    def stem(self, run: Run) -> Path:
        """Return the path of the scene without ending; it is written once, large ones by another process."""
        if run.task == "motion":  # a motion makes its bodies itself
            return self.folder / run.scene
        if run.scene.endswith(".mdpa"):
            return Path(run.scene.removesuffix(".mdpa"))
        if run.place not in self.stems:
            if run.task == "ale":
                self.stems[run.place] = ale.write(self.folder, run.kind, run.n)
            elif run.n < LARGE and run.task != "linear":
                self.made[run.place] = scenes.make(*run.place)
                self.stems[run.place] = scenes.write(self.made[run.place], self.folder)
            else:
                words = [*map(str, run.place), str(self.folder), run.task]
                command = [sys.executable, "-m", "benchmarks.scenes", *words]
                subprocess.run(command, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=True)
                self.stems[run.place] = self.folder / scenes.stem(*run.place)
        return self.stems[run.place]

    def _once(self, run: Run) -> dict[str, Any]:
        """Run once; return the answer of the program with its process time and memory."""
        job, answer, report = (self.folder / f"{word}.json" for word in ("job", "answer", "report"))
        displacement = self.folder / "displacement.npy"
        for old in (answer, report, displacement):
            old.unlink(missing_ok=True)
        words = {"task": run.task, "stem": str(self.stem(run)), "kind": run.kind, "folder": str(self.folder)}
        words |= {"scene": run.scene, "n": run.n, "program": run.program}
        words |= {"answer": str(answer), "displacement": str(displacement)} | dict(run.options)
        job.write_text(json.dumps(words))
        program = (PROGRAMS | HELPERS)[run.program]
        launched = self.launch(self._command(run.program, program, job), report, program.environment)
        if program.code and launched["status"] == 0:
            answer.write_text('{"phases": {}}')
        if not answer.exists():
            return {"failed": "stopped at the time limit" if launched["late"] else self._last_words()}
        found = json.loads(answer.read_text())
        if "absent" in found:
            self.absent[run.program] = found["absent"]
            self.tell(f"  {run.program} is left out: {found['absent']}")
            return found
        found |= {"peak": launched["peak"], "cpu": launched["cpu"]}
        found["process"] = launched["seconds"] - found["phases"].get("answer", 0.0)
        if displacement.exists() and "errors" not in found:
            found["errors"] = self._errors(run, np.load(displacement))
        return found

    def _command(self, name: str, program: Program, job: Path) -> list[str]:
        if program.code:
            return [self.python(name), "-c", program.code]
        launcher = program.launcher if program.launcher and shutil.which(program.launcher[0]) else ()
        return [*launcher, self.python(name), "-m", f"benchmarks.programs.{program.module}", str(job)]

    def launch(self, command: list[str], report: Path, environment: dict[str, str]) -> dict[str, Any]:
        """Run a command through the launcher and return what it measured."""
        variables = os.environ | MACHINERY | {"PYTHONPATH": str(ROOT)} | environment
        with (self.folder / "output.txt").open("w") as output:
            subprocess.run(
                [
                    sys.executable,
                    "-I",
                    "-S",
                    str(LAUNCHER),
                    *map(str, (report, self.limit, self.memory)),
                    *command,
                ],
                env=variables,
                cwd=self.folder,
                stdout=output,
                stderr=subprocess.STDOUT,
                check=True,
            )
        return dict(json.loads(report.read_text()))

    def _last_words(self) -> str:
        output = (self.folder / "output.txt").read_text(errors="replace")
        lines = re.sub(r"(/[^/\s'\"]+)+/", "", output).strip().splitlines()  # no paths of this machine
        return "failed: " + (lines[-1][:200] if lines else "without a word")

    def _errors(self, run: Run, u: np.ndarray) -> dict[str, float]:
        """Return the errors of a solution, and how far it is from that of the first program."""
        known, exact = self.reference.setdefault(run.place, (u, {}))
        difference = float(np.abs(u - known).max() / max(np.abs(known).max(), 1e-300))
        if not dict(run.options).get("errors"):
            return {"difference": difference}
        if not exact or difference > 0.01 * exact["displacement"]:  # else its error is the same within 1 %
            plain = run.scene, run.kind.split()[0], run.n
            exact = exact | errors.errors(self.made.get(plain) or scenes.make(*plain), u)
            self.reference[run.place] = (known, self.reference[run.place][1] or exact)
        return {"difference": difference} | exact

    # ---- rows ----------------------------------------------------------------------------------

    def _row(self, run: Run, answers: list[dict[str, Any]], failed: str) -> dict[str, Any]:
        """Return the medians of the answers of one measurement."""
        row: dict[str, Any] = {"group": run.group, "program": run.program, "scene": Path(run.scene).stem}
        row |= {"kind": run.kind, "n": run.n, "task": run.task}
        row |= {"variant": run.variant} if run.variant else {}
        if failed and not answers:
            return row | {"failed": failed}
        phases = dict.fromkeys(name for answer in answers for name in answer["phases"])
        median = {name: statistics.median(a["phases"].get(name, 0.0) for a in answers) for name in phases}
        row["phases"] = {name: float(f"{seconds:.4g}") for name, seconds in median.items()}
        row["process"] = round(statistics.median(a["process"] for a in answers), 6)
        row["spread"] = [round(pick(a["process"] for a in answers), 6) for pick in (min, max)]
        row["work"] = round(sum(s for name, s in median.items() if name not in OVERHEAD), 6)
        inside = sum(s for name, s in median.items() if name not in ("import", "answer"))
        row["start"] = round(row["process"] - inside, 6)
        if "warm" in answers[0]:
            row["warm"] = round(statistics.median(a["warm"] for a in answers), 6)
        row["peak"] = int(statistics.median(a["peak"] for a in answers))
        row["runs"] = len(answers)
        for word in (
            "unknowns",
            "iterations",
            "residual",
            "rounding",
            "memory",
            "solver",
            "version",
            "errors",
            "reported",
            "drift",
        ):
            if answers[0].get(word) not in (None, "", {}):
                row[word] = answers[0][word]
        return row


# ---- what is written -------------------------------------------------------------------------------


def machine() -> dict[str, Any]:
    """Return processor, cores and memory; no name of the machine."""
    model = platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    affinity = getattr(os, "sched_getaffinity", None)
    cores = len(affinity(0)) if affinity else os.cpu_count()
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 0
    return {"processor": model, "cores": cores, "memory": memory, "system": platform.system()}


def results(
    driver: Driver, command: str, rows: Iterable[dict[str, Any]], old: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Return what is kept as JSON: rows with machine, versions and date; old ones unless measured again."""
    rows, old = list(rows), old or {}
    versions = {row["program"]: row["version"] for row in rows if "version" in row}
    new = {identity(row): kept(row) for row in rows}
    return {
        "command": command,
        "date": date.today().isoformat(),
        "machine": machine(),
        "python": platform.python_version(),
        "versions": old.get("versions", {}) | versions,
        "absent": {name: why for name, why in driver.absent.items() if name not in old.get("versions", {})},
        "repeats": driver.repeats,
        "rows": list(({identity(row): row for row in old.get("rows", [])} | new).values()),
    }


def series(row: dict[str, Any]) -> tuple[str, ...]:
    """Return what rows of one curve have in common, as `Run.series`."""
    return tuple(row[word] for word in ("group", "program", "scene", "kind"))


def identity(row: dict[str, Any]) -> tuple[Any, ...]:
    """Return what two rows have in common if they measure the same."""
    return (*series(row), row["n"], row.get("variant", ""))


def kept(row: dict[str, Any]) -> dict[str, Any]:
    """Return what is kept of a row: all of it, but of run time against error only what the page shows."""
    dropped = {"version"}
    if row["group"] == "error":
        dropped |= {"task", "phases", "work", "start", "spread", "peak", "runs", "iterations", "residual"}
        errors = {k: v for k, v in row.get("errors", {}).items() if k in ERRORS or "reported" in row}
        row = row | {"errors": {name: float(f"{value:.6g}") for name, value in errors.items()}}
    return {key: value for key, value in row.items() if key not in dropped}


def as_json(found: dict[str, Any]) -> str:
    """Return results as the text of a file with one row a line.

    >>> print(as_json({"command": "error", "rows": [{"n": 1}, {"n": 2}]}), end="")
    {
     "command": "error",
     "rows": [
      {"n": 1},
      {"n": 2}
     ]
    }
    """
    head = json.dumps(found | {"rows": []}, indent=1)
    rows = ",\n".join(f"  {json.dumps(row)}" for row in found["rows"])
    return head.replace('"rows": []', f'"rows": [\n{rows}\n ]') + "\n"


def scratch() -> tempfile.TemporaryDirectory[str]:
    """Return a temporary folder for scenes and answers."""
    return tempfile.TemporaryDirectory(prefix="kratos_lite_bench_")
