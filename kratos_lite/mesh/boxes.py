"""Boxes: bounding boxes of cells, a tree of them that finds those around points, the cell nearest to one."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh.blocks import Block, Cells
from kratos_lite.shapes import LINEAR, Shape
from kratos_lite.typing import Array, Ints

BRANCHES = 8
"""Boxes that one box of the next level encloses."""
BULGE = 3.0
"""Most that the functions of the nodes beyond the corners sum up to in any shape, absolute values taken."""


def is_solid(block: Block) -> bool:
    """Return whether the cells of a block have a volume that can contain points."""
    return block.shape is not None and block.shape.nodes.shape[1] == 3


def cell_boxes(points: Array, block: Block) -> tuple[Array, Array]:
    """Return lowest and highest coordinates (m, 3) that enclose the cells of a block of solids."""
    # A curved cell deviates from the straight one by at most Σ |N_a| |D_a|, D_a being the distance of node a.
    shape = block.known_shape
    low = high = points[block.nodes[:, 0]]
    for a in range(1, shape.corners):  # one after the other: faster than along an axis
        corner = points[block.nodes[:, a]]
        low, high = np.minimum(low, corner), np.maximum(high, corner)
    if len(shape.nodes) > shape.corners:
        bulge = BULGE * np.abs(_deviations(shape, points[block.nodes])).max(axis=1)
        low, high = low - bulge, high + bulge
    x, y, z = (high - low).T
    size = np.maximum(np.maximum(x, y), z)[:, None]
    margin = 1e-8 * size + 8 * np.finfo(float).eps * np.maximum(np.abs(low), np.abs(high))
    return low - margin, high + margin


def _deviations(shape: type[Shape], X: Array) -> Array:
    """Return how far the nodes beyond the corners of X (m, n, 3) lie off the straight cell, (m, n - c, 3)."""
    straight = LINEAR[shape.cell].N(shape.nodes[shape.corners :]) @ X[:, : shape.corners]
    return X[:, shape.corners :] - straight


def curvature(shape: type[Shape], X: Array) -> Array:
    """Return how far the nodes of cells X (m, n, 3) lie from straight ones, (m,), by reference places."""
    if len(shape.nodes) == shape.corners:
        return np.zeros(len(X))
    corners, edge = shape.nodes[: shape.corners], 2.0 if shape.cell == "hexahedron" else 1.0
    J = np.swapaxes(X[:, : shape.corners], 1, 2) @ LINEAR[shape.cell].dN(corners.mean(axis=0))
    there = np.linalg.pinv(J) @ np.swapaxes(_deviations(shape, X), 1, 2)
    return np.abs(there).max(axis=(1, 2)) / edge


class BoxTree:
    """A tree of boxes from `low` to `high` (n, 3); near ones have a box around them, up to one."""

    def __init__(self, low: Array, high: Array) -> None:
        kept = np.flatnonzero((low <= high).all(axis=1))
        self.order = kept[np.argsort(_along_a_curve((low[kept] + high[kept]) / 2), kind="stable")]
        self.levels = [(_filled(low[self.order].T, np.inf), _filled(high[self.order].T, -np.inf))]
        while self.levels[-1][0].shape[1] > 1:
            low, high = (end.reshape(3, -1, BRANCHES) for end in self.levels[-1])
            self.levels.append((_filled(low.min(axis=2), np.inf), _filled(high.max(axis=2), -np.inf)))

    def around(self, points: Array) -> tuple[Ints, Ints]:
        """Return pairs of points and boxes that contain them, as rows of both, points in order."""
        at = np.arange(len(points))
        box = np.zeros(len(at), dtype=np.int64)
        x = points.T.copy()
        for number, (low, high) in enumerate(reversed(self.levels)):
            if number:
                box = (BRANCHES * box[:, None] + np.arange(BRANCHES)).ravel()
                at = np.repeat(at, BRANCHES)
            for axis in range(3):  # one after the other: few pairs are left for the last
                here = x[axis].take(at)
                hit = (low[axis].take(box) <= here) & (here <= high[axis].take(box))
                at, box = at[hit], box[hit]
        return at, self.order[box]


def _filled(ends: Array, nowhere: float) -> Array:
    """Return ends of boxes (3, n) with as many empty boxes more as the next level needs, if there is one."""
    n = ends.shape[1]
    more = -n % BRANCHES if n > 1 else 1 - n
    return np.pad(ends, ((0, 0), (0, more)), constant_values=nowhere)


def _along_a_curve(points: Array) -> Ints:
    """Return numbers (n,) that sort points so that near ones stand together: Morton (1966), bits in turn."""
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    low = points.min(axis=0)
    extent = float((points.max(axis=0) - low).max()) or 1.0
    cell = ((points - low) / extent * (2**20 - 1)).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(20):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code


# ---- the nearest cell ----------------------------------------------------------------------------------


def nearest_element(mesh: Cells, point: Array) -> str:
    """Return which element's box is nearest to a point (3,): ``about 0.5 m from element 1 (…3D8N)``."""
    nearest = []
    for block in filter(is_solid, mesh.blocks):
        low, high = cell_boxes(mesh.points, block)
        gap = np.linalg.norm(np.maximum(0, np.maximum(low - point, point - high)), axis=1)
        if len(gap):
            nearest.append((float(gap.min()), mesh.place(block, int(gap.argmin()))))
    if not nearest:
        return "which has no elements"
    distance, place = min(nearest)
    return f"about {distance:.3g} m from {place}" if distance else f"close to {place}"
