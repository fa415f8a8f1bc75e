"""From rows to tables, ratios and docs/about/benchmarks.md."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from benchmarks import ale, stall
from benchmarks.curves import CLOCKS, cheapest, summary
from benchmarks.motion import MOTIONS, SOLFEC
from benchmarks.tables import (
    NUMPY,
    OURS,
    THEIRS,
    Row,
    by_place,
    error,
    label,
    megabytes,
    place_of,
    ratio,
    seconds,
    table,
)

UNLIKE = 1e-4
"""Relative difference of displacements above which a solver has not solved the problem."""
SOLVER_PHASES = ("setup", "set-up", "solve")
"""Phases of a report that belong to the linear solver."""


def linear_solver(row: Row) -> float | None:
    """Return the seconds of the linear solver of a row."""
    found = [s for name, s in row.get("phases", {}).items() if name in SOLVER_PHASES]
    return sum(found) if found else None


def of(rows: Iterable[Row], group: str) -> list[Row]:
    """Return the rows of a group that hold measurements."""
    return [row for row in rows if row["group"] == group and "failed" not in row]


# ---- goal rows -------------------------------------------------------------------------------------


def goals(rows: Sequence[Row]) -> str:
    """Return whole processes beside Kratos: seconds, memory, and their ratios."""
    body = []
    for place, found in by_place(rows).items():
        if OURS not in found:
            continue
        ours, theirs, numpy, pyamg = (found.get(name, {}) for name in (OURS, THEIRS, NUMPY, "pyamg"))
        time, memory = ([row.get(word) for row in (ours, theirs)] for word in ("process", "peak"))
        solver = linear_solver(ours)
        body.append(
            [label(place), str(ours.get("unknowns", ""))]
            + [seconds(value) for value in (time[0], numpy.get("process"), time[1])]
            + [ratio(*time), *map(megabytes, memory), ratio(*memory)]
            + [ratio(solver, linear_solver(other)) for other in (theirs, pyamg)]
            + [error(theirs.get("errors", {}).get("difference"))]
        )
    head = (
        "scene | unknowns | kratos_lite s | NumPy s | Kratos s | time | kratos_lite MB | Kratos MB | memory"
    )
    return table(f"{head} | solver | solver / pyamg | difference", body)


def phases(rows: Sequence[Row]) -> str:
    """Return the phases of every row, in seconds."""
    names = list(dict.fromkeys(name for row in rows for name in row.get("phases", {}) if name != "answer"))
    body = []
    for row in rows:
        times = [row["phases"].get(name) for name in names] + [row["process"]]
        body.append([label(place_of(row)), row["program"], *map(seconds, times)])
    return table(["scene", "program", *names, "process"], body)


# ---- run time against error ------------------------------------------------------------------------


def errors(rows: Sequence[Row]) -> str:
    """Return the summary, warm and cold, the solver of Kratos, and which element costs least."""
    parts = []
    for clock in CLOCKS:
        parts += [f"### {TITLES[clock]}\n", summary(rows, clock)]
    solvers = {row["scene"]: row.get("solver") for row in rows if row["program"] == THEIRS}
    told = ", ".join(f"{scene} {solver}" for scene, solver in solvers.items() if solver)
    parts += [f"Kratos's solver: {told}.\n"] if told else []
    if kept := promises(rows):
        parts += ["### Asked, reported and true: relative errors in the energy norm\n", kept]
    parts += ["### Which element of kratos_lite\n", *(f"- {sentence}" for sentence in cheapest(rows)), ""]
    return "\n".join(parts)


def promises(rows: Sequence[Row]) -> str:
    """Return the errors in the energy norm of the adaptive solution: requested, reported and true."""
    body = [
        [row["scene"], f"{100 * float(row['variant']):g} %"]
        + [f"{100 * error:.2g} %" for error in (row["reported"], row["errors"]["energy"])]
        + [str(row["unknowns"]), seconds(row["warm"])]
        for row in rows
        if "reported" in row
    ]
    return table("scene | asked | reported | true | unknowns | warm, s", body)


TITLES = {"warm": "Warm: the second time in one process", "cold": "Cold: the whole process"}


# ---- growth and the rest -----------------------------------------------------------------------------


def exponent(unknowns: Sequence[float], values: Sequence[float]) -> float:
    """Return p of the fit values ~ unknowns^p.

    >>> round(exponent([1, 10, 100], [2, 20, 200]), 6)
    1.0
    """
    return float(np.polyfit(np.log(unknowns), np.log(values), 1)[0])


def growth(rows: Sequence[Row]) -> str:
    """Return iterations, seconds and bytes per degree of freedom by size, with the fitted exponent."""
    body, curves = [], defaultdict(list)
    for row in rows:
        if unknowns := row.get("unknowns"):
            cells = [str(row.get(word, "")) for word in ("program", "kind", "n", "unknowns", "iterations")]
            each = f"{1e6 * row['work'] / unknowns:.3g}", f"{row['peak'] / unknowns:.0f}"
            body.append([*cells, seconds(row["work"]), *each])
            if unknowns > 20_000:
                curves[row["program"], row["kind"]].append((unknowns, row["work"]))
    text = table("program | element | n | unknowns | iterations | s | µs per unknown | B per unknown", body)
    for (program, kind), points in curves.items():
        if len(points) > 1:
            p = exponent(*zip(*points, strict=True))
            text += f"\n{program}, {kind}: seconds grow as unknowns^{p:.2f} (fit above 20 000 unknowns).\n"
    return text


def compared(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Return phases of all programs on each scene, with the ratio of kratos_lite to each of them."""
    body = []
    for place, found in by_place(rows).items():
        ours = times_of(found.get(OURS), names)
        for program, row in found.items():
            cells = []
            for mine, time in zip(ours, times_of(row, names), strict=True):
                beside = f" ({ratio(mine, time)})" if time and mine and program != OURS else ""
                cells.append(seconds(time) + beside)
            body.append([label(place), program, *cells])
    return table(["scene", "program", *names], body)


def times_of(row: Row | None, names: Sequence[str]) -> list[float | None]:
    """Return the seconds of phases and of the whole process of a row."""
    times = row["phases"] | {"process": row["process"]} if row else {}
    return [times.get(name) for name in names]


def gradients(rows: Sequence[Row]) -> str:
    """Return times, the memory of the whole process, and how far the gradients are apart."""
    text = compared(rows, ("forward", "gradient", "process"))
    told = [
        [label(place_of(r)), r["program"], megabytes(r["peak"]), error(r["errors"]["difference"])]
        for r in rows
    ]
    return text + "\n" + table("scene | program | MB | difference", told)


def skips(rows: Sequence[Row]) -> str:
    """Return what each skip is worth: seconds and memory beside the row it is compared with."""
    pairs = {"half_unloaded": "two_bodies", "two_bodies": "two_bodies"}
    plain = {row["scene"]: row for row in rows if row["variant"] in ("plain", "two bodies, both loaded")}
    body = []
    for row in rows:
        base = plain.get(pairs.get(row["scene"], "block"), {})
        words = [row["variant"], label(place_of(row))]
        words += [seconds(row["process"]), ratio(row["process"], base.get("process"))]
        body.append([*words, megabytes(row["peak"]), ratio(row["peak"], base.get("peak"))])
    return table("what | scene | process s | of plain | MB | of plain", body)


def failures(rows: Iterable[Row]) -> str:
    """Return what did not end well: runs that failed, and solutions unlike that of the first program."""
    body = []
    for row in rows:
        if row.get("group") == "stall":
            continue  # their table says it
        difference = row.get("errors", {}).get("difference", 0.0)
        what = row.get("failed", "")
        if difference > UNLIKE:
            what = f"its displacements differ by {difference:.0e} from those of the first program"
        if what:
            body.append([label(place_of(row)), row["program"], what])
    return table("scene | program | what happened", body)


def motions(rows: Sequence[Row]) -> str:
    """Return seconds per step of bodies in motion beside those of Solfec-1.0, and what drifts."""
    body = []
    for (name, _, _), found in by_place(rows).items():
        if OURS not in found or name not in MOTIONS:
            continue
        motion, row, theirs = MOTIONS[name], found[OURS], SOLFEC.get(name, ())
        step = row["phases"]["step"]
        times = micro(step), micro(found.get(NUMPY, {}).get("phases", {}).get("step"))
        solfec = " … ".join(dict.fromkeys(map(micro, theirs))), ratio(step, theirs[0]) if theirs else ""
        drifts = (error(None if np.isnan(drift) else drift) for drift in row["drift"].values())
        body.append([motion.what, *times, *solfec, *drifts])
    head = "what | µs | NumPy µs | Solfec-1.0 µs | ratio | drift of energy | of angular momentum"
    return table(head, body)


def wheels(rows: Sequence[Row]) -> str:
    """Return seconds of M, G, H and K beside GetFEM's, and how far the entries are from each other's."""
    body = []
    for place, found in by_place(rows).items():
        ours, numpy, theirs = (shortest(found.get(program)) for program in (OURS, NUMPY, "GetFEM"))
        difference = found.get("GetFEM", {}).get("errors", {}).get("difference")
        for name in filter(ours.__contains__, ale.NAMES):
            times = ours[name], numpy.get(name), theirs.get(name)
            both = ours.get("pattern", 0.0) + ours[name]
            ratios = ratio(times[0], times[2]), ratio(both, times[2])
            body.append([label(place), name, *map(seconds, times), *ratios, error(difference)])
    head = "mesh | matrix | kratos_lite s | NumPy s | GetFEM s | ratio | with pattern | difference"
    return table(head, body)


def shortest(row: Row | None) -> dict[str, float]:
    """Return the shortest of the times of each phase of a row.

    >>> shortest({"phases": {"K": 2.0, "K, again": 1.0, "read": 3.0}})
    {'K': 1.0, 'read': 3.0}
    """
    phases = row["phases"] if row else {}
    names = [name for name in phases if not name.endswith(", again")]
    return {name: min(phases[name], phases.get(f"{name}, again", phases[name])) for name in names}


def micro(seconds: float | None) -> str:
    """Return seconds as microseconds in three digits.

    >>> micro(1.234e-6), micro(0.00045)
    ('1.23', '450')
    """
    return "" if seconds is None else f"{float(f'{1e6 * seconds:.3g}'):g}"


SECTIONS = {
    "goal": ("From `.mdpa` to a result file, whole processes", goals),
    "case": ("Real scenes, whole processes", goals),
    "error": ("Run time against error", errors),
    "growth": ("Growth: the clamped block up to the memory", growth),
    "stall": ("Scenes on which multigrid may stall", stall.tables),
    "assembly": ("Assembly alone", lambda rows: compared(rows, ("pattern", "matrix", "matrix, again"))),
    "parse": ("Reading an `.mdpa` file", lambda rows: compared(rows, ("read", "process"))),
    "cube1": ("One element, whole process", lambda rows: compared(rows, ("process",))),
    "skips": ("What need not be computed", skips),
    "motion": ("Bodies in motion: time of one step of one body", motions),
    "ale": ("Matrices of a wheel in flow", wheels),
    "gradient": ("One gradient", gradients),
}
"""Title and table of each group of rows."""
NOTES = {
    "goal": "Ratios are kratos_lite / Kratos. Goals: time ≤ 0.5, memory ≤ 0.6, solver (set-up and solve) "
    "≤ 0.6 of Kratos's AMGCL and ≤ 0.15 of pyamg as it comes.",
    "case": "Ratios are kratos_lite / Kratos; the files are small, so this is starting, reading and writing.",
    "error": "Seconds to a relative error of displacement (L2) with the best element of each program, which "
    "is named; ≤ where the smallest size measured is already better, — where none is good enough within "
    "10 s. Warm is the second time in one process, from reading to the solution; cold is the whole process "
    "with interpreter, imports and whatever is compiled at the first call. The last column is the better of "
    "our two over the best Python library; goal: ≤ 0.33.",
    "growth": "Goal: at most 2000 B per unknown for 8N.",
    "stall": stall.NOTE,
    "assembly": "Seconds, in brackets kratos_lite / program. Programs without a pattern of their own make it "
    "within the matrix; `again` is the shortest of further times.",
    "parse": "Seconds, in brackets kratos_lite / program.",
    "cube1": "Seconds, in brackets kratos_lite / program; `import numpy` is a process that does that alone.",
    "motion": "Solfec-1.0 was timed apart, on a machine like this (see `benchmarks/motion.py`); goals: "
    "at most its time for finite-element bodies, and 1 µs for one of many. Drifts are relative, over all "
    "steps of the run; energy is counted without the work of loads.",
    "ale": "Mass M, convective matrices G and H (one number for each pair of nodes) and stiffness K of a "
    "hollow cylinder of n × 8n × n elements, by Gauss rules of 3³ points (8N) and 4³ points (20N, 27N) in "
    "every program. Seconds are the shortest of a few. GetFEM computes on one core, and makes the sparsity "
    "anew with each matrix, kratos_lite once for all; `with pattern` counts it to this one. Goal: "
    "ratio ≤ 0.25 for M+G+H and for K. "
    "The difference is the largest of all entries of M, G, H, K, relative to the largest one of the matrix.",
    "skips": "Whole processes; the ratio is to the plain row of the same scene.",
    "gradient": "The work of the loads and its derivative by the stiffness of each element, as topology "
    "optimization needs it: a cantilever of 2n × n × n cells 8N whose stiffness varies at random by 1 : 762 "
    "(torch-fem's own benchmark). One thread of each; seconds, in brackets kratos_lite / program; `forward` "
    "is all from model to displacements. Goal: forward and gradient ≤ 0.1.",
}


HEAD = (
    "# Benchmarks\n\nThis page is made by `python -m benchmarks report` from `benchmarks/results/`; what is "
    "measured and how is stated in `benchmarks/README.md`. Compare ratios, not seconds: each table is from "
    "one run, in which the programs took turns.\n"
)


def text(rows: Sequence[Row]) -> str:
    """Return all tables of the rows as Markdown."""
    parts = []
    for group, (title, make) in SECTIONS.items():
        mine = [row for row in rows if row["group"] == group] if group == "stall" else of(rows, group)
        body = make(mine) if mine else ""
        if not body:
            continue
        parts += [f"## {title}\n", NOTES[group] + "\n", body]
        if group == "goal":
            parts += ["Phases in seconds:\n", phases(mine)]
    if lost := failures(rows):
        parts += ["## What did not end well\n", lost]
    return "\n".join(parts)


def page(kept: Sequence[Row], images: str = "../images/benchmarks") -> str:
    """Return docs/about/benchmarks.md of the results kept."""
    rows = [row for found in kept for row in found["rows"]]
    runs = []
    for found in kept:
        versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
        machine = f"{found['machine']['processor']}, {found['machine']['cores']} cores"
        runs.append([f"`{found['command']}`", found["date"], machine, versions])
    body = text(rows)
    if mine := of(rows, "error"):
        title = f"## {SECTIONS['error'][0]}\n"
        scenes = dict.fromkeys(row["scene"] for row in mine)
        pictures = "\n".join(f"![{scene}: error over seconds]({images}/{scene}.png)\n" for scene in scenes)
        body = body.replace(title, f"{title}\n{pictures}", 1)
    return "\n".join([HEAD, table("run | date | machine | versions", runs), body])
