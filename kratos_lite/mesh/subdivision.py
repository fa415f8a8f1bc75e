"""Subdivision: how a reference cell is cut into cells of half its size.

A hexahedron, tetrahedron or wedge into 8 alike, a pyramid into 6 pyramids and 4 tetrahedra, a face into
4, a line into 2.  All corners of the children lie in the middle of edges, faces or cells.  Source of the
tetrahedra: Bey, Computing 55 (1995) 355-378; the octahedron inside is cut along its shortest diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kratos_lite.registry import remembered
from kratos_lite.shapes import LINEAR, Shape
from kratos_lite.typing import Array, Ints

DIAGONALS = (((0, 1), (2, 3)), ((0, 2), (1, 3)), ((0, 3), (1, 2)))
"""Edges of a tetrahedron whose middles are the ends of each diagonal of the octahedron inside."""


@dataclass(frozen=True, eq=False)
class Child:
    """One child of a cell: its own family, and the places (c, d) of its corners in the cell."""

    cell: str
    corners: Array

    def places(self, shape: type[Shape]) -> Array:
        """Return where in the cell the nodes (k, d) of the child lie if it has this shape."""
        return LINEAR[self.cell].N(shape.nodes) @ self.corners


@remembered
def unchanged(cell: str) -> Child:
    """Return a cell as the one child of itself."""
    return Child(cell, LINEAR[cell].nodes)


@remembered
def child_cells(cell: str, diagonal: int = 0) -> tuple[Child, ...]:
    """Return the children of a cell; a tetrahedron is cut along one of its `DIAGONALS`."""
    X = LINEAR[cell].nodes
    if cell == "pyramid":
        return _of_pyramid(X)
    scaled = [Child(cell, (X + x) / 2) for x in X]
    if cell == "triangle":
        return (*scaled, Child(cell, _turned(X)))
    if cell == "wedge":
        flat = _turned(X[:3, :2])
        for t in (-1.0, 0.0):
            low, high = (np.column_stack([flat, np.full(3, end)]) for end in (t, t + 1))
            scaled.append(Child(cell, np.vstack([low, high])))
    if cell == "tetrahedron":
        scaled += _of_octahedron(X, diagonal)
    return tuple(scaled)


def _turned(X: Array) -> Array:
    """Return the triangle of the middles of the edges of a triangle, turned as the triangle."""
    return (X[[0, 1, 2]] + X[[1, 2, 0]]) / 2


def _of_octahedron(X: Array, diagonal: int) -> list[Child]:
    """Return the four tetrahedra around a diagonal of the octahedron between the middles of the edges."""
    (a, b), (c, d) = DIAGONALS[diagonal]
    ends = (X[a] + X[b]) / 2, (X[c] + X[d]) / 2
    ring = [(X[i] + X[j]) / 2 for i, j in ((a, c), (c, b), (b, d), (d, a))]
    cells = []
    for i in range(4):
        corners = np.array([*ends, ring[i], ring[(i + 1) % 4]])
        if np.linalg.det(corners[1:] - corners[0]) < 0:
            corners = corners[[1, 0, 2, 3]]
        cells.append(Child("tetrahedron", corners))
    return cells


def _of_pyramid(X: Array) -> tuple[Child, ...]:
    """Return a pyramid in each corner, one upside down between them, and tetrahedra at the sides."""
    base, apex = X[:4], X[4]
    rising, center = (base + apex) / 2, base.mean(axis=0)
    cells = [Child("pyramid", (X + x) / 2) for x in X]
    cells.append(Child("pyramid", np.vstack([rising[::-1], center])))
    for i in range(4):
        j = (i + 1) % 4
        cells.append(Child("tetrahedron", np.array([(base[i] + base[j]) / 2, center, rising[i], rising[j]])))
    return tuple(cells)


@remembered
def across(cell: str, axis: int) -> tuple[Child, ...]:
    """Return the children of a cell cut across all its axes but one: 4, or 2 of a face, 1 of a line."""
    whole = child_cells(cell)
    X = LINEAR[cell].nodes
    cells: dict[tuple[float, ...], Child] = {}
    for child in whole:
        corners = child.corners.copy()
        corners[:, axis] = X[:, axis]
        cells.setdefault(
            tuple(np.delete(corners, axis, axis=1).mean(axis=0).round(9).tolist()), Child(cell, corners)
        )
    return tuple(cells.values())


def shortest_diagonal(corners: Array) -> Ints:
    """Return which of the `DIAGONALS` of tetrahedra with corners (m, 4, 3) is the shortest, (m,)."""
    ends = [corners[:, list(one)].mean(axis=1) - corners[:, list(two)].mean(axis=1) for one, two in DIAGONALS]
    squares = np.stack([(end**2).sum(axis=1) for end in ends])
    # of equally long ones the first, whatever the rounding
    return np.asarray((squares <= squares.min(axis=0) * (1 + 1e-9)).argmax(axis=0))
