"""Shapes of points, lines, triangles and quadrilaterals: faces, edges and the conditions on them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.shapes import simplex, tensor
from kratos_lite.shapes.base import Array, Shape, mid_edges

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


class Line2(Shape):
    """Two-node line on [-1, 1]."""

    cell, corners, degree = "line", 2, 1
    nodes = np.array([[-1.0], [1.0]])
    vtk, gmsh = 3, 1

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return (1 ± r) / 2."""
        return tensor.linear_N(xi, Line2.nodes)

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return ±1/2."""
        return tensor.linear_dN(xi, Line2.nodes)


class Line3(Shape):
    """Three-node line: ends, then the middle."""

    cell, corners, degree = "line", 2, 2
    nodes = np.array([[-1.0], [1.0], [0.0]])
    vtk, gmsh = 21, 8

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return the quadratic Lagrange functions."""
        return tensor.lagrange_N(xi, Line3.nodes)

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their derivatives."""
        return tensor.lagrange_dN(xi, Line3.nodes)


class Triangle3(Shape):
    """Three-node triangle."""

    cell, corners, degree = "triangle", 3, 1
    nodes, edges = _TRIANGLE, _TRIANGLE_EDGES
    vtk, gmsh = 5, 2

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return the barycentric coordinates."""
        return simplex.barycentric(xi)[0]

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their constant derivatives."""
        return simplex.linear_dN(xi)


class Triangle6(Shape):
    """Six-node triangle."""

    cell, corners, degree = "triangle", 3, 2
    nodes, edges = mid_edges(_TRIANGLE, _TRIANGLE_EDGES), _TRIANGLE_EDGES
    vtk, gmsh = 22, 9

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return the quadratic functions."""
        return simplex.quadratic_N(xi, _TRIANGLE_EDGES)

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their derivatives."""
        return simplex.quadratic_dN(xi, _TRIANGLE_EDGES)


class Quadrilateral4(Shape):
    """Four-node bilinear quadrilateral."""

    cell, corners, degree = "quadrilateral", 4, 1
    nodes, edges = _SQUARE, _SQUARE_EDGES
    vtk, gmsh = 9, 3

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return (1 ± r)(1 ± s) / 4."""
        return tensor.linear_N(xi, Quadrilateral4.nodes)

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their derivatives."""
        return tensor.linear_dN(xi, Quadrilateral4.nodes)


class Quadrilateral8(Shape):
    """Eight-node serendipity quadrilateral."""

    cell, corners, degree = "quadrilateral", 4, 2
    nodes, edges = mid_edges(_SQUARE, _SQUARE_EDGES), _SQUARE_EDGES
    vtk, gmsh = 23, 16

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return the serendipity functions."""
        return tensor.serendipity_N(xi, Quadrilateral8.nodes)

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their derivatives."""
        return tensor.serendipity_dN(xi, Quadrilateral8.nodes)


class Quadrilateral9(Shape):
    """Nine-node Lagrange quadrilateral."""

    cell, corners, degree = "quadrilateral", 4, 2
    nodes, edges = np.vstack([mid_edges(_SQUARE, _SQUARE_EDGES), [[0, 0]]]), _SQUARE_EDGES
    vtk, gmsh = 28, 10

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return the biquadratic functions."""
        return tensor.lagrange_N(xi, Quadrilateral9.nodes)

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their derivatives."""
        return tensor.lagrange_dN(xi, Quadrilateral9.nodes)


FACE_SHAPES: dict[int, type[Shape]] = {
    1: Point1, 2: Line2, 3: Triangle3, 4: Quadrilateral4, 6: Triangle6, 8: Quadrilateral8, 9: Quadrilateral9,
}  # fmt: skip
"""Shape of a face by its number of nodes (three nodes are a triangle, not a line)."""
