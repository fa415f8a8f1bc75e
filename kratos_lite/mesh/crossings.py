"""Crossings: where a straight line passes from one element to the next."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh.blocks import NO_ROWS, select, with_rows
from kratos_lite.mesh.boxes import cell_boxes, is_solid
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.typing import Array, Ints

SHORT = 1e-10
"""Fraction of the line that a crossing is known to; points are located no closer."""


def crossings(mesh: Mesh, a: Array, b: Array) -> Array:
    """Return where on the line from a to b elements begin and end: 0 = t_0 < t_1 < … < t_k = 1."""
    rows = _near(mesh, a, b)
    blocks = select(mesh.blocks, rows)
    near = Mesh(mesh.points, blocks, node_ids=mesh.node_ids, source=mesh.source) if blocks else mesh

    def element(t: Array) -> Ints:
        return near.locate(a + t[:, None] * (b - a), required=True).rows

    t = np.linspace(0, 1, 2 * len(rows) + 2)
    elements = element(t)
    while len(gaps := np.flatnonzero((np.diff(elements) != 0) & (np.diff(t) > SHORT))):
        middle = (t[gaps] + t[gaps + 1]) / 2
        elements = np.insert(elements, gaps + 1, element(middle))
        t = np.insert(t, gaps + 1, middle)
    changes = np.flatnonzero(np.diff(elements))
    return np.concatenate([[0.0], (t[changes] + t[changes + 1]) / 2, [1.0]])


def _near(mesh: Mesh, a: Array, b: Array) -> Ints:
    """Return the indices of the elements whose boxes, as spheres, reach the line."""
    length = np.linalg.norm(b - a)
    near = [NO_ROWS]
    for block, at in with_rows(mesh.blocks):
        if not is_solid(block):
            continue
        low, high = cell_boxes(mesh.points, block)
        middle, radius = (low + high) / 2 - a, np.linalg.norm(high - low, axis=1) / 2
        along = np.clip(middle @ (b - a) / length, 0, length)
        apart = np.linalg.norm(middle - along[:, None] * (b - a) / length, axis=1)
        near.append(at.start + np.flatnonzero(apart <= radius))
    return np.concatenate(near)
