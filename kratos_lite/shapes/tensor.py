"""Shape functions on [-1, 1]^d: multilinear, Lagrange and serendipity, for any dimension d.

The functions take points xi (..., d) and node coordinates p (n, d); the classes are families of
shapes that differ in their nodes alone.
Source: Zienkiewicz & Taylor, The Finite Element Method, vol. 1, ch. 4.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.shapes.base import Shape
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def gradient(f: Array, df: Array) -> Array:
    """Return d/dxi_j of prod_i f_i for factors f_i that depend on xi_i alone."""
    d = f.shape[-1]
    others = [f[..., [i for i in range(d) if i != j]].prod(axis=-1) for j in range(d)]
    return np.stack([df[..., j] * others[j] for j in range(d)], axis=-1)


def linear_factors(xi: ArrayLike, p: Array) -> tuple[Array, Array]:
    """Return 1 + x p in each direction, and its derivative."""
    x = np.asarray(xi, dtype=float)[..., None, :]
    f = 1 + x * p
    return f, np.broadcast_to(p, f.shape)


def _lagrange_factors(xi: ArrayLike, p: Array) -> tuple[Array, Array]:
    x = np.asarray(xi, dtype=float)[..., None, :]
    return np.where(p == 0, 1 - x * x, x * (x + p) / 2), np.where(p == 0, -2 * x, x + p / 2)


def edge_factors(xi: ArrayLike, p: Array) -> tuple[Array, Array]:
    """Return 1 - x² along an edge and 1 + x p across it, and the derivatives."""
    x = np.asarray(xi, dtype=float)[..., None, :]
    return np.where(p == 0, 1 - x * x, 1 + x * p), np.where(p == 0, -2 * x, p + 0 * x)


class Multilinear(Shape):
    """Shapes with N_a = prod_i (1 + xi_i p_ai) / 2^d."""

    @classmethod
    def N(cls, xi: ArrayLike) -> Array:
        """Return the multilinear functions (..., n)."""
        return linear_factors(xi, cls.nodes)[0].prod(axis=-1) / 2 ** cls.nodes.shape[1]

    @classmethod
    def dN(cls, xi: ArrayLike) -> Array:
        """Return their derivatives (..., n, d)."""
        return gradient(*linear_factors(xi, cls.nodes)) / 2 ** cls.nodes.shape[1]


class Lagrange(Shape):
    """Shapes with the products of the quadratic Lagrange polynomials through -1, 0, 1."""

    @classmethod
    def N(cls, xi: ArrayLike) -> Array:
        """Return the products (..., n)."""
        return _lagrange_factors(xi, cls.nodes)[0].prod(axis=-1)

    @classmethod
    def dN(cls, xi: ArrayLike) -> Array:
        """Return their derivatives (..., n, d)."""
        return gradient(*_lagrange_factors(xi, cls.nodes))


class Serendipity(Shape):
    """Shapes with the quadratic serendipity functions of corner nodes, then of mid-edge nodes."""

    @classmethod
    def N(cls, xi: ArrayLike) -> Array:
        """Return the functions of the corners, then of the edges (..., n)."""
        d, c = cls.nodes.shape[1], cls.corners
        f, _ = linear_factors(xi, cls.nodes[:c])
        corner = f.prod(axis=-1) * (f.sum(axis=-1) - (2 * d - 1)) / c
        middle = edge_factors(xi, cls.nodes[c:])[0].prod(axis=-1) * 2 / c
        return np.concatenate([corner, middle], axis=-1)

    @classmethod
    def dN(cls, xi: ArrayLike) -> Array:
        """Return their derivatives (..., n, d)."""
        d, c = cls.nodes.shape[1], cls.corners
        f, df = linear_factors(xi, cls.nodes[:c])
        bubble = (f.sum(axis=-1) - (2 * d - 1))[..., None]
        corner = (gradient(f, df) * bubble + f.prod(axis=-1)[..., None] * df) / c
        middle = gradient(*edge_factors(xi, cls.nodes[c:])) * 2 / c
        return np.concatenate([corner, middle], axis=-2)
