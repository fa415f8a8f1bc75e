"""Lattices on faces and in cells for pages, and the triangles and tetrahedra between their points."""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.mesh import Block
from kratos_lite.mesh.subdivision import Child, child_cells, unchanged
from kratos_lite.shapes import LINEAR, Shape
from kratos_lite.typing import Array, Mask
from kratos_lite.view import facets
from kratos_lite.view.facets import grid, rim

TETRAHEDRA = {
    "tetrahedron": ((0, 1, 2, 3),),
    "pyramid": ((0, 1, 2, 4), (0, 2, 3, 4)),
    "wedge": ((0, 1, 2, 5), (0, 1, 5, 4), (0, 4, 5, 3)),
    "hexahedron": ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)),
}
"""Corners of tetrahedra that fill a cell."""


def fineness(faces: list[Block]) -> int:
    """Return into how many parts an edge of each face is cut: curved ones into two or more."""
    curved = any(block.shape is not None and block.shape.degree > 1 for block in faces)
    most = min(facets.fineness(sum(map(len, faces))), 6 if curved else 4)
    return max(most, 2) if curved else most


def lattice_of_face(shape: type[Shape], n: int) -> dict[str, Any]:
    """Return N at the points of a lattice on a face, its triangles, and the parts of the edges."""
    places, quadrilaterals = grid(shape.cell, n)
    triangles = quadrilaterals[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    triangles = triangles[triangles[:, 1] != triangles[:, 2]]
    used, rows = np.unique(triangles, return_inverse=True)
    edges = [[_nearest(places[used], point) for point in pair] for pair in rim(shape, n)]
    return {"N": _rounded(shape.N(places[used])), "triangles": rows.reshape(-1, 3).tolist(), "edges": edges}


def _nearest(places: Array, point: Array) -> int:
    return int(((places - point) ** 2).sum(axis=1).argmin())


def _rounded(N: Array) -> list[list[float]]:
    """Return weights without the rounding errors of zeros."""
    rounded: list[list[float]] = (np.round(N, 12) + 0.0).tolist()
    return rounded


def lattice_of_cell(shape: type[Shape]) -> dict[str, Any]:
    """Return N at the points of a lattice in a cell, and the tetrahedra between them.

    A tetrahedron is its four points and, for each of them, whether the face opposite lies on the cell's own
    faces or inside.
    """
    parts: tuple[Child, ...] = (unchanged(shape.cell),) if shape.degree == 1 else child_cells(shape.cell)
    corners = [part.corners[list(four)] for part in parts for four in TETRAHEDRA[part.cell]]
    places, rows = np.unique(np.concatenate(corners).round(12), axis=0, return_inverse=True)
    on = _on_faces(shape, places)
    tetrahedra = []
    for four in rows.reshape(-1, 4):
        outer = [bool(on[np.delete(four, i)].all(axis=0).any()) for i in range(4)]
        tetrahedra.append([four.tolist(), outer])
    return {"N": _rounded(shape.N(places)), "tetrahedra": tetrahedra}


def _on_faces(shape: type[Shape], places: Array) -> Mask:
    """Return which reference places (p, 3) lie on which faces of a cell, (p, f)."""
    X = LINEAR[shape.cell].nodes
    planes = [X[list(face[:3])] for face in LINEAR[shape.cell].faces]
    away = [(places - a) @ np.cross(b - a, c - a) for a, b, c in planes]
    return np.asarray(np.abs(away).T < 1e-9)
