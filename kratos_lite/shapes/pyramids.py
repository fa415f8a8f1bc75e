"""Pyramids with 5 and 13 nodes: base [-1, 1]^2 at z = 0, apex at z = 1.

The functions are polynomials in a = x / (1 - z), b = y / (1 - z) and d = 1 - z, and span all
linear (5 nodes) or quadratic (13 nodes) polynomials.  At the apex, where a and b are not
defined, the values on the axis are taken (a = b = 0).
Source: Bedrosian, Int. J. Numer. Meth. Eng. 35 (1992) 95-108.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.shapes.base import LINEAR, Shape, mid_edges, quadratic_faces
from kratos_lite.shapes.tensor import edge_factors, gradient, linear_factors
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 1]], dtype=float)
_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4))
_FACES = ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))
_P, _Q = _CORNERS[:4, 0], _CORNERS[:4, 1]
_MIDDLE = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])  # middles of the base edges


def _collapse(xi: ArrayLike) -> tuple[Array, Array, Array, Array]:
    """Return x, y, d = 1 - z, each (..., 1), and (a, b) (..., 2)."""
    x = np.asarray(xi, dtype=float)
    d = 1 - x[..., 2:]
    ab = np.divide(x[..., :2], d, out=np.zeros_like(x[..., :2]), where=d != 0)
    return x[..., :1], x[..., 1:2], d, ab


def _in_section(factors: tuple[Array, Array]) -> tuple[Array, Array, Array]:
    """Return the product F of factors in a and b, and its derivatives in a and b, each (..., 4)."""
    Fa, Fb = np.moveaxis(gradient(*factors), -1, 0)
    return factors[0].prod(axis=-1), Fa, Fb


def _corner(ab: Array) -> tuple[Array, Array, Array]:
    """Return F = (1 + p a)(1 + q b) and its derivatives in a and b, each (..., 4)."""
    return _in_section(linear_factors(ab, _CORNERS[:4, :2]))


def _base_middle(ab: Array) -> tuple[Array, Array, Array]:
    """Return F = (1 - a²)(1 ± b) or (1 ± a)(1 - b²) and its derivatives, each (..., 4)."""
    return _in_section(edge_factors(ab, _MIDDLE))


def _slope(F: Array, Fa: Array, Fb: Array, ab: Array) -> Array:
    """Return a F_a + b F_b, that is (1 - z) dF/dz."""
    return ab[..., :1] * Fa + ab[..., 1:] * Fb


class Pyramid5(Shape):
    """Five-node pyramid, N = (1 ± a)(1 ± b)(1 - z) / 4 and z."""

    cell, corners, degree = "pyramid", 5, 1
    nodes, edges, faces = _CORNERS, _EDGES, _FACES
    vtk, gmsh = 14, 7

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return the four base functions and the apex function."""
        _, _, d, ab = _collapse(xi)
        return np.concatenate([_corner(ab)[0] * d / 4, 1 - d], axis=-1)

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their derivatives, all bounded by 1."""
        ab = _collapse(xi)[3]
        F, Fa, Fb = _corner(ab)
        base = np.stack([Fa, Fb, _slope(F, Fa, Fb, ab) - F], axis=-1) / 4
        apex = np.broadcast_to([0.0, 0.0, 1.0], (*base.shape[:-2], 1, 3))
        return np.concatenate([base, apex], axis=-2)


class Pyramid13(Shape):
    """Thirteen-node rational pyramid; spans all quadratics."""

    cell, corners, degree = "pyramid", 5, 2
    nodes, edges = mid_edges(_CORNERS, _EDGES), _EDGES
    faces = quadratic_faces(_FACES, _EDGES, 5)
    vtk, gmsh = 27, 19
    to_gmsh = (*range(5), 5, 8, 9, 6, 10, 7, 11, 12)

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return corners, apex, base mid-edges, rising mid-edges."""
        x, y, d, ab = _collapse(xi)
        F = _corner(ab)[0]
        z = 1 - d
        corner = (_P * x + _Q * y - 1) * d * F / 4
        return np.concatenate([corner, z * (2 * z - 1), d * d * _base_middle(ab)[0] / 2, z * d * F], axis=-1)

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their derivatives."""
        x, y, d, ab = _collapse(xi)
        F, Fa, Fb = _corner(ab)
        G, Ga, Gb = _base_middle(ab)
        z, s = 1 - d, _P * x + _Q * y - 1
        Fz = _slope(F, Fa, Fb, ab) - F  # d(d F)/dz
        Gz = d * (_slope(G, Ga, Gb, ab) - 2 * G)  # d(d² G)/dz
        corner = np.stack([_P * d * F + s * Fa, _Q * d * F + s * Fb, s * Fz], axis=-1) / 4
        apex = np.stack([0 * z, 0 * z, 4 * z - 1], axis=-1)
        middle = np.stack([d * Ga, d * Gb, Gz], axis=-1) / 2
        rising = np.stack([z * Fa, z * Fb, d * F + z * Fz], axis=-1)
        return np.concatenate([corner, apex, middle, rising], axis=-2)


LINEAR.add(Pyramid5.cell, Pyramid5)
