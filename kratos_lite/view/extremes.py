"""Extremes: the largest and the smallest value, in words and at their places."""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.mesh import with_rows
from kratos_lite.tabular import unit_name
from kratos_lite.typing import Array
from kratos_lite.view import canvas
from kratos_lite.view.facets import Facets, depth_at
from kratos_lite.view.marks import dots
from kratos_lite.view.scene import Scene, Subject, place_text

SYMBOLS = (("▲", "^"), ("▼", "v"))
"""Of the largest and the smallest, in texts and in the picture."""
ROUNDING = 1e-12
"""Size of a value, beside the largest, up to which it is said as 0."""
LETTER = 0.07
"""Inches, width of a letter."""
PALE = 0.4
"""Strength of a mark whose place the body hides."""
BEHIND = 0.01
"""How far behind what is seen a place is hidden, of the size of the body."""


def extremes(subject: Subject) -> list[int]:
    """Return the rows of the largest and the smallest value; none of what has one value alone."""
    values = subject.values
    if values is None or values.names or not len(rows := subject.rows()):
        return []
    numbers = values.numbers[rows]
    return [int(rows[numbers.argmax()]), int(rows[numbers.argmin()])] if np.ptp(numbers) else []


def texts(subject: Subject, width: float) -> list[str]:
    """Return what is said of the extremes, with coordinates where a width in inches holds them."""
    mesh, values, long, brief = subject.mesh, subject.values, list[str](), list[str]()
    for row, (symbol, _) in zip(extremes(subject), SYMBOLS, strict=False):
        assert values is not None
        what, ids = ("node", mesh.node_ids) if subject.is_nodal else ("element", mesh.element_ids)
        value, largest = values.numbers[row], np.abs(values.numbers).max()
        number = canvas.number_text(value if abs(value) > ROUNDING * largest else 0.0, values.unit)
        X = _nodes(subject, mesh.points, row).mean(axis=0)
        where = f"{place_text(X)} {unit_name('m', mesh.units)}"
        long.append(f"{symbol} {number} {values.kind}".rstrip() + f" at {what} {ids[row]}, {where}")
        brief.append(f"{symbol} {number}, {what} {ids[row]}")
    return long if LETTER * max(map(len, long), default=0) < width else brief


def draw_extremes(axes: Any, scene: Scene, subject: Subject, facets: Facets) -> None:
    """Mark the extremes that no cut has taken away, pale where the body hides them."""
    for row, (_, marker) in zip(extremes(subject), SYMBOLS, strict=False):
        X = _nodes(subject, subject.mesh.points, row).mean(axis=0, keepdims=True)
        if scene.plane is None or scene.plane.distance(X)[0] <= 0:
            seen = _nodes(subject, scene.place(subject), row) @ scene.rows.T
            place = seen.mean(axis=0)[:2]
            behind = depth_at(facets, scene.rows, place) - seen[:, 2].max()
            strength = PALE if behind > BEHIND * np.ptp(subject.mesh.points, axis=0).max() else 1.0
            for drawn in dots(axes, place[None], marker, 8, "w", strength):
                drawn.set_clip_on(scene.zoom is not None)


def _nodes(subject: Subject, x: Array, row: int) -> Array:
    """Return the places (k, 3) of a node, or of the nodes of an element, among nodes at x (n, 3)."""
    if subject.is_nodal:
        return x[row : row + 1]
    blocks = with_rows(subject.mesh.blocks)
    return next(x[b.nodes[row - at.start]] for b, at in blocks if at.start <= row < at.stop)
