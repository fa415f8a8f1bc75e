"""Tetrahedra with 4 and 10 nodes on the unit simplex."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.shapes import simplex
from kratos_lite.shapes.base import Array, Shape, mid_edges, quadratic_faces

_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))


class Tetrahedron4(Shape):
    """Four-node tetrahedron, N = L."""

    cell, corners, degree = "tetrahedron", 4, 1
    nodes, edges, faces = _CORNERS, _EDGES, _FACES
    vtk, gmsh = 10, 4

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return the four barycentric coordinates."""
        return simplex.barycentric(xi)[0]

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their constant derivatives."""
        return simplex.linear_dN(xi)


class Tetrahedron10(Shape):
    """Ten-node tetrahedron: L (2L - 1) at corners, 4 L_i L_j on edges."""

    cell, corners, degree = "tetrahedron", 4, 2
    nodes, edges = mid_edges(_CORNERS, _EDGES), _EDGES
    faces = quadratic_faces(_FACES, _EDGES, 4)
    vtk, gmsh = 24, 11
    to_gmsh = (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return the ten quadratic functions."""
        return simplex.quadratic_N(xi, _EDGES)

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their derivatives."""
        return simplex.quadratic_dN(xi, _EDGES)
