"""Shape functions on [-1, 1]^d: multilinear, Lagrange and serendipity, for any dimension d.

Each takes points xi (..., d) and node coordinates p (n, d) and returns N (..., n) and
dN (..., n, d).  Source: Zienkiewicz & Taylor, The Finite Element Method, vol. 1, ch. 4.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.shapes.base import Array


def _product(f: Array) -> Array:
    return np.asarray(f.prod(axis=-1))


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


def linear_N(xi: ArrayLike, p: Array) -> Array:
    """Return N_a = prod_i (1 + xi_i p_ai) / 2^d."""
    return np.asarray(_product(_linear_factors(xi, p)[0]) / 2 ** p.shape[1])


def linear_dN(xi: ArrayLike, p: Array) -> Array:
    """Return the derivatives of `linear_N`."""
    return np.asarray(_gradient(*_linear_factors(xi, p)) / 2 ** p.shape[1])


def lagrange_N(xi: ArrayLike, p: Array) -> Array:
    """Return the products of the quadratic Lagrange polynomials through -1, 0, 1."""
    return _product(_lagrange_factors(xi, p)[0])


def lagrange_dN(xi: ArrayLike, p: Array) -> Array:
    """Return the derivatives of `lagrange_N`."""
    return _gradient(*_lagrange_factors(xi, p))


def serendipity_N(xi: ArrayLike, p: Array) -> Array:
    """Return the quadratic serendipity functions: corner nodes first, then mid-edge nodes."""
    d = p.shape[1]
    c = 2**d
    f, _ = _linear_factors(xi, p[:c])
    corner = _product(f) * (f.sum(axis=-1) - (2 * d - 1)) / c
    middle = _product(_edge_factors(xi, p[c:])[0]) * 2 / c
    return np.concatenate([corner, middle], axis=-1)


def serendipity_dN(xi: ArrayLike, p: Array) -> Array:
    """Return the derivatives of `serendipity_N`."""
    d = p.shape[1]
    c = 2**d
    f, df = _linear_factors(xi, p[:c])
    bubble = (f.sum(axis=-1) - (2 * d - 1))[..., None]
    corner = (_gradient(f, df) * bubble + _product(f)[..., None] * df) / c
    middle = _gradient(*_edge_factors(xi, p[c:])) * 2 / c
    return np.concatenate([corner, middle], axis=-2)
