"""Scenes on which multigrid may stall: the elements solved on each, the solvers beside, and the tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from benchmarks import hard_scenes
from benchmarks.driver import Run
from benchmarks.programs import SOLVERS
from benchmarks.tables import OURS, Place, Row, by_place, error, megabytes, ratio, seconds, table

UNKNOWNS = 60_000
"""About so many are solved for if nothing else is asked for."""
TOLERANCE = 1e-8
CELLS = {"4N": 26.5, "8N": 26.5, "10N": 13.3, "20N": 16.6, "27N": 13.3}
"""Cells along an edge of a block with so many unknowns."""
LINEAR, BRICKS = ("4N", "8N", "8N enhanced"), ("8N", "8N enhanced", "20N", "27N")
MOST = (*LINEAR, "10N", "20N", "27N")
PROJECTED = ("8N enhanced", "10N B-bar", "20N B-bar", "27N B-bar")
"""Elements that do not lock as ν is near 0.5."""
BENIGN = "block"
ELEMENTS: dict[str, tuple[str, ...]] = {
    BENIGN: (*MOST, *PROJECTED[1:]),
    **dict.fromkeys(("flat_10", "flat_1000", "needles_10", "needles_1000", "needles_one_layer"), BRICKS),
    **dict.fromkeys(("flat_100", "needles_100", "plate_100"), MOST),
    **dict.fromkeys(("plate_1000", "cantilever_plate_100_layers"), BRICKS),
    **dict.fromkeys(("cantilever_plate_100", "cantilever_plate_1000"), MOST),
    **dict.fromkeys(("contrast_layers", "contrast_inclusions"), ("8N", "10N", "20N")),
    **dict.fromkeys(("links_periodic", "links_tied", "links_hanging"), ("8N", "10N", "20N")),
    "tetrahedra": ("4N", "10N"),
    **{hard_scenes.name_of(nu): PROJECTED for nu in hard_scenes.RATIOS},
}
"""Elements for which a scene matters."""
SLACK = 3.0
"""A residual up to so many times the one asked for, or that of rounding, counts as reached."""
NOTE = """Linear systems alone: set-up and solution, without assembly, to a true relative residual of 1e-8
(or what rounding allows). Every program gets the matrix of kratos_lite, in its own format before the clock
starts; kratos_lite's own work on a complete matrix counts as set-up. MB is the memory that both take above
the matrix. The first table compares with the block with ν = 0.3 of the same elements, by unknown; the second
has seconds (iterations) and MB of every program, and the ratio kratos_lite / best other. `flat_100` has
cells 100 times as wide as thick, and `needles_100` as long as wide, held along their length; plates have one
layer of cells or three; `contrast` is 1e6, in layers or balls; `links` are opposite sides that move alike,
tied faces of unlike meshes, or hanging nodes; `block_nu_4999` has ν = 0.4999. Goals: at most 40 iterations,
3 times the time and 1.5 times the memory of the block, 0.25 of the best other."""
MOST_ITERATIONS, MOST_TIME, MOST_MEMORY, MOST_OF_OTHERS = 40, 3.0, 1.5, 0.25


def cells(kind: str, unknowns: float) -> int:
    """Return the cells along an edge of a block with about so many unknowns.

    >>> cells("27N B-bar", 60_000), cells("8N", 480_000)
    (13, 53)
    """
    return max(2, round(CELLS[kind.split(maxsplit=1)[0]] * (unknowns / UNKNOWNS) ** (1 / 3)))


def runs(
    programs: Sequence[str], unknowns: float = UNKNOWNS, scenes: Sequence[str] | None = None
) -> list[Run]:
    """Return the linear systems of the scenes and of the block of each element."""
    chosen = [program for program in (OURS, *SOLVERS) if program in programs]
    wanted = [scene for scene in scenes or ELEMENTS if scene in ELEMENTS and scene != BENIGN]
    kinds = [kind for kind in ELEMENTS[BENIGN] if any(kind in ELEMENTS[scene] for scene in wanted)]
    elements = {BENIGN: kinds} | {scene: ELEMENTS[scene] for scene in wanted}
    return [
        Run("stall", program, scene, kind, cells(kind, unknowns), "linear", (("tolerance", TOLERANCE),))
        for scene, kinds in elements.items()
        for kind in kinds
        for program in chosen
    ]


# ---- tables ------------------------------------------------------------------------------------------


def tables(rows: Sequence[Row]) -> str:
    """Return what kratos_lite takes beside its block, and beside the other solvers."""
    found = by_place(rows)
    ours = {place: here[OURS] for place, here in found.items() if OURS in here}
    return "\n".join(filter(None, (_ours(ours), _peers(found), _missed(ours, found))))


def _ours(rows: dict[Place, Row]) -> str:
    """Return the table of kratos_lite alone."""
    body = []
    for (scene, kind, _), row in rows.items():
        if "failed" in row:
            body.append([scene, kind, "", row["failed"], *[""] * 6])
            continue
        times = (seconds(row["phases"][phase]) for phase in ("setup", "solve"))
        cells = [scene, kind, str(row["unknowns"]), f"{row['solver']}, {row['iterations']}", *times]
        cells += [_of_block(row, rows, _time), megabytes(row.get("memory")), _of_block(row, rows, _memory)]
        body.append([*cells, error(row["residual"])])
    head = "scene | element | unknowns | solver, iterations | set-up s | solve s | of block | MB | of block"
    return table(f"{head} | residual", body)


def _peers(found: dict[Place, dict[str, Row]]) -> str:
    """Return seconds, iterations and memory of every program, and the ratio to the best of them."""
    names = [name for name in (OURS, *SOLVERS) if any(name in here for here in found.values())]
    if names == [OURS]:
        return ""
    body = [
        [f"{place[0]} {place[1]}", *(_cell(here.get(name)) for name in names), *_best(here)]
        for place, here in found.items()
    ]
    return table(["scene", *names, "best other", "ratio"], body)


def _best(here: dict[str, Row]) -> tuple[str, str]:
    """Return the fastest other solver, and the time of kratos_lite over its."""
    times = {name: time for name in SOLVERS if (time := _time(here.get(name))) is not None}
    if not times:
        return "", ""
    best = min(times, key=times.__getitem__)
    return best, ratio(_time(here.get(OURS)), times[best])


def _missed(ours: dict[Place, Row], found: dict[Place, dict[str, Row]]) -> str:
    """Return how many rows miss each goal."""
    solved = {place: row for place, row in ours.items() if _time(row) is not None}
    stalled = [row["iterations"] > MOST_ITERATIONS or row["solver"] == "direct" for row in solved.values()]
    slow, large = (
        [_per_unknown(row, ours, value) > limit for row in solved.values()]
        for value, limit in ((_time, MOST_TIME), (_memory, MOST_MEMORY))
    )
    missed = {
        "not solved": len(ours) - len(solved),
        "more than 40 iterations, or a factorization": sum(stalled),
        "more than 3 times the time of the block": sum(slow),
        "more than 1.5 times its memory": sum(large),
        "more than 0.25 of the best other": sum(
            float(_best(found[place])[1] or 0.0) > MOST_OF_OTHERS for place in solved
        ),
    }
    lines = [f"- {what}: {count}" for what, count in missed.items()]
    return "\n".join([f"Of the {len(ours)} rows of kratos_lite miss a goal:\n", *lines, ""]) if ours else ""


def _per_unknown(row: Row, rows: dict[Place, Row], value: Callable[[Row], float | None]) -> float:
    """Return a value by unknown over that of the block of the same element; 0 if one is not known."""
    base = rows.get((BENIGN, row["kind"], row["n"]), {"failed": ""})
    here, there = value(row), None if "failed" in base else value(base)
    return here / row["unknowns"] / (there / base["unknowns"]) if here and there else 0.0


def _of_block(row: Row, rows: dict[Place, Row], value: Callable[[Row], float | None]) -> str:
    found = _per_unknown(row, rows, value)
    return f"{found:.2g}" if found else ""


def _memory(row: Row) -> float | None:
    return row.get("memory")


def _time(row: Row | None) -> float | None:
    """Return the seconds of set-up and solution; None where they did not end in a solution."""
    if row is None or "failed" in row or not _reached(row):
        return None
    return float(sum(row["phases"].get(name, 0.0) for name in ("setup", "solve")))


def _reached(row: Row) -> bool:
    return bool(row["residual"] <= SLACK * max(TOLERANCE, row["rounding"]))


def _cell(row: Row | None) -> str:
    """Return seconds (iterations) and memory, or what came instead."""
    if row is None:
        return ""
    if "failed" in row:
        return str(row["failed"]).removeprefix("failed: ").strip()
    iterations = f" ({row['iterations']})" if row["iterations"] else ""
    if not _reached(row):
        return f"residual {error(row['residual'])}{iterations}"
    return f"{seconds(_time(row))}{iterations}, {megabytes(row.get('memory'))} MB"
