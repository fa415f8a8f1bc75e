"""Shapes of points, lines, triangles and quadrilaterals: faces, edges and the conditions on them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.shapes.base import LINEAR, Shape, mid_edges
from kratos_lite.shapes.simplex import Linear, Quadratic
from kratos_lite.shapes.tensor import Lagrange, Multilinear, Serendipity
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_TRIANGLE = np.array([[0, 0], [1, 0], [0, 1]], dtype=float)
_TRIANGLE_EDGES = ((0, 1), (1, 2), (2, 0))
_SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
_SQUARE_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))


class Point1(Shape):
    """A single node, for point loads."""

    cell, corners, degree = "point", 1, 0
    nodes = np.zeros((1, 0))
    vtk, gmsh = 1, 15

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return 1."""
        return np.ones((*np.shape(xi)[:-1], 1))

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return an empty array (there is no direction to differentiate in)."""
        return np.zeros((*np.shape(xi)[:-1], 1, 0))


class Line2(Multilinear):
    """Two-node line on [-1, 1]."""

    cell, corners, degree = "line", 2, 1
    nodes = np.array([[-1.0], [1.0]])
    vtk, gmsh = 3, 1


class Line3(Lagrange):
    """Three-node line: ends, then the middle."""

    cell, corners, degree = "line", 2, 2
    nodes = np.array([[-1.0], [1.0], [0.0]])
    vtk, gmsh = 21, 8


class Triangle3(Linear):
    """Three-node triangle."""

    cell, corners, degree = "triangle", 3, 1
    nodes, edges = _TRIANGLE, _TRIANGLE_EDGES
    vtk, gmsh = 5, 2


class Triangle6(Quadratic):
    """Six-node triangle."""

    cell, corners, degree = "triangle", 3, 2
    nodes, edges = mid_edges(_TRIANGLE, _TRIANGLE_EDGES), _TRIANGLE_EDGES
    vtk, gmsh = 22, 9


class Quadrilateral4(Multilinear):
    """Four-node bilinear quadrilateral."""

    cell, corners, degree = "quadrilateral", 4, 1
    nodes, edges = _SQUARE, _SQUARE_EDGES
    vtk, gmsh = 9, 3


class Quadrilateral8(Serendipity):
    """Eight-node serendipity quadrilateral."""

    cell, corners, degree = "quadrilateral", 4, 2
    nodes, edges = mid_edges(_SQUARE, _SQUARE_EDGES), _SQUARE_EDGES
    vtk, gmsh = 23, 16


class Quadrilateral9(Lagrange):
    """Nine-node Lagrange quadrilateral."""

    cell, corners, degree = "quadrilateral", 4, 2
    nodes, edges = np.vstack([mid_edges(_SQUARE, _SQUARE_EDGES), [[0, 0]]]), _SQUARE_EDGES
    vtk, gmsh = 28, 10


for _shape in (Point1, Line2, Triangle3, Quadrilateral4):
    LINEAR.add(_shape.cell, _shape)

FACE_SHAPES: dict[int, type[Shape]] = {
    1: Point1, 2: Line2, 3: Triangle3, 4: Quadrilateral4, 6: Triangle6, 8: Quadrilateral8, 9: Quadrilateral9,
}  # fmt: skip
"""Shape of a face by its number of nodes (three nodes are a triangle, not a line)."""
