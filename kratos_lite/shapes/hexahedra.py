"""Hexahedra with 8, 20 and 27 nodes on [-1, 1]^3."""

from __future__ import annotations

import numpy as np

from kratos_lite.shapes.base import LINEAR, mid_edges, quadratic_faces
from kratos_lite.shapes.tensor import Lagrange, Multilinear, Serendipity

_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
    dtype=float,
)
_EDGES = (
    (0, 1), (1, 2), (2, 3), (3, 0),
    (0, 4), (1, 5), (2, 6), (3, 7),
    (4, 5), (5, 6), (6, 7), (7, 4),
)  # fmt: skip
_FACES = ((0, 3, 2, 1), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 4, 7, 3), (4, 5, 6, 7))
_CENTRES = (20, 21, 22, 23, 24, 25)


class Hexahedron8(Multilinear):
    """Eight-node trilinear hexahedron."""

    cell, corners, degree = "hexahedron", 8, 1
    nodes, edges, faces = _CORNERS, _EDGES, _FACES
    vtk, gmsh = 12, 5


class Hexahedron20(Serendipity):
    """Twenty-node serendipity hexahedron."""

    cell, corners, degree = "hexahedron", 8, 2
    nodes, edges = mid_edges(_CORNERS, _EDGES), _EDGES
    faces = quadratic_faces(_FACES, _EDGES, 8)
    vtk, gmsh = 25, 17
    to_vtk = (*range(12), 16, 17, 18, 19, 12, 13, 14, 15)
    to_gmsh = (*range(8), 8, 11, 12, 9, 13, 10, 14, 15, 16, 19, 17, 18)


class Hexahedron27(Lagrange):
    """Twenty-seven-node triquadratic Lagrange hexahedron; exact for quadratics on distorted cells."""

    cell, corners, degree = "hexahedron", 8, 2
    nodes = np.vstack(
        [
            mid_edges(_CORNERS, _EDGES),
            [[0, 0, -1], [0, -1, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, 0, 1], [0, 0, 0]],
        ]
    )
    edges = _EDGES
    faces = quadratic_faces(_FACES, _EDGES, 8, _CENTRES)
    vtk, gmsh = 29, 12
    to_vtk = (*range(12), 16, 17, 18, 19, 12, 13, 14, 15, 24, 22, 21, 23, 20, 25, 26)
    to_gmsh = (*range(8), 8, 11, 12, 9, 13, 10, 14, 15, 16, 19, 17, 18, 20, 21, 24, 22, 23, 25, 26)


LINEAR.add(Hexahedron8.cell, Hexahedron8)
