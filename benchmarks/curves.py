"""Run time against error: curves, time to an error, the cheapest element, and the picture."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.tables import OURS, Row, seconds, table

LEVELS = (1e-2, 1e-3, 1e-4)


def curves(rows: Iterable[Row]) -> dict[tuple[str, str, str], tuple[np.ndarray, np.ndarray]]:
    """Return seconds and errors, by rising size, of each scene, program and element kind."""
    points: dict[tuple[str, str, str], list[tuple[int, float, float]]] = defaultdict(list)
    for row in rows:
        error = row.get("errors", {}).get("displacement")
        if error is not None:
            points[row["scene"], row["program"], row["kind"]].append((row["n"], row["work"], error))
    made = {}
    for key, found in points.items():
        ordered = np.array(sorted(found))
        made[key] = ordered[:, 1], np.maximum(ordered[:, 2], 1e-16)
    return made


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
    share = (np.log(level) - e[0]) / (e[1] - e[0])
    return float(np.exp(t[0] + share * (t[1] - t[0]))), False


def time_to_error(rows: Iterable[Row]) -> str:
    """Return the table of seconds to each error per scene, program and element."""
    body = []
    for (scene, program, kind), (times, found) in curves(rows).items():
        cells = []
        for level in LEVELS:
            reached = time_to(level, times, found)
            cells.append("—" if reached is None else ("≤ " if reached[1] else "") + seconds(reached[0]))
        body.append([scene, program, kind, *cells, f"{found.min():.1e}"])
    return table(["scene", "program", "element", "1 %", "0.1 %", "0.01 %", "least error"], body)


def starts(rows: Iterable[Row]) -> str:
    """Return what each program needs before its work: interpreter and imports, the median over its rows."""
    found: dict[str, list[float]] = defaultdict(list)
    for row in rows:
        found[row["program"]].append(row["start"])
    return table(["program", "start, s"], [[name, seconds(float(np.median(t)))] for name, t in found.items()])


def cheapest(rows: Iterable[Row], program: str = OURS) -> list[str]:
    """Return one sentence per scene: which element costs least for an error that most of them reach."""
    by_scene: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]] = defaultdict(dict)
    for (scene, name, kind), curve in curves(rows).items():
        if name == program:
            by_scene[scene][kind] = curve
    return [_sentence(scene, kinds) for scene, kinds in by_scene.items()]


def _sentence(scene: str, kinds: dict[str, tuple[np.ndarray, np.ndarray]]) -> str:
    for level in reversed(LEVELS):
        reached = {kind: time_to(level, *curve) for kind, curve in kinds.items()}
        times = {kind: found[0] for kind, found in reached.items() if found is not None}
        if len(times) >= 2 or (times and level == LEVELS[0]):
            break
    else:
        best = min(kinds, key=lambda kind: kinds[kind][1].min())
        error = kinds[best][1].min()
        return f"{scene}: no element reaches 1 % at these sizes; {best} comes closest ({error:.1e})."
    order = sorted(times, key=lambda kind: times[kind])
    rest = ", ".join(f"{kind} takes {times[kind] / times[order[0]]:.1f} times as long" for kind in order[1:])
    missing = [kind for kind in kinds if kind not in times]
    text = f"{scene}: for an error of {level:.2%} take {order[0]} ({seconds(times[order[0]])} s)"
    text += f"; {rest}" if rest else ""
    return text + (f"; {', '.join(missing)} do not reach it." if missing else ".")


def picture(rows: Sequence[Row], path: Path) -> None:
    """Draw log error over log seconds: one field per scene, one curve per program and element."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    found = curves(rows)
    scenes = list(dict.fromkeys(scene for scene, _, _ in found))
    programs = list(dict.fromkeys(program for _, program, _ in found))
    kinds = list(dict.fromkeys(kind for _, _, kind in found))
    if not scenes:
        return
    columns = min(3, len(scenes))
    lines = -(-len(scenes) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(5 * columns, 4 * lines), squeeze=False)
    for ax in axes.ravel()[len(scenes) :]:
        ax.axis("off")
    for (scene, program, kind), (times, error) in found.items():
        ax = axes.ravel()[scenes.index(scene)]
        ax.loglog(
            times,
            error,
            color=f"C{programs.index(program)}",
            marker="ov^sD"[kinds.index(kind) % 5],
            linewidth=2.0 if program == OURS else 0.8,
            markersize=4,
        )
    for scene, ax in zip(scenes, axes.ravel(), strict=False):
        ax.set(title=scene, xlabel="seconds (read … solve)", ylabel="relative error of displacement")
        ax.grid(True, which="both", alpha=0.2)
    handles = [plt.Line2D([], [], color=f"C{i}", label=name) for i, name in enumerate(programs)]
    handles += [
        plt.Line2D([], [], color="k", linestyle="", marker="ov^sD"[i % 5], label=kind)
        for i, kind in enumerate(kinds)
    ]
    across = 3 * columns
    figure.legend(handles=handles, loc="lower center", ncols=across, fontsize="small")
    figure.tight_layout(rect=(0, (0.2 + 0.25 * -(-len(handles) // across)) / (4 * lines), 1, 1))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
