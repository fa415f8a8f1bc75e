"""The page about scaling over ranks, docs/about/scaling.md, from what `distributed` has measured."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

Row = dict[str, Any]

MOST_RANKS = 2
TOLERANCE = 1e-10
GOALS = {"efficiency": 0.9, "memory": 2.5, "serial": 1.5}
"""Parallel efficiency on 2 ranks at least; kB per unknown, and time of 1 rank over serial, at most."""
PLANNED = (1e7, 1e8, 1e9)
PER_RANK = 500_000
"""Unknowns of a rank in the plan."""


def name_of(row: Row) -> str:
    """Return a row in words.

    >>> name_of({"kind": "8N", "cells": [2, 1, 1], "engine": "own", "ranks": 1, "threads": 2})
    '8N 2x1x1 own, 2 threads'
    """
    return f"{row['kind']} {'x'.join(map(str, row['cells']))} {row['engine']}, {processors(row)}"


def processors(row: Row) -> str:
    """Return the threads of the own engine, or the ranks of others, in words."""
    count, word = (row["threads"], "thread") if row["engine"] == "own" else (row["ranks"], "rank")
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


def table(heads: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Return a table."""
    rows = [heads, ["---"] * len(heads), *lines]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows) + "\n"


def scaling(rows: Sequence[Row]) -> str:
    """Return strong and weak scaling with efficiencies and memory."""
    lines = []
    for kind, n in places(rows):
        own = chosen(rows, kind=kind, n=n, engine="own", threads=1)
        ones = chosen(rows, kind=kind, n=n, engine="petsc", ranks=1)
        for row in chosen(rows, kind=kind, n=n, engine="petsc"):
            weak = row["cells"] != cube(n)
            phases = row["phases"]
            efficiency = ""
            if ones and row is not ones[0]:
                share = time_of(ones[0]) / time_of(row) / (1 if weak else row["ranks"])
                efficiency = f"{share:.2f} {'weak' if weak else 'strong'}"
            serial = f"{row['seconds'] / own[0]['seconds']:.2f}" if own and not weak else ""
            times = [f"{seconds:.2f}" for seconds in (row["mesh"], phases["assemble"], phases["solve"])]
            sizes = [f"{kind} {'×'.join(map(str, row['cells']))}", f"{row['unknowns']}", f"{row['ranks']}"]
            ends = [f"{row['seconds']:.2f}", f"{row['iterations']}", efficiency, serial]
            off = f"{row['difference']:.0e}" if "difference" in row else ""
            lines.append([*sizes, *times, *ends, f"{per_unknown(row):.2f}", off])
    heads = ["cells", "unknowns", "ranks", "mesh s", "assembly s", "set-up and solver s", "solution s"]
    heads += ["iterations", "efficiency", "/ serial", "kB per unknown", "difference"]
    return table(heads, lines)


def others(rows: Sequence[Row]) -> str:
    """Return the engines beside each other on one block."""
    lines = []
    for kind, n in places(rows):
        for row in chosen(rows, kind=kind, n=n):
            if row["cells"] == cube(n):
                times = [f"{row['phases'][name]:.2f}" for name in ("assemble", "solve")]
                last = [f"{row['seconds']:.2f}", f"{row['iterations']}", f"{per_unknown(row):.2f}"]
                lines.append(
                    [f"{kind} n = {n}", f"{ENGINES[row['engine']]}, {processors(row)}", *times, *last]
                )
    heads = ["block", "engine", "assembly s", "set-up and solver s", "solution s", "iterations"]
    return table([*heads, "kB per unknown"], lines)


ENGINES = {"own": "own engine", "petsc": "over ranks", "plain": "PETSc, plain assembly"}


def places(rows: Iterable[Row]) -> list[tuple[str, int]]:
    """Return elements and sizes in their order."""
    return list(dict.fromkeys((row["kind"], row["n"]) for row in rows))


def plan(found: Row) -> str:
    """Return what 1e7, 1e8 and 1e9 unknowns need, from the growth of the rows measured."""
    lines = []
    for kind in dict.fromkeys(row["kind"] for row in found["rows"]):
        two = chosen(found["rows"], kind=kind, engine="petsc", ranks=MOST_RANKS)
        two = [row for row in two if row["iterations"]]
        if not two:
            continue
        largest = max(two, key=lambda row: row["unknowns"])
        grows, base = iterations_by_tenfold(two), largest["iterations"]
        text = next((one for one in found["files"] if one["kind"] == kind), None)
        for unknowns in PLANNED:
            ranks = math.ceil(unknowns / PER_RANK)
            count = base + grows * math.log10(unknowns / largest["unknowns"])
            share = PER_RANK * MOST_RANKS / largest["unknowns"]  # of the work of a rank that was measured
            solve = largest["phases"]["solve"] * share
            rest = (time_of(largest) - largest["phases"]["solve"]) * share
            seconds = rest + solve * (count / base if base else 1.0)
            memory = per_unknown(largest) * 1e3 * unknowns + ranks * largest["imports"]
            sizes = [text["bytes"] / text["unknowns"] * unknowns / 1e9 if text else math.nan]
            sizes += [largest.get("bytes written", math.nan) / largest["unknowns"] * unknowns / 1e9]
            lines.append(
                [f"{kind} 1e{math.log10(unknowns):.0f}", f"{ranks}", f"{memory / 1e9:.0f}"]
                + [f"{size:.1f}" for size in sizes]
                + [f"{count:.0f}", f"{seconds:.0f}"]
            )
    heads = ["unknowns", "ranks", "memory GB", "`.mdpa` parts GB", "`.pvtu` GB", "iterations", "time s"]
    return table(heads, lines)


def iterations_by_tenfold(rows: Sequence[Row]) -> float:
    """Return by how much iterations grow from the smallest to the largest row, for ten times the unknowns.

    >>> iterations_by_tenfold([{"unknowns": 10, "iterations": 9}, {"unknowns": 1000, "iterations": 13}])
    2.0
    """
    first, last = (pick(rows, key=lambda row: row["unknowns"]) for pick in (min, max))
    ratio = last["unknowns"] / first["unknowns"]
    return max(0.0, (last["iterations"] - first["iterations"]) / math.log10(ratio)) if ratio > 1 else 0.0


def goals(rows: Sequence[Row]) -> str:
    """Return the goals and what was measured."""
    lines = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        n = max(row["n"] for row in rows if row["kind"] == kind)
        here = {row["ranks"]: row for row in chosen(rows, kind=kind, n=n, engine="petsc", cells=cube(n))}
        weak = chosen(rows, kind=kind, n=n, engine="petsc", cells=cube(n, True))
        own = chosen(rows, kind=kind, n=n, engine="own", threads=1)
        if not (1 in here and MOST_RANKS in here and weak and own):
            continue
        one, two = here[1], here[MOST_RANKS]
        strong = time_of(one) / time_of(two) / MOST_RANKS
        memory = max(map(per_unknown, (one, two, *weak)))
        serial = one["seconds"] / own[0]["seconds"]
        values = [f"{strong:.2f}", f"{time_of(one) / time_of(weak[0]):.2f}", f"{memory:.2f}", f"{serial:.2f}"]
        lines.append([f"{kind} n = {n}", *values])
    limits = f"≥ {GOALS['efficiency']}", f"≤ {GOALS['memory']}", f"≤ {GOALS['serial']}"
    lines.append(["goal", limits[0], limits[0], *limits[1:]])
    heads = ["block", f"efficiency, {MOST_RANKS} ranks, strong", "weak", "kB per unknown", "1 rank / serial"]
    return table(heads, lines)


TEXT = """# Scaling over ranks

How [a model over many processes](../howto/cluster.md) scales, measured by `python -m benchmarks distributed`
on {processor}, {cores} cores, {date} ({versions}; medians of {repeats}). The clamped block under gravity in
three directions, to a relative residual of {tolerance:g}; each rank makes its share of the mesh. Compare
ratios, not seconds. Ranks of one machine share its memory, and say nothing about a network.

{goals}
Efficiency is that of mesh and solution; the weak one is the time for one share on one rank over that for two
shares on two. Memory is the most that a rank holds above its imports, over its share of the unknowns. Serial
is the own engine on one thread.

## Strong and weak

On one rank and two: the same block, and for two ranks one of twice the cells. "Solution" is everything in
`model.solve()`, checks included. The last column compares the work of the loads with the own engine.

{scaling}
## Beside the own engine and a plain assembly

The own engine on one thread and on as many as there are ranks, and PETSc's GAMG with conjugate gradients fed
by an assembly in NumPy, with all element matrices at once and a sort of their entries, as finite-element
libraries in Python do it.

{others}
## What large models need

From the largest block above at {per_rank} unknowns a rank: memory and files grow with the unknowns,
iterations as measured with their logarithm, and time with the iterations. What the network adds is not in
it; neither are reading and partitioning. Indices of 32 bits reach 2.1e9 unknowns; beyond, PETSc must be built
for 64.

{plan}"""


def page(found: Row) -> str:
    """Return the page."""
    rows, about = found["rows"], found["machine"]
    failed = [f"- {name_of(row)}: {row['failed']}\n" for row in rows if "failed" in row]
    text = TEXT.format(
        processor=about["processor"],
        cores=about["cores"],
        date=found["date"],
        versions=", ".join(f"{name} {one}" for name, one in found["versions"].items()),
        repeats=found["repeats"],
        tolerance=TOLERANCE,
        per_rank=PER_RANK,
        goals=goals(rows),
        scaling=scaling(rows),
        others=others(rows),
        plan=plan(found),
    )
    return text + ("\nWhat did not end well:\n\n" + "".join(failed) if failed else "")
