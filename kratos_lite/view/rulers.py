"""Rulers: the extent of a body along x, y and z beside it; or three axes and their length."""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.mesh import Mesh
from kratos_lite.tabular import UNITS
from kratos_lite.typing import Array
from kratos_lite.view.camera import box_corners

GAP = 0.1
"""Inches between the body and a ruler, and between a ruler and its text."""
INK, TEXT = "0.35", "0.25"
SHORTEST = 0.15
"""Share of its length that an axis must have in the picture for a ruler."""


def draw_rulers(axes: Any, rows: Array, mesh: Mesh, drawn: Array, inch: float) -> None:
    """Draw the extent of the nodes of a mesh along x, y and z, clear of what is drawn (k, 2) m."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    corners, texts = box_corners(low, high), []
    factor, unit = _unit(float((high - low).max()), mesh.units)
    for i in range(3):
        along = rows[:2, i]
        if np.linalg.norm(along) < SHORTEST:
            continue
        side = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        side *= 1.0 if 2 * side[1] + side[0] < 0 else -1.0
        starts = corners[np.abs(corners[:, i] - low[i]) <= 0]
        start = starts[(starts @ rows[:2].T @ side).argmax()]
        end = start.copy()
        end[i] = high[i]
        line = np.array([start, end]) @ rows[:2].T
        beyond = max(0.0, float(((drawn - line[0]) @ side).max()))
        line += (beyond + GAP * inch) * side
        axes.plot(*line.T, color=INK, lw=0.8, marker=".", ms=4, clip_on=False)
        text = f"{'xyz'[i]}  {extent(low[i] * factor, high[i] * factor)} {unit}"
        texts.append((_label(axes, line.mean(axis=0) + GAP * inch * side, side, text), side))
    _separate(axes, texts, inch)


def _unit(size: float, units: str) -> tuple[float, str]:
    """Return the factor from m, and the unit, for a body of a size; 1 and theirs of other lengths."""
    if (other := UNITS[units].get("m")) is not None:
        return 1.0, other[0]
    for least, factor, unit in ((1e4, 1e-3, "km"), (1e-2, 1.0, "m"), (1e-5, 1e3, "mm"), (1e-8, 1e6, "µm")):
        if size >= least:
            return factor, unit
    return 1.0, "m"


def extent(low: float, high: float) -> str:
    """Return an interval to four digits of its length: no rounding shows.

    >>> extent(-1.2e-17, 0.5), extent(1000.0, 1000.25)
    ('0 … 0.5', '1000 … 1000.25')
    """
    size = high - low
    digits = 3 - int(np.floor(np.log10(size))) if size > 0 else 6
    return " … ".join(f"{round(float(end), digits) + 0.0:.12g}" for end in (low, high))


def _label(axes: Any, place: Array, side: Array, text: str) -> Any:
    ha = "right" if side[0] < -0.1 else "left" if side[0] > 0.1 else "center"
    va = "top" if side[1] < -0.1 else "bottom" if side[1] > 0.1 else "center"
    return axes.text(*place, text, ha=ha, va=va, size=9, color=TEXT)


def _separate(axes: Any, texts: list[tuple[Any, Array]], inch: float) -> None:
    """Move texts outwards or along their rulers, as little as needed, until none lies on another."""
    renderer = axes.figure.canvas.get_renderer()
    placed: list[Any] = []
    for text, side in texts:
        start = np.array(text.get_position())
        for step in range(60):
            across = np.array([-side[1], side[0]])
            ways = [side, across, -across] if step else [side]
            if any(_free(text, start + 0.05 * step * inch * way, renderer, placed) for way in ways):
                break
        placed.append(text.get_window_extent(renderer).padded(3))


def _free(text: Any, place: Array, renderer: Any, placed: list[Any]) -> bool:
    """Move a text to a place; return whether it lies on no other there."""
    text.set_position(place)
    box = text.get_window_extent(renderer).padded(3)
    return not any(box.overlaps(other) for other in placed)


def draw_triad(
    axes: Any, rows: Array, window: tuple[Array, Array], inch: float, down: float = 0.0, units: str = "SI"
) -> None:
    """Draw the three axes and their length beneath the lower left of a window, `down` inches deeper."""
    low, high = window
    length = rounded(min(0.5 * inch, 0.3 * float((high - low).max())))
    ends = length * rows[:2].T
    start = (
        low
        - np.minimum(ends.min(axis=0), 0)
        - (0, float(np.maximum(ends[:, 1], 0).max()) + (0.35 + down) * inch)
    )
    for name, end in zip("xyz", ends, strict=True):
        if np.linalg.norm(end) >= SHORTEST * length:
            axes.plot(*np.array([start, start + end]).T, color=INK, lw=1.0, clip_on=False)
            place = start + end * (1 + 0.1 * inch / np.linalg.norm(end))
            axes.text(*place, name, ha="center", va="center", size=9, color=TEXT)
    factor, unit = _unit(length, units)
    place = start + np.array([np.maximum(ends[:, 0], 0).max() + 0.25 * inch, 0.0])
    axes.text(*place, f"{length * factor:g} {unit}", ha="left", va="center", size=9, color=TEXT)


def rounded(length: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above a length.

    >>> rounded(0.3), rounded(5.0)
    (0.2, 5.0)
    """
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(step for step in (1, 2, 5) if step * power <= length * (1 + 1e-9)))
