"""Shape functions on the unit simplex in barycentric coordinates L = (1 - sum xi, xi_1, ..., xi_d).

Source: Zienkiewicz & Taylor, The Finite Element Method, vol. 1, ch. 4.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.shapes.base import Shape
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def barycentric(xi: ArrayLike) -> tuple[Array, Array]:
    """Return L (..., d+1) and the constant dL/dxi (d+1, d)."""
    x = np.asarray(xi, dtype=float)
    d = x.shape[-1]
    L = np.concatenate([1 - x.sum(axis=-1, keepdims=True), x], axis=-1)
    return L, np.vstack([-np.ones((1, d)), np.eye(d)])


class Linear(Shape):
    """Simplices with N = L."""

    @classmethod
    def N(cls, xi: ArrayLike) -> Array:
        """Return the barycentric coordinates (..., d+1)."""
        return barycentric(xi)[0]

    @classmethod
    def dN(cls, xi: ArrayLike) -> Array:
        """Return their constant derivatives (..., d+1, d)."""
        L, dL = barycentric(xi)
        return np.broadcast_to(dL, (*L.shape[:-1], *dL.shape)).copy()


class Quadratic(Shape):
    """Simplices with L_i (2 L_i - 1) at the corners and 4 L_i L_j on the edges."""

    @classmethod
    def N(cls, xi: ArrayLike) -> Array:
        """Return the functions of the corners, then of the edges (..., n)."""
        L, _ = barycentric(xi)
        i, j = np.array(cls.edges).T
        return np.concatenate([L * (2 * L - 1), 4 * L[..., i] * L[..., j]], axis=-1)

    @classmethod
    def dN(cls, xi: ArrayLike) -> Array:
        """Return their derivatives (..., n, d)."""
        L, dL = barycentric(xi)
        i, j = np.array(cls.edges).T
        corner = (4 * L - 1)[..., None] * dL
        middle = 4 * (L[..., i, None] * dL[j] + L[..., j, None] * dL[i])
        return np.concatenate([corner, middle], axis=-2)
