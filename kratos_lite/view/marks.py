"""Marks: supports, rods and springs to anchors in space, pivots, masses, remote points; arrows of loads."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.mesh.facets import unit_normals
from kratos_lite.typing import Array, Mask
from kratos_lite.view.canvas import polygons, shaded
from kratos_lite.view.facets import Facets, behind, lit

DARK = "#3a3a44"
COILS = 7
"""Of a spring."""


SUPPORT, LOAD = "#2b6ca8", "#c8442b"
HEAD, ROUND, BASE = 0.3, 12, 0.3
"""Head of an arrow, of its length; corners of the base of a cone, and its radius, of its height."""
PALE = 0.35
"""Strength of what the body hides."""
Entry: TypeAlias = "tuple[str, Any, str]"
"""Of a legend: marker, color and text."""


def _none() -> Array:
    return np.zeros((0, 2, 3))


@dataclass(frozen=True, eq=False)
class Marks:
    """What holds a body, what is attached to it, and what pushes it."""

    rods: Array = field(default_factory=_none)  # (k, 2, 3) m, from a point of the body to an anchor in space
    springs: Array = field(default_factory=_none)  # the same
    pivots: Array = field(default_factory=lambda: np.zeros((0, 3)))  # (k, 3) m, points that are fixed
    between: Array = field(default_factory=_none)  # springs inside
    masses: Array = field(default_factory=lambda: np.zeros((0, 3)))  # (k, 3) m, points
    spokes: Array = field(default_factory=_none)  # from remote points
    supports: Array = field(default_factory=_none)  # from outside to points that are held along this line
    loads: Array = field(default_factory=_none)  # from tails to heads of arrows
    moments: Array = field(default_factory=_none)  # the same, along axes by the right hand

    def points(self) -> Array:
        """Return all that must be in the picture, (k, 3) m."""
        lines = [self.rods, self.springs, self.between, self.spokes, self.supports, self.loads, self.moments]
        return np.concatenate([np.concatenate(lines).reshape(-1, 3), self.pivots, self.masses])


def draw_marks(
    axes: Any, rows: Array, marks: Marks, inch: float, strength: float = 1.0, facets: Facets | None = None
) -> list[Any]:
    """Draw marks over the bodies; return what was drawn.  `inch` is that many m in the picture.

    Supports behind facets are pale.
    """
    flat = rows[:2].T
    curves = [(ends, 2.0, DARK) for ends in marks.rods @ flat]
    coils = np.concatenate([marks.springs, marks.between]) @ flat
    curves += [(_coil(a, b, 0.06 * inch), 1.0, DARK) for a, b in coils]
    curves += [(ends, 0.5, DARK) for ends in marks.spokes @ flat]
    arrows = np.concatenate([marks.loads, marks.moments])
    curves += [(ends, 1.5, LOAD) for ends in arrows @ flat]
    style = {"alpha": strength, "zorder": 4, "clip_on": False}
    drawn = [
        line for points, lw, color in curves for line in axes.plot(*points.T, lw=lw, color=color, **style)
    ]
    hidden = None if facets is None else behind(facets, marks.supports.mean(axis=1), rows)
    drawn.append(_cones(axes, rows, marks.supports, SUPPORT, hidden))
    drawn.append(_cones(axes, rows, _heads(arrows, 0.0), LOAD))
    drawn.append(_cones(axes, rows, _heads(marks.moments, HEAD), LOAD))
    anchors = np.concatenate([marks.rods[:, 1], marks.springs[:, 1]]) @ flat
    ends = [marks.rods[:, 0], marks.springs[:, 0], *marks.between.transpose(1, 0, 2), marks.pivots]
    joints = np.concatenate(ends) @ flat
    drawn += dots(axes, anchors, "s", 7, DARK, 1.0)
    drawn += dots(axes, joints, "o", 5, "w", strength)
    drawn += dots(axes, marks.masses @ flat, "o", 8, DARK, strength)
    drawn += dots(axes, np.unique(marks.spokes[:, 0], axis=0) @ flat, "x", 12, DARK, strength)
    return drawn


def _heads(arrows: Array, back: float) -> Array:
    """Return the axes (k, 2, 3) of heads of arrows, some of their lengths behind their ends."""
    along = arrows[:, 1] - arrows[:, 0]
    longest = np.linalg.norm(along, axis=1, keepdims=True)
    size = HEAD * longest.max(initial=0.0) * along / np.maximum(longest, 1e-300)
    tips = arrows[:, 1] - back * along
    return np.stack([tips - size, tips], axis=1)


def _cones(axes: Any, rows: Array, lines: Array, color: str, hidden: Mask | None = None) -> Any:
    """Draw cones with axes (k, 2, 3) from the middles of their bases to their tips."""
    base, along = lines[:, 0], lines[:, 1] - lines[:, 0]
    across = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    size = np.linalg.norm(along, axis=1, keepdims=True)
    across *= BASE * size / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    other = np.cross(along, across) / np.maximum(size, 1e-300)
    turn = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)[:, None, None]
    rim = base + np.cos(turn) * across + np.sin(turn) * other
    tips = np.broadcast_to(lines[:, 1], rim.shape)
    sides = np.stack([rim, np.roll(rim, 1, axis=0), tips], axis=2).reshape(-1, 3, 3)
    order = np.argsort(sides.mean(axis=1) @ rows[2], kind="stable")
    colors = shaded(color, lit(unit_normals(sides), rows)[order])
    if hidden is not None:
        pale = np.tile(hidden, ROUND)[order]
        colors[pale, :3] = 1 - PALE * (1 - colors[pale, :3])
    return polygons(axes, sides[order] @ rows[:2].T, colors, zorder=4)


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
