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


def _product(f: Array) -> Array:
    return f.prod(axis=-1)


def _gradient(f: Array, df: Array) -> Array:
    """Return d/dxi_j of prod_i f_i for factors f_i that depend on xi_i alone."""
    d = f.shape[-1]
    others = [_product(f[..., [i for i in range(d) if i != j]]) for j in range(d)]
    return np.stack([df[..., j] * others[j] for j in range(d)], axis=-1)


def _linear_factors(xi: ArrayLike, p: Array) -> tuple[Array, Array]:
    x = np.asarray(xi, dtype=float)[..., None, :]
    f = 1 + x * p
    return f, np.broadcast_to(p, f.shape)


def _lagrange_factors(xi: ArrayLike, p: Array) -> tuple[Array, Array]:
    x = np.asarray(xi, dtype=float)[..., None, :]
    return np.where(p == 0, 1 - x * x, x * (x + p) / 2), np.where(p == 0, -2 * x, x + p / 2)


def _edge_factors(xi: ArrayLike, p: Array) -> tuple[Array, Array]:
    x = np.asarray(xi, dtype=float)[..., None, :]
    return np.where(p == 0, 1 - x * x, 1 + x * p), np.where(p == 0, -2 * x, p + 0 * x)


def _serendipity_N(xi: ArrayLike, p: Array) -> Array:
    """Return the quadratic serendipity functions: corner nodes first, then mid-edge nodes."""
    d = p.shape[1]
    c = 2**d
    f, _ = _linear_factors(xi, p[:c])
    corner = _product(f) * (f.sum(axis=-1) - (2 * d - 1)) / c
    middle = _product(_edge_factors(xi, p[c:])[0]) * 2 / c
    return np.concatenate([corner, middle], axis=-1)


def _serendipity_dN(xi: ArrayLike, p: Array) -> Array:
    """Return the derivatives of `_serendipity_N`."""
    d = p.shape[1]
    c = 2**d
    f, df = _linear_factors(xi, p[:c])
    bubble = (f.sum(axis=-1) - (2 * d - 1))[..., None]
    corner = (_gradient(f, df) * bubble + _product(f)[..., None] * df) / c
    middle = _gradient(*_edge_factors(xi, p[c:])) * 2 / c
    return np.concatenate([corner, middle], axis=-2)


class Multilinear(Shape):
    """Shapes with N_a = prod_i (1 + xi_i p_ai) / 2^d."""

    @classmethod
    def N(cls, xi: ArrayLike) -> Array:
        """Return the multilinear functions (..., n)."""
        return _product(_linear_factors(xi, cls.nodes)[0]) / 2 ** cls.nodes.shape[1]

    @classmethod
    def dN(cls, xi: ArrayLike) -> Array:
        """Return their derivatives (..., n, d)."""
        return _gradient(*_linear_factors(xi, cls.nodes)) / 2 ** cls.nodes.shape[1]


class Lagrange(Shape):
    """Shapes with the products of the quadratic Lagrange polynomials through -1, 0, 1."""

    @classmethod
    def N(cls, xi: ArrayLike) -> Array:
        """Return the products (..., n)."""
        return _product(_lagrange_factors(xi, cls.nodes)[0])

    @classmethod
    def dN(cls, xi: ArrayLike) -> Array:
        """Return their derivatives (..., n, d)."""
        return _gradient(*_lagrange_factors(xi, cls.nodes))


class Serendipity(Shape):
    """Shapes with the quadratic serendipity functions of corner and mid-edge nodes."""

    @classmethod
    def N(cls, xi: ArrayLike) -> Array:
        """Return the functions of the corners, then of the edges (..., n)."""
        return _serendipity_N(xi, cls.nodes)

    @classmethod
    def dN(cls, xi: ArrayLike) -> Array:
        """Return their derivatives (..., n, d)."""
        return _serendipity_dN(xi, cls.nodes)
