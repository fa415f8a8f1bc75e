"""Scaling over ranks: the runs of `distributed`, and docs/about/scaling.md made of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import kratos_lite as kl
from benchmarks.driver import ROOT, Run, scratch
from benchmarks.programs import BACKENDS
from benchmarks.tables import Row, error, table

RESULTS = Path(__file__).with_name("results") / "distributed.json"
PAGE = ROOT / "docs" / "about" / "scaling.md"
CELLS = {"8N": (32, 64), "27N": (16, 32)}
"""Cells along an edge of the block of one rank."""
PLAIN_LIMIT = 40**3
"""Cells of 8N above which the plain assembly is left out: it holds all triplets, 20 kB for each unknown."""
MOST_RANKS = 2
TOLERANCE = 1e-10
EFFICIENCY, MEMORY, SERIAL = 0.9, 2.5, 1.5
"""Parallel efficiency on 2 ranks at least; kB per unknown, and time of 1 rank over serial, at most."""
PLANNED = (1e7, 1e8, 1e9)
PER_RANK = 500_000
"""Unknowns of a rank in the plan."""
WORDS = ("backend", "ranks", "cells", "threads")
NAMES = {
    "own": "own backend",
    "petsc": "over ranks",
    "whole": "over ranks, the mesh on rank 0",
    "plain": "PETSc, plain assembly",
}


# ---- runs ------------------------------------------------------------------------------------------


def runs(sizes: Sequence[int] | None = None) -> list[Run]:
    """Return the clamped block by every backend, and of 2 ranks twice as much."""
    return [
        run(kind, n, backend, count, twice)
        for kind in CELLS
        for n in sizes or CELLS[kind]
        for backend, count in BACKENDS
        for twice in ((False, True) if (backend, count) == ("petsc", MOST_RANKS) else (False,))
        if backend != "plain" or n**3 * (8 if kind == "27N" else 1) <= PLAIN_LIMIT
    ]


def run(kind: str, n: int, backend: str, count: int, twice: bool) -> Run:
    """Return the solution of a block by an backend on so many ranks, or threads of the own backend."""
    ranks, threads = (1, count) if backend == "own" else (count, 1)
    values = backend, ranks, tuple(cube(n, twice)), threads
    options = (*zip(WORDS, values, strict=True), ("tolerance", TOLERANCE))
    program = f"{backend} {count}"
    return Run("distributed", program, "block", kind, n, "ranks", options, "twice" * twice, WORDS)


def compared(rows: Sequence[Row]) -> Sequence[Row]:
    """Return rows with the relative difference of the work of the loads to that of the own backend."""
    for row in (row for row in rows if "load work" in row):
        alike = chosen(rows, backend="own", kind=row["kind"], cells=row["cells"])
        if alike and alike[0] is not row:
            row["difference"] = abs(row["load work"] / alike[0]["load work"] - 1)
    return rows


def text_files(sizes: Sequence[int] | None = None) -> list[Row]:
    """Return the sizes of .mdpa files of blocks, their places with all digits, and their unknowns."""
    from benchmarks.programs.ranks import MATERIAL, model_of

    found = []
    for kind, cells in CELLS.items():
        n = min(sizes or cells, key=lambda n: abs(n - 16))
        mesh = model_of("own", kind, [n, n, n])[0].mesh
        shift = np.random.default_rng(0).uniform(0.0, 1e-6, mesh.points.shape)
        with scratch() as name:
            path = Path(name) / "block.mdpa"
            kl.write(path, kl.Model(mesh.replace(points=mesh.points + shift), MATERIAL))
            found.append({"kind": kind, "bytes": path.stat().st_size, "unknowns": 3 * mesh.n_nodes})
    return found


# ---- the page --------------------------------------------------------------------------------------


def name_of(row: Row) -> str:
    """Return a row in words.

    >>> name_of({"kind": "8N", "cells": [2, 1, 1], "backend": "own", "ranks": 1, "threads": 2})
    '8N 2x1x1 own, 2 threads'
    """
    return f"{row['kind']} {'x'.join(map(str, row['cells']))} {row['backend']}, {processors(row)}"


def processors(row: Row) -> str:
    """Return the threads of the own backend, or the ranks of others, in words."""
    count, word = (row["threads"], "thread") if row["backend"] == "own" else (row["ranks"], "rank")
    return f"{count} {word}{'s' if count > 1 else ''}"


def chosen(rows: Iterable[Row], **words: Any) -> list[Row]:
    """Return the rows that ended well and have some values."""
    good = [row for row in rows if "failed" not in row]
    return [row for row in good if all(row[name] == value for name, value in words.items())]


def cube(n: int, twice: bool = False) -> list[int]:
    """Return the cells of a block."""
    return [MOST_RANKS * n if twice else n, n, n]


def time_of(row: Row) -> float:
    """Return seconds from nothing to the solution, its part of the mesh included."""
    return float(row["mesh"] + row["seconds"])


def per_unknown(row: Row) -> float:
    """Return the memory of the largest rank in kB for each unknown of a rank."""
    return float(row["memory"] * row["ranks"] / row["unknowns"] / 1e3)


def scaling(rows: Sequence[Row]) -> str:
    """Return strong and weak scaling with efficiencies and memory."""
    lines = []
    for kind, n in places(rows):
        own = chosen(rows, kind=kind, n=n, backend="own", threads=1)
        ones = chosen(rows, kind=kind, n=n, backend="petsc", ranks=1)
        for row in chosen(rows, kind=kind, n=n, backend="petsc"):
            weak, efficiency, serial = row["cells"] != cube(n), "", ""
            if ones and row is not ones[0]:
                fraction = time_of(ones[0]) / time_of(row) / (1 if weak else row["ranks"])
                efficiency = f"{fraction:.2f} {'weak' if weak else 'strong'}"
            if own and not weak:
                serial = f"{row['seconds'] / own[0]['seconds']:.2f}"
            line = [f"{kind} {'×'.join(map(str, row['cells']))}", f"{row['unknowns']}", f"{row['ranks']}"]
            line += [f"{row['mesh']:.2f}", *times(row), efficiency, serial, f"{per_unknown(row):.2f}"]
            lines.append([*line, error(row.get("difference"))])
    head = (
        "cells | unknowns | ranks | mesh s | assembly s | set-up and solver s | solution s | iterations | "
        "efficiency | / serial | kB per unknown | difference"
    )
    return table(head, lines)


def times(row: Row) -> list[str]:
    """Return seconds of assembly, solver and solution, and iterations."""
    seconds = (row["phases"]["assemble"], row["phases"]["solve"], row["seconds"])
    return [*(f"{s:.2f}" for s in seconds), f"{row['iterations']}"]


def others(rows: Sequence[Row]) -> str:
    """Return the backends beside each other on one block."""
    lines = [
        [
            f"{kind} n = {n}",
            f"{NAMES[row['backend']]}, {processors(row)}",
            *times(row),
            f"{per_unknown(row):.2f}",
        ]
        for kind, n in places(rows)
        for row in chosen(rows, kind=kind, n=n, cells=cube(n))
    ]
    head = "block | backend | assembly s | set-up and solver s | solution s | iterations | kB per unknown"
    return table(head, lines)


def places(rows: Iterable[Row]) -> list[tuple[str, int]]:
    """Return elements and sizes in their order."""
    return list(dict.fromkeys((row["kind"], row["n"]) for row in rows))


def plan(found: Row) -> str:
    """Return what 1e7, 1e8 and 1e9 unknowns need, from the growth of the rows measured."""
    lines = []
    for kind in dict.fromkeys(row["kind"] for row in found["rows"]):
        two = chosen(found["rows"], kind=kind, backend="petsc", ranks=MOST_RANKS)
        two = [row for row in two if row["iterations"]]
        if not two:
            continue
        largest = max(two, key=lambda row: row["unknowns"])
        slope, base, size = iterations_by_tenfold(two), largest["iterations"], largest["unknowns"]
        files = [file["bytes"] / file["unknowns"] for file in found["files"] if file["kind"] == kind]
        fraction = PER_RANK * MOST_RANKS / size  # of the work of a rank that was measured
        solve = largest["phases"]["solve"] * fraction
        for unknowns in PLANNED:
            ranks = math.ceil(unknowns / PER_RANK)
            count = base + slope * math.log10(unknowns / size)
            seconds = time_of(largest) * fraction - solve + solve * count / base
            memory = per_unknown(largest) * 1e3 * unknowns + ranks * largest["imports"]
            bytes_ = (*files, math.nan)[0], largest.get("bytes written", math.nan) / size
            lines.append(
                [f"{kind} 1e{math.log10(unknowns):.0f}", f"{ranks}", f"{memory / 1e9:.0f}"]
                + [f"{one * unknowns / 1e9:.1f}" for one in bytes_]
                + [f"{count:.0f}", f"{seconds:.0f}"]
            )
    return table("unknowns | ranks | memory GB | `.mdpa` parts GB | `.pvtu` GB | iterations | time s", lines)


def iterations_by_tenfold(rows: Sequence[Row]) -> float:
    """Return by how much iterations grow from the smallest to the largest row, for ten times the unknowns.

    >>> iterations_by_tenfold([{"unknowns": 10, "iterations": 9}, {"unknowns": 1000, "iterations": 13}])
    2.0
    """
    first, last = (pick(rows, key=lambda row: row["unknowns"]) for pick in (min, max))
    tenfolds = math.log10(last["unknowns"] / first["unknowns"])
    return max(0.0, (last["iterations"] - first["iterations"]) / tenfolds) if tenfolds else 0.0


def goals(rows: Sequence[Row]) -> str:
    """Return the goals and what was measured."""
    lines = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        n = max(row["n"] for row in rows if row["kind"] == kind)
        here = {row["ranks"]: row for row in chosen(rows, kind=kind, n=n, backend="petsc", cells=cube(n))}
        weak = chosen(rows, kind=kind, n=n, backend="petsc", cells=cube(n, True))
        own = chosen(rows, kind=kind, n=n, backend="own", threads=1)
        if not (1 in here and MOST_RANKS in here and weak and own):
            continue
        one, two = here[1], here[MOST_RANKS]
        values = [time_of(one) / time_of(two) / MOST_RANKS, time_of(one) / time_of(weak[0])]
        values += [max(map(per_unknown, (one, two, *weak))), one["seconds"] / own[0]["seconds"]]
        lines.append([f"{kind} n = {n}", *(f"{value:.2f}" for value in values)])
    lines.append(["goal", *2 * [f"≥ {EFFICIENCY}"], f"≤ {MEMORY}", f"≤ {SERIAL}"])
    head = f"block | efficiency, {MOST_RANKS} ranks, strong | weak | kB per unknown | 1 rank / serial"
    return table(head, lines)


TEXT = """# Scaling over ranks

How [a model over many processes](../howto/cluster.md) scales, measured by `python -m benchmarks distributed`
on {machine}, {date} ({versions}; medians of {repeats}). The clamped block under gravity in
three directions, to a relative residual of 1e-10; each rank makes its share of the mesh. Compare
ratios, not seconds. Ranks of one machine share its memory, and say nothing about a network.

{tables[goals]}
Efficiency is that of mesh and solution; the weak one is the time for one share on one rank over that for two
shares on two. Memory is the most that a rank holds above its imports, over its share of the unknowns. Serial
is the own backend on one thread.

## Strong and weak

On one rank and two: the same block, and for two ranks one of twice the cells. "Solution" is everything in
`model.solve()`, checks included. The last column compares the work of the loads with the own backend.

{tables[scaling]}
## Beside the own backend and a plain assembly

The own backend on one thread and on as many as there are ranks, and PETSc's GAMG with conjugate gradients fed
by an assembly in NumPy, with all element matrices at once and a sort of their entries, as finite-element
libraries in Python do it.

{tables[others]}
## What large models need

From the largest block above at 500000 unknowns a rank: memory and files grow with the unknowns,
iterations as measured with their logarithm, and time with the iterations. What the network adds is not in
it; neither are reading and partitioning. Indices of 32 bits reach 2.1e9 unknowns; beyond, PETSc must be built
for 64.

{tables[plan]}"""


def page(found: Row) -> str:
    """Return the page."""
    rows = found["rows"]
    failed = [f"- {name_of(row)}: {row['failed']}\n" for row in rows if "failed" in row]
    text = TEXT.format(
        machine=f"{found['machine']['processor']}, {found['machine']['cores']} cores",
        date=found["date"],
        versions=", ".join(f"{name} {one}" for name, one in found["versions"].items()),
        repeats=found["repeats"],
        tables={make.__name__: make(rows) for make in (goals, scaling, others)} | {"plan": plan(found)},
    )
    return text + ("\nWhat did not end well:\n\n" + "".join(failed) if failed else "")
