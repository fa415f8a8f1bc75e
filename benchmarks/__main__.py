"""Measure: ``python -m benchmarks quick``, or ``full``, or one set by its name.

Sets: ``kratos error growth stall assembly parse skips cube1 motion ale gradient distributed``,
and in this process ``effectivity adaptive edges dynamics laws loads folders decks``.

``report`` makes the pages and pictures of the docs from the results kept; ``references`` makes the
energies of the scenes without an exact field.  See benchmarks/README.md.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks import (
    accuracy,
    curves,
    decks,
    dynamics,
    folders,
    laws,
    loads,
    report,
    scaling,
    scenes,
    sets,
    stall,
)
from benchmarks.driver import ROOT, Driver, Run, load, results, save, scratch
from benchmarks.motion import MOTIONS
from benchmarks.programs import HELPERS, PROGRAMS
from benchmarks.tables import NUMPY, OURS, THEIRS, Row

RESULTS = Path(__file__).with_name("results")
PAGE, PICTURES = ROOT / "docs" / "about" / "benchmarks.md", ROOT / "docs" / "images" / "benchmarks"
COMMANDS: dict[str, Callable[[argparse.Namespace], list[Run]]] = {
    "quick": lambda o: sets.quick(o.programs),
    "full": lambda o: [run for name, make in COMMANDS.items() if name not in NOT_FULL for run in make(o)],
    "kratos": lambda o: sets.kratos(o.programs, o.cells, o.cases, o.folder),
    "error": lambda o: sets.error_runs(
        o.programs, o.scenes or sets.ERROR_SCENES, sizes(o.cells), o.elements or ()
    ),
    "growth": lambda o: sets.runs(
        "growth",
        (OURS, THEIRS),
        o.programs,
        [("block", kind, n) for kind in o.elements or ("8N",) for n in o.cells or sets.GROWTH],
    ),
    "stall": lambda o: stall.runs(o.programs, o.unknowns, o.scenes),
    "assembly": lambda o: sets.assembly_runs(o.programs, sizes((o.cells or [None])[0])),
    "parse": lambda o: sets.parse_runs(o.programs, o.cells or (20, 50)),
    "skips": lambda o: sets.skip_runs(o.programs, (o.cells or (32,))[0]),
    "cube1": lambda o: sets.cube1_runs(o.programs),
    "motion": lambda o: sets.runs(
        "motion", (OURS, NUMPY), o.programs, [(name, "", 0) for name in MOTIONS], "motion"
    ),
    "ale": lambda o: sets.ale_runs(o.programs),
    "gradient": lambda o: sets.gradient_runs(o.programs, o.cells or (20, 40)),
    "distributed": lambda o: scaling.runs(o.cells),
}
"""The runs of each set, from the options."""
NOT_FULL = ("quick", "full", "distributed")
OTHERS: dict[str, Callable[[argparse.Namespace], int | None]] = {
    "effectivity": lambda o: accuracy.effectivity(o.scenes, o.elements),
    "adaptive": lambda o: accuracy.adaptive(o.scenes, o.elements),
    "edges": lambda o: accuracy.edges(),
    "dynamics": lambda o: dynamics.dynamics(o.pythons.get("Kratos", o.pythons.get("", ""))),
    "laws": lambda o: laws.laws(
        o.pythons.get("Kratos", o.pythons.get("", "")), o.cells or laws.CELLS, o.path
    ),
    "loads": lambda o: loads.loads(),
    "folders": lambda o: folders.folders(o.path, o.pythons.get("Kratos", o.pythons.get("", ""))),
    "decks": lambda o: (decks.speed if o.path == ROOT or o.path.is_file() else decks.decks)(o.path),
    "references": lambda o: references(o.cells or (4, 8, 16)),
    "report": lambda o: write_report(),
}
"""What is done in this process."""
REPEATS = {"growth": 1, "stall": 1, "full": 3, "cube1": 11, "quick": 1, "error": 1, "distributed": 3}
LIMITS = {"stall": 75.0}
"""Seconds after which one run is stopped; else half an hour."""


def main(words: Sequence[str] | None = None) -> int:
    """Run a command; return 0, or 1 where nothing could be measured."""
    options = arguments(words)
    if options.command in OTHERS:
        return OTHERS[options.command](options) or 0
    with scratch() as name:
        options.folder = Path(name)
        repeats = options.repeats or REPEATS.get(options.command, 5)
        limit = options.limit or LIMITS.get(options.command, 1800.0)
        limits = limit, options.memory * 1e9, options.point, options.budget
        driver = Driver(options.folder, repeats, options.pythons, *limits)
        runs = COMMANDS[options.command](options)
        if options.out is not None:
            driver.save = saver(driver, options)
            driver.known = load(options.out).get("rows", []) if options.missing else []
        rows = driver.measure([r for r in runs if not options.elements or r.kind in (*options.elements, "")])
    if options.command == "distributed":
        scaling.PAGE.write_text(scaling.page(load(options.out)), encoding="utf-8")
        print(scaling.goals(rows), end="")
    print("\n" + report.text(rows))
    return 0 if any("failed" not in row for row in rows) else 1


def sizes(cells: Any) -> dict[str, Any] | None:
    """Return the same cells for every element; None where none are given."""
    return dict.fromkeys(scenes.KINDS, cells) if cells else None


def saver(driver: Driver, options: argparse.Namespace) -> Callable[[list[Row]], None]:
    """Return what writes the rows so far beside those kept in the file before."""
    ranks = options.command == "distributed"
    old = {} if ranks else load(options.out)
    more = {"files": scaling.text_files(options.cells)} if ranks else {}
    return lambda rows: save(
        options.out, results(driver, options.command, scaling.compared(rows), old) | more
    )


def arguments(words: Sequence[str] | None) -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = argparse.ArgumentParser(
        "python -m benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names, real = [*PROGRAMS, *HELPERS], ROOT.parent / "shared" / "cases"
    many = {"nargs": "+", "metavar": "NAME"}
    add, seconds = parser.add_argument, {"type": float, "metavar": "SECONDS"}
    add("command", choices=[*COMMANDS, *OTHERS])
    add("path", nargs="?", type=Path, default=ROOT, help="for laws, folders, decks: their files")
    add("--programs", choices=names, default=names, help=f"some of: {', '.join(names)}", **many)
    add("--scenes", choices=sorted(scenes.SCENES), help="for error, stall: some of their scenes", **many)
    add("--elements", choices=scenes.KINDS, help=f"some of: {', '.join(scenes.KINDS)}", **many)
    add("--cells", nargs="+", type=int, metavar="N", help="cells along an edge, in place of those of the set")
    add("--repeats", type=int, metavar="N", help="runs of each measurement; their median counts")
    text = "interpreter of the other programs, or of one; or KRATOS_LITE_BENCH_PYTHON"
    add("--python", action="append", default=[], metavar="[PROGRAM=]PATH", help=text)
    text = "real scenes, each a folder with case.json"
    add("--cases", type=Path, default=real, metavar="FOLDER", help=text)
    add("--limit", help="after which one run is stopped", **seconds)
    add("--unknowns", type=float, default=stall.UNKNOWNS, metavar="N", help="for stall: of each scene, about")
    add("--point", default=10.0, help="for error: that a run may take, as expected", **seconds)
    add("--budget", default=float("inf"), help="after which no scene is begun", **seconds)
    add("--missing", action="store_true", help="measure only what --out does not hold")
    add("--memory", type=float, default=20.0, metavar="GB", help="that one run may take")
    text = "JSON file of the results; rows in it stay unless they are measured again"
    add("--out", type=Path, metavar="FILE", help=text)
    options = parser.parse_args(words)
    if options.command == "distributed":
        options.out = options.out or RESULTS / "distributed.json"
    options.pythons = pythons([*os.environ.get("KRATOS_LITE_BENCH_PYTHON", "").split(","), *options.python])
    return options


def pythons(words: Sequence[str]) -> dict[str, str]:
    """Return interpreters by program; "" stands for all but kratos_lite.

    >>> pythons(["/opt/peers/bin/python", "GetFEM=/usr/bin/python3"])
    {'': '/opt/peers/bin/python', 'GetFEM': '/usr/bin/python3'}
    """
    found = {}
    for word in filter(None, words):
        program, sign, path = word.partition("=")
        found[program if sign else ""] = path if sign else word
    if unknown := set(found) - {"", *PROGRAMS, *HELPERS}:
        raise SystemExit(
            f"--python: {', '.join(sorted(unknown))} is no program; known are {', '.join(PROGRAMS)}"
        )
    return found


def write_report() -> int:
    """Make the pages and their pictures from the results kept."""
    files = {path.stem: load(path) for path in sorted(RESULTS.glob("*.json"))}
    files = {name: found for name, found in files.items() if name in COMMANDS}
    if not files:
        print(f"there are no results in {RESULTS}; make some with --out", file=sys.stderr)
        return 1
    if ranks := files.pop("distributed", None):
        scaling.PAGE.write_text(scaling.page(ranks), encoding="utf-8")
    PAGE.write_text(report.page([*files.values()]), encoding="utf-8")
    rows = report.of([row for found in files.values() for row in found["rows"]], "error")
    for scene in dict.fromkeys(row["scene"] for row in rows):
        curves.picture(rows, scene, PICTURES / f"{scene}.png")
    print(f"wrote {PAGE}")
    return 0


def references(sizes: Sequence[int]) -> int:
    """Print the energies of the scenes without exact field: 27N, each size twice the last, extrapolated."""
    for name in scenes.ENERGIES:
        found = []
        for n in sizes:
            scene = scenes.make(name, "27N", n)
            u = scene.model.solve(tolerance=1e-11).displacement()
            found.append(float((scene.forces() * u).sum()) / 2)
        a, b, c = found[-3:]
        limit = c - (c - b) ** 2 / (c - 2 * b + a)
        print(f"{name}: {' '.join(f'{energy:.10g}' for energy in found)} -> {limit:.10g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
