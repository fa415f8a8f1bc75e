"""Measure: ``python -m benchmarks quick``, or ``full``, or one set by its name.

Sets: ``kratos error growth stall assembly parse skips cube1 motion ale``.

``report`` makes docs/about/benchmarks.md and its picture from the results kept; ``references`` makes the
energies of the scenes without an exact field.  See benchmarks/README.md.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks import cases, curves, distributed, effectivity, report, requested, scaling, scenes, sets
from benchmarks import stall as stalling
from benchmarks.driver import ROOT, Driver, Run, as_json, results, scratch
from benchmarks.programs import HELPERS, PROGRAMS
from benchmarks.tables import Row

RESULTS = Path(__file__).with_name("results")
PAGE, PICTURES = ROOT / "docs" / "about" / "benchmarks.md", ROOT / "docs" / "images" / "benchmarks"
QUICK_SIZES = {"4N": (4, 8), "8N": (4, 8), "10N": (2, 4), "20N": (2, 4), "27N": (2, 4)}
QUICK_PROGRAMS = ("kratos_lite", "kratos_lite NumPy", "Kratos", "scikit-fem")


def quick(options: argparse.Namespace, folder: Path) -> list[Run]:
    """Return a set that ends within two minutes."""
    names = options.programs
    some = [name for name in names if name in QUICK_PROGRAMS]
    runs = sets.goal_runs(names, (("block", "8N", 10), ("cube", "8N", 10), ("block", "27N", 4)))
    runs += sets.error_runs(some, ("manufactured", "cantilever"), QUICK_SIZES)
    runs += sets.assembly_runs(some, {"8N": 10, "10N": 4, "27N": 4})
    return runs + sets.parse_runs(names, (10,)) + sets.cube1_runs(names) + sets.skip_runs(names, 8)


def kratos(options: argparse.Namespace, folder: Path) -> list[Run]:
    """Return the goal rows and the real scenes."""
    goals = sets.GOALS
    if options.cells:
        goals = tuple((*kind, n) for kind in dict.fromkeys(goal[:2] for goal in goals) for n in options.cells)
    given = options.cases
    files = cases.prepared(given, folder) if given.is_dir() else []
    return sets.goal_runs(options.programs, goals) + sets.case_runs(options.programs, files)


def error(options: argparse.Namespace, folder: Path) -> list[Run]:
    """Return run time against error."""
    sizes = {kind: tuple(options.cells) for kind in scenes.KINDS} if options.cells else None
    scenes_ = options.scenes or sets.ERROR_SCENES
    return sets.error_runs(options.programs, scenes_, sizes, options.elements or ())


def growth(options: argparse.Namespace, folder: Path) -> list[Run]:
    """Return the clamped block from small to large."""
    return sets.growth_runs(options.programs, options.cells or sets.GROWTH, options.elements or ("8N",))


def stall(options: argparse.Namespace, folder: Path) -> list[Run]:
    """Return the scenes on which multigrid may stall."""
    return stalling.runs(options.programs, options.unknowns, options.scenes)


def assembly(options: argparse.Namespace, folder: Path) -> list[Run]:
    """Return the assembly alone."""
    sizes = {kind: options.cells[0] for kind in scenes.KINDS} if options.cells else None
    return sets.assembly_runs(options.programs, sizes)


def full(options: argparse.Namespace, folder: Path) -> list[Run]:
    """Return everything."""
    return [
        run for name in COMMANDS if name not in ("quick", "full") for run in COMMANDS[name](options, folder)
    ]


COMMANDS: dict[str, Callable[[argparse.Namespace, Path], list[Run]]] = {
    "quick": quick,
    "full": full,
    "kratos": kratos,
    "error": error,
    "growth": growth,
    "stall": stall,
    "assembly": assembly,
    "parse": lambda options, folder: sets.parse_runs(options.programs, options.cells or (20, 50)),
    "skips": lambda options, folder: sets.skip_runs(options.programs, (options.cells or (32,))[0]),
    "cube1": lambda options, folder: sets.cube1_runs(options.programs),
    "motion": lambda options, folder: sets.motion_runs(options.programs),
    "ale": lambda options, folder: sets.ale_runs(options.programs),
}
REPEATS = {"growth": 1, "stall": 1, "full": 3, "cube1": 11, "quick": 1, "error": 1}
LIMITS = {"stall": 75.0}
"""Seconds after which one run is stopped; else half an hour."""


def main(words: Sequence[str] | None = None) -> int:
    """Run a command; return 0, or 1 where nothing could be measured."""
    options = arguments(words)
    if options.command == "report":
        return write_report()
    if options.command == "effectivity":
        effectivity.write(effectivity.run(options.scenes, options.elements))
        return 0
    if options.command == "adaptive":
        requested.write(requested.run(options.scenes, options.elements))
        effectivity.write_page(kept(effectivity.RESULTS)["rows"])
        return 0
    if options.command == "distributed":
        python = options.pythons.get("")
        found = distributed.run(
            python, options.elements, options.cells, options.repeats or 3, options.limit or 1800.0
        )
        distributed.write(found)
        print(scaling.goals(found["rows"]), end="")
        return 0
    if options.command == "references":
        return references(options.cells or (4, 8, 16))
    with scratch() as name:
        repeats = options.repeats or REPEATS.get(options.command, 5)
        limit = options.limit or LIMITS.get(options.command, 1800.0)
        limits = limit, options.memory * 1e9, options.point, options.budget
        driver = Driver(Path(name), repeats, options.pythons, *limits)
        runs = COMMANDS[options.command](options, Path(name))
        if options.out is not None:
            driver.save = saver(driver, options)
            driver.known = kept(options.out).get("rows", []) if options.missing else []
        rows = driver.measure([r for r in runs if not options.elements or r.kind in (*options.elements, "")])
    print("\n" + report.text(rows))
    return 0 if any("failed" not in row for row in rows) else 1


def saver(driver: Driver, options: argparse.Namespace) -> Callable[[list[Row]], None]:
    """Return what writes the rows so far beside those kept in the file before."""
    old = kept(options.out)

    def save(rows: list[Row]) -> None:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(as_json(results(driver, options.command, rows, old)))

    return save


def kept(path: Path | None) -> dict[str, Any]:
    """Return the results kept in a file, or nothing."""
    return dict(json.loads(path.read_text())) if path is not None and path.exists() else {}


def arguments(words: Sequence[str] | None) -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = argparse.ArgumentParser(
        "python -m benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("command", choices=[*COMMANDS, "report", "references", "effectivity", "adaptive", "distributed"])
    add("--programs", nargs="+", choices=[*PROGRAMS, *HELPERS], default=[*PROGRAMS, *HELPERS], metavar="NAME",
        help="some of: " + ", ".join([*PROGRAMS, *HELPERS]))  # fmt: skip
    add(
        "--scenes",
        nargs="+",
        choices=sorted({*scenes.SCENES, *requested.MAKERS}),
        metavar="NAME",
        help="for error, stall: some of their scenes",
    )
    add(
        "--elements",
        nargs="+",
        choices=scenes.KINDS,
        metavar="KIND",
        help="some of " + " ".join(scenes.KINDS),
    )
    add("--cells", nargs="+", type=int, metavar="N", help="cells along an edge, in place of those of the set")
    add("--repeats", type=int, metavar="N", help="runs of each measurement; their median counts")
    add("--python", action="append", default=[], metavar="[PROGRAM=]PATH",
        help="interpreter of the other programs, or of one; or KRATOS_LITE_BENCH_PYTHON")  # fmt: skip
    add("--cases", type=Path, default=ROOT.parent / "shared" / "cases", metavar="FOLDER",
        help="real scenes, each a folder with case.json")  # fmt: skip
    add("--limit", type=float, metavar="SECONDS", help="after which one run is stopped")
    add("--unknowns", type=float, default=stalling.UNKNOWNS, metavar="N",
        help="for stall: of each scene, about")  # fmt: skip
    add(
        "--point",
        type=float,
        default=10.0,
        metavar="SECONDS",
        help="for error: that a run may take, as expected",
    )
    add("--budget", type=float, default=float("inf"), metavar="SECONDS", help="after which no scene is begun")
    add("--missing", action="store_true", help="measure only what --out does not hold")
    add("--memory", type=float, default=20.0, metavar="GB", help="that one run may take")
    add(
        "--out",
        type=Path,
        metavar="FILE",
        help="JSON file of the results; rows in it stay unless they are measured again",
    )
    options = parser.parse_args(words)
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
    """Make the page and its picture from the results kept."""
    files = [found for path in sorted(RESULTS.glob("*.json")) if "command" in (found := kept(path))]
    if not files:
        print(f"there are no results in {RESULTS}; make some with --out", file=sys.stderr)
        return 1
    PAGE.write_text(report.page(files))
    rows = report.of([row for found in files for row in found["rows"]], "error")
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
