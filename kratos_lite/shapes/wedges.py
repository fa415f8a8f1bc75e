"""Wedges with 6 and 15 nodes: unit triangle (r, s) times t in [-1, 1]."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.shapes.base import LINEAR, Shape, mid_edges, quadratic_faces
from kratos_lite.shapes.simplex import barycentric
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_CORNERS = np.array([[0, 0, -1], [1, 0, -1], [0, 1, -1], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=float)
_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (5, 3))
_FACES = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
_NEXT = [1, 2, 0]


def _split(xi: ArrayLike) -> tuple[Array, Array, Array]:
    """Return L (..., 3), dL/d(r, s) (3, 2) and t (..., 1)."""
    x = np.asarray(xi, dtype=float)
    L, dL = barycentric(x[..., :2])
    return L, dL, x[..., 2:]


def _derivatives(parts: list[tuple[Array, Array]]) -> Array:
    """Join (d/d(r, s) (..., m, 2), d/dt (..., m)) of groups of functions into (..., n, 3)."""
    return np.concatenate([np.concatenate([rs, t[..., None]], axis=-1) for rs, t in parts], axis=-2)


class Wedge6(Shape):
    """Six-node wedge, N = L (1 ± t) / 2."""

    cell, corners, degree = "wedge", 6, 1
    nodes, edges, faces = _CORNERS, _EDGES, _FACES
    vtk, gmsh = 13, 6

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return the functions of the triangle t = -1, then of the triangle t = +1."""
        L, _, t = _split(xi)
        return np.concatenate([L * (1 - t), L * (1 + t)], axis=-1) / 2

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their derivatives."""
        L, dL, t = _split(xi)
        return _derivatives([((1 + k * t)[..., None] * dL / 2, k * L / 2) for k in (-1, 1)])


class Wedge15(Shape):
    """Fifteen-node serendipity wedge."""

    cell, corners, degree = "wedge", 6, 2
    nodes, edges = mid_edges(_CORNERS, _EDGES), _EDGES
    faces = quadratic_faces(_FACES, _EDGES, 6)
    vtk, gmsh = 26, 18
    to_vtk = (*range(9), 12, 13, 14, 9, 10, 11)
    to_gmsh = (*range(6), 6, 8, 9, 7, 10, 11, 12, 14, 13)

    @staticmethod
    def N(xi: ArrayLike) -> Array:
        """Return corners L (1 ± t)(2L - 2 ± t) / 2, edges 2 L_i L_j (1 ± t), uprights L (1 - t²)."""
        L, _, t = _split(xi)
        M = L[..., _NEXT]
        below, above = (L * (1 + k * t) * (2 * L - 2 + k * t) / 2 for k in (-1, 1))
        low, high = (2 * L * M * (1 + k * t) for k in (-1, 1))
        return np.concatenate([below, above, low, L * (1 - t * t), high], axis=-1)

    @staticmethod
    def dN(xi: ArrayLike) -> Array:
        """Return their derivatives."""
        L, dL, t = _split(xi)
        M, dM = L[..., _NEXT], dL[_NEXT]
        corner, edge = [], []
        for k in (-1, 1):
            h = 1 + k * t
            rs = (h * (4 * L - 2 + k * t) / 2)[..., None] * dL
            corner.append((rs, k * L * (2 * L - 1 + 2 * k * t) / 2))
            pair = L[..., None] * dM + M[..., None] * dL
            edge.append((2 * h[..., None] * pair, 2 * k * L * M))
        upright = ((1 - t * t)[..., None] * dL, -2 * t * L)
        return _derivatives([*corner, edge[0], upright, edge[1]])


LINEAR.add(Wedge6.cell, Wedge6)
