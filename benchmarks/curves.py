"""Run time against error: curves, time to an error, the summary, the cheapest element, and the pictures."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.programs import PEERS, PROGRAMS
from benchmarks.scenes import ENERGIES
from benchmarks.tables import ADAPTIVE, OURS, Row, ratio, seconds, table

LEVELS = (1e-2, 1e-3, 1e-4)
CLOCKS = {"warm": "warm", "cold": "process"}
"""Second time in one process, from reading to the solution; and the whole process."""


Curve = tuple[np.ndarray, np.ndarray]


class Reached(NamedTuple):
    """An error reached: seconds, whether the first point reaches it already, and the element."""

    seconds: float
    bound: bool
    kind: str

    def __str__(self) -> str:
        return f"{'≤ ' * self.bound}{seconds(self.seconds)} {self.kind}"


def curves(rows: Iterable[Row], clock: str = "warm") -> dict[tuple[str, str, str], Curve]:
    """Return times and errors of each scene, program and element, from coarse to fine."""
    points: dict[tuple[str, str, str], list[tuple[int, float, float]]] = defaultdict(list)
    for row in rows:
        error, time = row.get("errors", {}).get("displacement"), row.get(CLOCKS[clock])
        if error is not None and time is not None:
            points[row["scene"], row["program"], row["kind"]].append((row["n"], -error, time))
    sorted_ = {key: np.array(sorted(found)).T for key, found in points.items()}
    return {key: (times, np.maximum(-errors, 1e-16)) for key, (_, errors, times) in sorted_.items()}


def time_to(level: float, times: np.ndarray, found: np.ndarray) -> tuple[float, bool] | None:
    """Return the seconds to an error, on straight lines between log time and log error.

    The second value is True where the smallest size measured already reaches it, so that the time is
    an upper bound.  None where no size reaches it.

    >>> reached, bound = time_to(1e-2, np.array([1.0, 4.0]), np.array([1e-1, 1e-3]))
    >>> round(reached, 9), bound
    (2.0, False)
    """
    reached = np.flatnonzero(found <= level)
    if not len(reached):
        return None
    i = int(reached[0])
    if i == 0:
        return float(times[0]), True
    t, e = np.log(times[i - 1 : i + 1]), np.log(found[i - 1 : i + 1])
    fraction = (np.log(level) - e[0]) / (e[1] - e[0])
    return float(np.exp(t[0] + fraction * (t[1] - t[0]))), False


def fastest(rows: Iterable[Row], clock: str) -> dict[tuple[str, float, str], Reached]:
    """Return for each scene, error and program the element that reaches it first."""
    found: dict[tuple[str, float, str], Reached] = {}
    for (scene, program, kind), curve in curves(rows, clock).items():
        for level in LEVELS:
            if time := time_to(level, *curve):
                how, place = Reached(*time, kind), (scene, level, program)
                found[place] = min(how, found.get(place, how))
    return found


def summary(rows: Sequence[Row], clock: str) -> str:
    """Return the seconds to each error with each program's best element, and ours over the best peer's."""
    programs = [name for name in PROGRAMS if any(row["program"] == name for row in rows)]
    found = fastest(rows, clock)
    body = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        for level in LEVELS if ENERGIES.get(scene) is None else LEVELS[:2]:
            ways = {name: found[scene, level, name] for name in programs if (scene, level, name) in found}
            ours, theirs = (min((ways[p] for p in names if p in ways), default=None) for names in SIDES)
            both = ratio(ours.seconds, theirs.seconds) if ours and theirs else ""
            cells = [str(ways.get(name, "—")) for name in programs]
            body.append([scene, f"{100 * level:g} %", *cells, both])
    return table(["scene", "error", *programs, "ours / best library"], body)


SIDES = ((OURS, ADAPTIVE), PEERS)


def cheapest(rows: Iterable[Row], program: str = OURS) -> list[str]:
    """Return one sentence per scene: which element costs least for an error that most of them reach."""
    by_scene: dict[str, dict[str, Curve]] = defaultdict(dict)
    for (scene, name, kind), curve in curves(rows).items():
        if name == program:
            by_scene[scene][kind] = curve
    return [_sentence(scene, kinds) for scene, kinds in by_scene.items()]


def _sentence(scene: str, kinds: Mapping[str, Curve]) -> str:
    for level in reversed(LEVELS):
        found = {kind: time_to(level, *curve) for kind, curve in kinds.items()}
        times = {kind: time[0] for kind, time in found.items() if time is not None}
        if len(times) >= 2 or (times and level == LEVELS[0]):
            break
    else:
        error, best = min((errors.min(), kind) for kind, (_, errors) in kinds.items())
        return f"{scene}: no element reaches 1 % at these sizes; {best} comes closest ({error:.1e})."
    first, *others = sorted(times, key=times.__getitem__)
    parts = [f"{scene}: for an error of {level:.2%} take {first} ({seconds(times[first])} s)"]
    longer = (f"{kind} takes {times[kind] / times[first]:.1f} times as long" for kind in others)
    missing = [kind for kind in kinds if kind not in times]
    parts += [", ".join(longer)] if others else []
    parts += [f"{', '.join(missing)} do not reach it"] if missing else []
    return "; ".join(parts) + "."


# ---- pictures --------------------------------------------------------------------------------------


def best_kind(kinds: Mapping[str, Curve]) -> str:
    """Return the element that reaches the smallest error that any reaches, in the least time."""
    for level in (*reversed(LEVELS), 1e-1):
        found = [(time[0], kind) for kind, curve in kinds.items() if (time := time_to(level, *curve))]
        if found:
            return min(found)[1]
    return min(kinds, key=lambda kind: kinds[kind][1].min())


def shown(rows: Sequence[Row], scene: str) -> list[tuple[str, str]]:
    """Return program and element of the lines of a picture: the best of each, and our best plain one."""
    lines = []
    for program in PROGRAMS:
        kinds = {kind: curve for (s, p, kind), curve in curves(rows).items() if (s, p) == (scene, program)}
        plain = {kind: curve for kind, curve in kinds.items() if program == OURS and " " not in kind}
        lines += [(program, best_kind(some)) for some in (kinds, plain) if some]
    return list(dict.fromkeys(lines))


def picture(rows: Sequence[Row], scene: str, path: Path) -> None:
    """Draw log error over log seconds of one scene, warm and cold: a line for each program's best element."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    lines = shown(rows, scene)
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.6), sharey=True, layout="constrained")
    for ax, (clock, what) in zip(axes, LABELS.items(), strict=True):
        found = curves(rows, clock)
        for program, kind in lines:
            if (curve := found.get((scene, program, kind))) is not None:
                label = f"{program}, {kind}"
                ax.loglog(curve[0], np.maximum(curve[1], FLOOR), label=label, **style(program, kind))
        for level in LEVELS:
            ax.axhline(level, color="k", linewidth=0.6, linestyle=":")
        ax.set(xlabel="seconds", title=what)
        ax.grid(True, which="major", alpha=0.25)
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter("")
    axes[0].set(ylabel="relative error of displacement")
    figure.suptitle(scene.replace("_", " "), fontweight="bold")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right center", frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)
    plt.close(figure)


LABELS = {"warm": "warm: from reading to the solution", "cold": "cold: the whole process"}
FLOOR = 1e-6
"""Errors below it are drawn there: what is exact would press the rest together."""


def style(program: str, kind: str) -> dict[str, Any]:
    """Return the look of a line: ours thick and red, each other program in a color of its own."""
    if program.startswith(OURS):
        look = {OURS: ("o", "-"), ADAPTIVE: ("*", "-")}.get(program, ("x", "--"))
        look = ("s", "--") if program == OURS and " " not in kind else look
        return {"color": "#d0021b", "linewidth": 2.2, "marker": look[0], "linestyle": look[1], "zorder": 5}
    i = [name for name in PROGRAMS if not name.startswith(OURS)].index(program) % len(COLORS)
    return {"color": COLORS[i], "linewidth": 1.2, "marker": ".dv^<>PXhp"[i], "markersize": 5}


COLORS = "#1f3b73 #1b9e77 #7570b3 #66a61e #a6761d #e6ab02 #17becf #e377c2 #666666 #8c564b".split()
