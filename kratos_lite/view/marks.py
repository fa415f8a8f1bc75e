"""Marks: what holds a body, anchors in space, rods and springs to them, pivots; masses and remote points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kratos_lite.typing import Array

DARK = "#3a3a44"
COILS = 7
"""Of a spring."""


@dataclass(frozen=True, eq=False)
class Marks:
    """What holds a body, and what is attached to it."""

    rods: Array  # (k, 2, 3) m, from a point of the body to an anchor in space
    springs: Array  # the same
    pivots: Array  # (k, 3) m, points of the body that are fixed
    between: Array = field(default_factory=lambda: np.zeros((0, 2, 3)))  # springs inside
    masses: Array = field(default_factory=lambda: np.zeros((0, 3)))  # (k, 3) m, points
    spokes: Array = field(default_factory=lambda: np.zeros((0, 2, 3)))  # from remote points

    def points(self) -> Array:
        """Return all that must be in the picture, (k, 3) m."""
        lines = np.concatenate([self.rods, self.springs, self.between, self.spokes])
        return np.concatenate([lines.reshape(-1, 3), self.pivots, self.masses])


def draw_marks(axes: Any, rows: Array, marks: Marks, inch: float, strength: float = 1.0) -> list[Any]:
    """Draw marks over the bodies; return what was drawn.  `inch` is that many m in the picture."""
    flat = rows[:2].T
    curves = [(ends, 2.0) for ends in marks.rods @ flat]
    coils = np.concatenate([marks.springs, marks.between]) @ flat
    curves += [(_coil(a, b, 0.06 * inch), 1.0) for a, b in coils]
    curves += [(ends, 0.5) for ends in marks.spokes @ flat]
    style = {"color": DARK, "alpha": strength, "zorder": 4, "clip_on": False}
    drawn = [line for points, width in curves for line in axes.plot(*points.T, lw=width, **style)]
    anchors = np.concatenate([marks.rods[:, 1], marks.springs[:, 1]]) @ flat
    ends = [marks.rods[:, 0], marks.springs[:, 0], *marks.between.transpose(1, 0, 2), marks.pivots]
    joints = np.concatenate(ends) @ flat
    drawn += dots(axes, anchors, "s", 7, DARK, 1.0)
    drawn += dots(axes, joints, "o", 5, "w", strength)
    drawn += dots(axes, marks.masses @ flat, "o", 8, DARK, strength)
    drawn += dots(axes, np.unique(marks.spokes[:, 0], axis=0) @ flat, "x", 12, DARK, strength)
    return drawn


def dots(axes: Any, places: Array, marker: str, size: float, face: str, strength: float) -> list[Any]:
    """Draw markers of a size in points at places (k, 2); return what was drawn."""
    style = {"ls": "", "marker": marker, "ms": size, "mfc": face, "mec": DARK, "mew": 1.2, "alpha": strength}
    return list(axes.plot(*places.T, **style, zorder=5, clip_on=False)) if len(places) else []


def _coil(a: Array, b: Array, width: float) -> Array:
    """Return the corners of a zigzag between two points, (k, 2)."""
    along = b - a
    length = float(np.linalg.norm(along))
    if length == 0:
        return np.array([a, b])
    across = width * np.array([-along[1], along[0]]) / length
    t = np.linspace(0.15, 0.85, 2 * COILS + 1)[1:-1]
    sides = np.where(np.arange(len(t)) % 2 == 0, 1.0, -1.0)
    zigzag = a + t[:, None] * along + sides[:, None] * across
    return np.vstack([a, a + 0.15 * along, zigzag, a + 0.85 * along, b])
