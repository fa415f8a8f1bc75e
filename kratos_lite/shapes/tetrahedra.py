"""Tetrahedra with 4 and 10 nodes on the unit simplex."""

from __future__ import annotations

import numpy as np

from kratos_lite.shapes.base import LINEAR, mid_edges, quadratic_faces
from kratos_lite.shapes.simplex import Linear, Quadratic

_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))


class Tetrahedron4(Linear):
    """Four-node tetrahedron, N = L."""

    cell, corners, degree = "tetrahedron", 4, 1
    nodes, edges, faces = _CORNERS, _EDGES, _FACES
    vtk, gmsh = 10, 4


class Tetrahedron10(Quadratic):
    """Ten-node tetrahedron: L (2L - 1) at corners, 4 L_i L_j on edges."""

    cell, corners, degree = "tetrahedron", 4, 2
    nodes, edges = mid_edges(_CORNERS, _EDGES), _EDGES
    faces = quadratic_faces(_FACES, _EDGES, 4)
    vtk, gmsh = 24, 11
    to_gmsh = (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)


LINEAR.add(Tetrahedron4.cell, Tetrahedron4)
