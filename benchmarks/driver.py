"""The driver: every run in a process of its own, programs in turns, medians, and results kept as JSON."""

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
from benchmarks.programs import HELPERS, PROGRAMS, RANKS, Program
from benchmarks.programs.common import OVERHEAD
from benchmarks.tables import Row
from kratos_lite.verification import errors

ROOT = Path(__file__).resolve().parents[1]
LAUNCHER = Path(__file__).with_name("launch.py")
PLANE = ("l_domain", "hole_incompressible", "cook")
"""Scenes of one layer: their unknowns grow as n²."""
ENOUGH = 1e-4
"""Error at which a curve has gone far enough."""
PLAIN_WORDS = ("task", "phases", "work", "spread", "peak", "iterations", "residual")
"""What is not kept of run time against error, which has many rows."""


@dataclass(frozen=True)
class Run:
    """One measurement to make: a program, a scene and what to do with it.

    Attributes
    ----------
    group : the set of rows it belongs to.
    scene, kind, n : as in `scenes.make`; or the path of a `.mdpa` file as the scene.
    options : further words of the job, such as ``write=True``.
    shown : further words of the row.
    """

    group: str
    program: str
    scene: str
    kind: str
    n: int
    task: str = "solve"
    options: tuple[tuple[str, Any], ...] = ()
    variant: str = ""
    shown: tuple[str, ...] = ()

    @property
    def place(self) -> tuple[str, str, int]:
        """What has to agree between programs that are compared."""
        return self.scene, self.kind, self.n

    @property
    def turns(self) -> tuple[Any, ...]:
        """What has the same value takes turns: one scene, or a whole group that is compared with itself."""
        if self.group in ("skips", "cube1"):
            return (self.group,)
        return (self.group, *self.place, self.variant * (self.group == "error"))

    @property
    def labels(self) -> Row:
        """What a row says of its run."""
        row = {"group": self.group, "program": self.program, "scene": Path(self.scene).stem}
        row |= {"kind": self.kind, "n": self.n, "task": self.task}
        row |= {"variant": self.variant} if self.variant else {}
        shown = {word: value for word, value in self.options if word in self.shown}
        return row | {word: list(v) if isinstance(v, tuple) else v for word, v in shown.items()}

    def __str__(self) -> str:
        words = (Path(self.scene).name, self.kind, f"n={self.n}" * bool(self.n), self.program, self.variant)
        return " ".join(filter(None, words))


@dataclass
class Driver:
    """Runs measurements in turns.

    Attributes
    ----------
    folder : for the files of scenes.
    repeats : runs of each measurement.
    pythons : interpreter by program; "" stands for all but kratos_lite.
    limit, memory : seconds and bytes that one run may take.
    point : seconds that the next point of a curve may take, as expected.
    budget : seconds after which no further scene is begun.
    tell : called with each line of progress.
    save : called with all rows so far after each scene.
    known : rows that need not be measured again.
    absent : programs that are not there, and why.
    """

    folder: Path
    repeats: int = 3
    pythons: dict[str, str] = field(default_factory=dict)
    limit: float = 1800.0
    memory: float = 20e9
    point: float = 10.0
    budget: float = float("inf")
    tell: Callable[[str], None] = print
    save: Callable[[list[Row]], None] = list
    known: list[Row] = field(default_factory=list)
    absent: dict[str, str] = field(default_factory=dict)
    stems: dict[tuple[str, str, int], Path] = field(default_factory=dict)
    reference: dict[tuple[str, str, int], tuple[np.ndarray, dict[str, float]]] = field(default_factory=dict)

    def measure(self, runs: Sequence[Run]) -> list[Row]:
        """Make all runs and return one row each; programs on the same scene take turns."""
        rows: list[Row] = []
        known = {identity(row) for row in self.known}
        runs = [run for run in runs if identity(run.labels) not in known]
        ended = {series(row) for row in self.known if self._is_last(row, runs)}
        end = perf_counter() + self.budget
        for turns in dict.fromkeys(run.turns for run in runs):
            if perf_counter() > end:
                self.tell("the time is used up; the rest is left out")
                break
            here = [run for run in runs if run.turns == turns and series(run.labels) not in ended]
            made = self._in_turns(here)
            ended |= {series(row) for row in made if self._is_last(row, runs)}
            rows += made
            self._forget()
            self.save(rows)
        return rows

    def _is_last(self, row: Row, runs: Sequence[Run]) -> bool:
        """Return whether a curve ends here: it failed, is exact enough, or would take too long."""
        if "failed" in row or row["group"] != "error":
            return "failed" in row
        factor = 3.0
        if "variant" not in row:
            larger = [run.n for run in runs if series(run.labels) == series(row) and run.n > row["n"]]
            factor = (min(larger, default=row["n"]) / row["n"]) ** (2 if row["scene"] in PLANE else 3)
        return row["errors"].get("displacement", 1.0) < ENOUGH or row["warm"] * factor > self.point

    def _forget(self) -> None:
        """Remove the files and the solutions of the scenes so far."""
        for stem in self.stems.values():
            for old in stem.parent.glob(f"{stem.name}.*"):
                old.unlink()
        self.stems.clear()
        self.reference.clear()

    def _in_turns(self, runs: list[Run]) -> list[Row]:
        """Return the rows of runs that take turns."""
        answers: dict[Run, list[Row]] = {run: [] for run in runs}
        for turn in range(self.repeats):
            for run, found in answers.items():
                if run.program in self.absent or (found and "failed" in found[-1]):
                    continue
                with scratch() as name:
                    answer = self._once(run, Path(name))
                if "absent" in answer:
                    self.absent[run.program] = answer["absent"]
                    self.tell(f"  {run.program} is left out: {answer['absent']}")
                    continue
                found.append(answer)
                said = answer.get("failed") or f"{answer['process']:.3f} s"
                self.tell(f"  {run} ({turn + 1}/{self.repeats}): {said}")
        return [row_of(run, found) for run, found in answers.items() if found]

    # ---- one run -------------------------------------------------------------------------------

    def python(self, program: str) -> str:
        """Return the interpreter of a program."""
        if program in RANKS:
            return self.pythons.get("", os.environ.get("KRATOS_LITE_MPI_PYTHON", sys.executable))
        if program.startswith("kratos_lite") or program == "pyamg":
            return self.pythons.get("kratos_lite", sys.executable)
        return self.pythons.get(program, self.pythons.get("", sys.executable))

    def stem(self, run: Run) -> Path:
        """Return the path of the files of a scene without ending; they are written once."""
        if run.task in ("motion", "ranks"):  # these make their bodies themselves
            return self.folder / run.scene
        if run.scene.endswith(".mdpa"):
            return Path(run.scene.removesuffix(".mdpa"))
        if run.place not in self.stems:
            if run.task == "ale":
                self.stems[run.place] = ale.write(self.folder, run.kind, run.n)
            else:
                write = scenes.write_system if run.task == "linear" else scenes.write
                self.stems[run.place] = write(scenes.make(*run.place), self.folder)
        return self.stems[run.place]

    def _once(self, run: Run, folder: Path) -> Row:
        """Run once; return the answer of the program with its process time and memory."""
        job, answer, displacement = (folder / name for name in ("job.json", "answer.json", "u.npy"))
        words = {"task": run.task, "stem": str(self.stem(run)), "kind": run.kind, "folder": str(folder)}
        words |= {"scene": run.scene, "n": run.n, "program": run.program}
        words |= {"answer": str(answer), "displacement": str(displacement)} | dict(run.options)
        job.write_text(json.dumps(words))
        program = (PROGRAMS | HELPERS | RANKS)[run.program]
        launched = self._launch(self._command(run.program, program, job), folder, program.environment)
        if program.code and launched["status"] == 0:
            answer.write_text('{"phases": {}}')
        if not answer.exists():
            return {"failed": "stopped at the time limit" if launched["late"] else last_words(folder)}
        found: Row = json.loads(answer.read_text())
        if "absent" in found:
            return found
        found["peak"] = launched["peak"]
        found["process"] = launched["seconds"] - found["phases"].get("answer", 0.0)
        if displacement.exists() and "errors" not in found:
            found["errors"] = self._errors(run, np.load(displacement))
        return found

    def _command(self, name: str, program: Program, job: Path) -> list[str]:
        """Return the command of a program; mpirun is the one beside its interpreter, if there is one."""
        python, words = self.python(name), list(program.launcher)
        if program.code:
            return [python, "-c", program.code]
        if words:
            near = Path(python).with_name(words[0])
            words = [str(near), *words[1:]] if near.exists() else words if shutil.which(words[0]) else []
        return [*words, python, "-m", "benchmarks.programs", program.module, str(job)]

    def _launch(self, command: list[str], folder: Path, environment: dict[str, str]) -> Row:
        """Run a command through the launcher and return what it measured."""
        # byte code may be kept, as on any user's machine
        variables = {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPATH": str(ROOT)} | environment
        report = folder / "report.json"
        words = [sys.executable, "-I", "-S", str(LAUNCHER), str(report), str(self.limit), str(self.memory)]
        with (folder / "output.txt").open("w") as output:
            streams = {"stdout": output, "stderr": subprocess.STDOUT}
            subprocess.run([*words, *command], env=os.environ | variables, cwd=folder, check=True, **streams)
        return dict(json.loads(report.read_text()))

    def _errors(self, run: Run, u: np.ndarray) -> dict[str, float]:
        """Return the errors of a solution, and how far it is from that of the first program."""
        known, exact = self.reference.setdefault(run.place, (u, {}))
        difference = float(np.abs(u - known).max() / max(np.abs(known).max(), 1e-300))
        if not dict(run.options).get("errors"):
            return {"difference": difference}
        if not exact or difference > 0.01 * exact["displacement"]:  # else its error is the same within 1 %
            scene = scenes.make(run.scene, run.kind.split()[0], run.n)
            exact = exact | errors.errors(scene, u)
            self.reference[run.place] = (known, self.reference[run.place][1] or exact)
        return {"difference": difference} | exact


def last_words(folder: Path) -> str:
    """Return the last line of what a program printed, without paths of this machine."""
    output = (folder / "output.txt").read_text(errors="replace")
    lines = re.sub(r"(/[^/\s'\"]+)+/", "", output).strip().splitlines()
    told = [line for line in lines if re.match(r"[\w.]*Error\b", line)] or lines
    return "failed: " + (told[-1][:200] if told else "without a word")


# ---- rows ------------------------------------------------------------------------------------------


def row_of(run: Run, answers: Sequence[Row]) -> Row:
    """Return the medians of the answers of one measurement."""
    good = [answer for answer in answers if "failed" not in answer]
    if not good:
        return run.labels | answers[-1]
    row: Row = run.labels | {"phases": {}}
    row |= {name: value for name, value in medians(good).items() if value not in (None, "", {})}
    row["spread"] = [pick(answer["process"] for answer in good) for pick in (min, max)]
    row["work"] = sum(s for name, s in row["phases"].items() if name not in OVERHEAD)
    return row


def medians(values: Sequence[Any]) -> Any:
    """Return the median of numbers, those of dictionaries by key, and of all else the first.

    >>> medians([{"t": {"solve": 1.0}, "name": "a"}, {"t": {"solve": 3.0}}, {"t": {"solve": 2.5}}])
    {'t': {'solve': 2.5}, 'name': 'a'}
    """
    if isinstance(values[0], dict):
        names = dict.fromkeys(name for value in values for name in value)
        return {name: medians([value[name] for value in values if name in value]) for name in names}
    if isinstance(values[0], int):
        return statistics.median_low(values)
    return statistics.median(values) if isinstance(values[0], float) else values[0]


def series(row: Row) -> tuple[str, ...]:
    """Return what rows of one curve have in common."""
    return tuple(row[word] for word in ("group", "program", "scene", "kind"))


def identity(row: Row) -> tuple[Any, ...]:
    """Return what two rows have in common if they measure the same."""
    return (*series(row), row["n"], row.get("variant", ""))


# ---- what is kept ----------------------------------------------------------------------------------


def machine() -> Row:
    """Return processor, cores and memory; no name of the machine."""
    about = Path("/proc/cpuinfo")
    model = re.search(r"model name\s*: (.*)", about.read_text() if about.exists() else "")
    cores = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count()
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    processor = model[1].strip() if model else platform.machine()
    return {"processor": processor, "cores": cores, "memory": memory, "system": platform.system()}


def results(driver: Driver, command: str, rows: Iterable[Row], old: Row | None = None) -> Row:
    """Return what is kept as JSON: rows with machine, versions and date; old ones unless measured again."""
    rows, old = list(rows), old or {}
    versions: dict[str, str] = dict(old.get("versions", {}))
    for row in rows:
        versions |= row.get("versions") or ({row["program"]: row["version"]} if "version" in row else {})
    new = {identity(row): kept(row) for row in rows}
    return {
        "command": command,
        "date": date.today().isoformat(),
        "machine": machine(),
        "python": platform.python_version(),
        "versions": versions,
        "absent": {name: why for name, why in driver.absent.items() if name not in old.get("versions", {})},
        "repeats": driver.repeats,
        "rows": list(({identity(row): row for row in old.get("rows", [])} | new).values()),
    }


def kept(row: Row) -> Row:
    """Return what is kept of a row: all of it, but of run time against error only what the page shows."""
    dropped = {"version", "versions"}
    if row["group"] == "error":
        dropped |= set(PLAIN_WORDS)
        words = ("difference", "displacement", "energy" if "reported" in row else "")
        row = row | {"errors": {k: v for k, v in row.get("errors", {}).items() if k in words}}
    return {key: value for key, value in row.items() if key not in dropped}


def load(path: Path | None) -> Row:
    """Return the results kept in a file, or nothing."""
    return dict(json.loads(path.read_text("utf-8"))) if path is not None and path.exists() else {}


def save(path: Path, found: Row) -> None:
    """Write results to a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(as_json(found), encoding="utf-8")


def as_json(found: Row) -> str:
    """Return results as the text of a file with one row a line, numbers in six digits.

    >>> print(as_json({"command": "error", "rows": [{"n": 1}, {"n": 1 / 3}]}), end="")
    {
     "command": "error",
     "rows": [
      {"n": 1},
      {"n": 0.333333}
     ]
    }
    """
    lists = [name for name in ("rows", "hand", "files") if name in found]
    text = json.dumps(found | {name: [] for name in lists}, indent=1)
    for name in lists:
        short = json.loads(json.dumps(found[name]), parse_float=lambda word: float(f"{float(word):.6g}"))
        rows = ",\n".join(f"  {json.dumps(row, ensure_ascii=False)}" for row in short)
        text = text.replace(f'"{name}": []', f'"{name}": [\n{rows}\n ]')
    return text + "\n"


def scratch() -> tempfile.TemporaryDirectory[str]:
    """Return a temporary folder for scenes and answers."""
    return tempfile.TemporaryDirectory(prefix="kratos_lite_bench_")
