"""The sets of runs: which scenes, element kinds, sizes and programs each command measures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from benchmarks import ale, cases
from benchmarks.driver import Run
from benchmarks.programs import PROGRAMS
from benchmarks.scenes import KINDS
from benchmarks.tables import ADAPTIVE, NUMPY, OURS, THEIRS, Place

CURVED = ("sphere", "cavity", "hole_incompressible")
"""Scenes where quadratic elements have curved edges."""
CELLS = {
    "manufactured": ((6, 12, 36), (2, 4, 8, 16)),
    "sphere": ((4, 8, 24), (1, 2, 5, 10)),
    "bending": ((4, 8, 24), (1, 2)),
    "l_domain": ((6, 12, 48), (2, 6, 28, 42)),
    "cavity": ((2, 6, 16, 32), (1, 2, 6, 18)),
    "hole_incompressible": ((2, 6, 14, 40), (1, 3, 6, 14, 30)),
    "cantilever": ((2, 6, 12), (1, 3, 5, 10)),
    "cook": ((6, 20, 60), (2, 6, 20, 30)),
    "block": ((6, 16, 28), (2, 6, 18, 28)),
}
"""Cells along an edge of the error scenes for linear elements, and for quadratic ones.

Errors of 1 %, 0.1 % and 0.01 % lie between two of them where they can.
"""
ERROR_SCENES = tuple(CELLS)
GOALS_OF_ERROR = (0.1, 0.05, 0.02, 0.01, 3e-3, 1e-3, 3e-4, 1e-4)
"""Relative errors in the energy norm that the adaptive solution is asked for."""
START = ("20N", 2)
"""Element and size of the mesh that it starts from."""
GOALS = (
    *(("block", "8N", n) for n in (20, 32, 50)),
    *(("block", "27N", n) for n in (10, 20)),
    ("block", "10N", 20),
    ("block", "4N", 32),
    *(("cube", "8N", n) for n in (20, 32, 50)),
)
GROWTH = (10, 14, 20, 28, 40, 50, 64, 80, 100, 124)
ASSEMBLY = {"4N": 20, "8N": 20, "10N": 12, "20N": 12, "27N": 10}
SKIPS: tuple[tuple[str, str, tuple[tuple[str, Any], ...]], ...] = (
    ("two_bodies", "two bodies, both loaded", ()),
    ("half_unloaded", "two bodies, one loaded", ()),
    ("block", "plain", ()),
    ("unreferenced", "as many nodes again without elements", ()),
    ("unloaded", "no load", ()),
    ("block", "stress at nodes asked for", (("stress", "node"),)),
    ("block", "stress at Gauss points asked for", (("stress", "gauss"),)),
    ("warped", "inner nodes moved: no constant Jacobians", ()),
    ("held", "lower half held: its elements are not needed", ()),
    ("block", "a second load case in the same system", (("cases", 2),)),
    ("block", "a second load case in a system of its own", (("again", 2),)),
    ("block", "written as .vtu", (("write", True),)),
    ("block", "written as .vtu, compressed", (("write", True), ("mode", "compressed"))),
    ("block", "written as .vtu, ascii", (("write", True), ("mode", "ascii"))),
    ("block", "written as .vtk", (("write", ".vtk"),)),
    ("block", "written as .json", (("write", ".json"),)),
)
"""Scene, what it is, and options: each row is compared with the plain one of the same size."""
KRATOS_SOLVERS = {"cantilever": "LU", "hole_incompressible": "LU"}
"""Of scenes on which its multigrid does not converge, or takes longer."""
FROM_FILES = (OURS, NUMPY, THEIRS)
"""Programs that read `.mdpa` files with everything they say."""
WRITTEN = (("write", True),)
QUICK_SIZES = {"4N": (4, 8), "8N": (4, 8), "10N": (2, 4), "20N": (2, 4), "27N": (2, 4)}
QUICK_PROGRAMS = (OURS, NUMPY, THEIRS, "scikit-fem")


def takes(program: str, scene: str, kind: str) -> bool:
    """Return whether a program has this element for this scene.

    >>> takes("SfePy", "sphere", "27N"), takes("SfePy", "block", "27N")
    (False, True)
    """
    given = PROGRAMS[program]
    curved = scene in CURVED and kind not in ("4N", "8N")
    return kind in (given.curved if curved else given.kinds)


def quick(programs: Sequence[str]) -> list[Run]:
    """Return a set that ends within two minutes."""
    some = [name for name in programs if name in QUICK_PROGRAMS]
    runs = goal_runs(programs, (("block", "8N", 10), ("cube", "8N", 10), ("block", "27N", 4)))
    runs += error_runs(some, ("manufactured", "cantilever"), QUICK_SIZES)
    runs += assembly_runs(some, {"8N": 10, "10N": 4, "27N": 4})
    return runs + parse_runs(programs, (10,)) + cube1_runs(programs) + skip_runs(programs, 8)


def kratos(programs: Sequence[str], cells: Sequence[int] | None, folder: Path, target: Path) -> list[Run]:
    """Return the goal rows, with other cells if some are given, and the real scenes of a folder."""
    goals: Iterable[Place] = GOALS
    if cells:
        goals = [(*kind, n) for kind in dict.fromkeys(goal[:2] for goal in GOALS) for n in cells]
    files = [(str(path), "", 0) for path in cases.prepared(folder, target)] if folder.is_dir() else []
    return goal_runs(programs, goals) + runs("case", FROM_FILES, programs, files, "solve", WRITTEN)


def runs(
    group: str, names: Sequence[str], programs: Sequence[str], places: Iterable[Place], *words: Any
) -> list[Run]:
    """Return runs of those of the programs named that are wanted on each scene, kind and size."""
    return [Run(group, name, *place, *words) for place in places for name in names if name in programs]


def goal_runs(programs: Sequence[str], goals: Iterable[Place] = GOALS) -> list[Run]:
    """Return whole processes from `.mdpa` to VTK files, and pyamg as it comes for its solver alone."""
    return runs("goal", (*FROM_FILES, "pyamg"), programs, goals, "solve", WRITTEN)


def error_runs(
    programs: Sequence[str],
    scenes: Sequence[str] = ERROR_SCENES,
    sizes: dict[str, tuple[int, ...]] | None = None,
    elements: Sequence[str] = (),
) -> list[Run]:
    """Return run time against error: every scene, kind, size and program."""
    words = (("errors", True), ("warm", True), ("arrays", True))
    runs = []
    for scene in scenes:
        solver = {THEIRS: (("kratos_solver", KRATOS_SOLVERS.get(scene, "AMGCL")),)}
        runs += [
            Run("error", program, scene, kind, n, options=words + solver.get(program, ()))
            for kind in KINDS
            for n in (sizes or {kind: sizes_of(scene, kind)}).get(kind, ())
            for program in programs
            if program in PROGRAMS and program != ADAPTIVE and kind in chosen(program, scene, elements)
        ]
        if ADAPTIVE in programs:
            runs += [
                Run("error", ADAPTIVE, scene, *START, options=(*words, ("goal", goal)), variant=f"{goal:g}")
                for goal in GOALS_OF_ERROR
            ]
    return runs


def chosen(program: str, scene: str, elements: Sequence[str] = ()) -> list[str]:
    """Return the elements that are measured on a scene, if none are asked for: those worth their time.

    Of kratos_lite all but 4N, which reaches no level, and 10N B-bar, which is for ν near 0.5.  Of other
    programs their quadratic bricks: 10N took from 2 to 10 times as long to the same error, but it does not
    lock where they do; linear ones where there are no others.

    >>> chosen("FElupe", "sphere"), chosen("FElupe", "hole_incompressible"), chosen("NGSolve", "sphere")
    (['20N', '27N'], ['10N', '20N', '27N'], ['8N'])
    """
    kinds = [kind for kind in KINDS if takes(program, scene, kind)]
    if elements:
        return [kind for kind in kinds if kind in elements]
    if program.startswith(OURS):
        return [kind for kind in kinds if kind not in ("4N", "10N B-bar") and program == OURS]
    bricks = [kind for kind in kinds if kind[:2] in ("20", "27")]
    if scene in ("hole_incompressible", "bending") or not bricks:
        bricks = [kind for kind in kinds if kind == "10N" or kind in bricks]
    return bricks or kinds[-1:]


def sizes_of(scene: str, kind: str) -> tuple[int, ...]:
    """Return the cells along an edge that a curve consists of; one reduced element across is refused.

    >>> sizes_of("bending", "8N enhanced"), sizes_of("bending", "20N")
    ((4, 8, 24), (1, 2))
    """
    sizes = CELLS[scene][kind.split(maxsplit=1)[0] not in ("4N", "8N")]
    return sizes[sizes[0] == 1 :] if kind == "20N reduced" else sizes


def assembly_runs(programs: Sequence[str], sizes: dict[str, int] | None = None) -> list[Run]:
    """Return pattern and matrix alone, on the clamped block."""
    return [
        Run("assembly", program, "block", kind, n, "assembly", (("repeat", 4),))
        for kind, n in (sizes or ASSEMBLY).items()
        for program in programs
        if program in PROGRAMS and program not in ("CalculiX", ADAPTIVE) and takes(program, "block", kind)
    ]


def parse_runs(programs: Sequence[str], sizes: Sequence[int] = (20, 50)) -> list[Run]:
    """Return reading a `.mdpa` file: kratos_lite, Kratos and meshio."""
    return runs("parse", (*FROM_FILES, "meshio"), programs, [("block", "8N", n) for n in sizes], "parse")


def ale_runs(programs: Sequence[str], sizes: Iterable[Any] = ale.MESHES, repeat: int = 4) -> list[Run]:
    """Return the matrices of a wheel in flow, beside GetFEM."""
    places = [(ale.SCENE, *size) for size in sizes]
    return runs("ale", (OURS, NUMPY, "GetFEM"), programs, places, "ale", (("repeat", repeat),))


def gradient_runs(programs: Sequence[str], sizes: Sequence[int] = (20, 40)) -> list[Run]:
    """Return the derivative of the compliance by the stiffness of all elements, beside torch-fem."""
    places = [("simp", "8N", n) for n in sizes]
    return runs(
        "gradient", (OURS, "torch-fem"), programs, places, "gradient", (("arrays", True), ("threads", 1))
    )


def cube1_runs(programs: Sequence[str]) -> list[Run]:
    """Return the whole process for one element, beside a process that imports NumPy alone."""
    return runs("cube1", ("import numpy", *FROM_FILES), programs, [("cube", "8N", 1)])


def skip_runs(programs: Sequence[str], n: int = 32) -> list[Run]:
    """Return pairs with and without work that can be skipped."""
    pairs = [((scene, "8N", n), options, variant) for scene, variant, options in SKIPS]
    return [
        run for place, *words in pairs for run in runs("skips", (OURS,), programs, [place], "solve", *words)
    ]
