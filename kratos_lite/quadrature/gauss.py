"""One-dimensional Gauss rules, and tensor and conical products of them."""

from __future__ import annotations

from math import sqrt

import numpy as np

from kratos_lite.typing import Array


def legendre(n: int) -> tuple[Array, Array]:
    """Return the n-point Gauss-Legendre rule on [-1, 1], exact to degree 2n - 1."""
    # Source: closed forms up to five points (Abramowitz & Stegun 25.4.30), `numpy` beyond.
    if n == 1:
        x, w = [0.0], [2.0]
    elif n == 2:
        x, w = [-1 / sqrt(3), 1 / sqrt(3)], [1.0, 1.0]
    elif n == 3:
        x, w = [-sqrt(3 / 5), 0.0, sqrt(3 / 5)], [5 / 9, 8 / 9, 5 / 9]
    elif n == 4:
        a, b = (sqrt(3 / 7 - s * 2 / 7 * sqrt(6 / 5)) for s in (1, -1))
        v, u = ((18 + s * sqrt(30)) / 36 for s in (1, -1))
        x, w = [-b, -a, a, b], [u, v, v, u]
    elif n == 5:
        a, b = (sqrt(5 - s * 2 * sqrt(10 / 7)) / 3 for s in (1, -1))
        v, u = ((322 + s * 13 * sqrt(70)) / 900 for s in (1, -1))
        x, w = [-b, -a, 0.0, a, b], [u, v, 128 / 225, v, u]
    else:
        points, weights = np.polynomial.legendre.leggauss(n)
        return points, weights
    return np.array(x), np.array(w)


def jacobi(n: int, alpha: int) -> tuple[Array, Array]:
    """Return the n-point rule for ∫_0^1 f(x) (1 - x)^alpha dx, exact to degree 2n - 1."""
    # Source: Golub & Welsch, Math. Comp. 23 (1969) 221-230, for the Jacobi weight.
    k = np.arange(n, dtype=float)
    s = 2 * k + alpha
    diagonal = np.full(n, -alpha / (alpha + 2.0))
    diagonal[1:] = -(alpha**2) / (s[1:] * (s[1:] + 2))
    k, s = k[1:], s[1:]
    off = np.sqrt(4 * k**2 * (k + alpha) ** 2 / (s**2 * (s + 1) * (s - 1)))
    x, V = np.linalg.eigh(np.diag(diagonal) + np.diag(off, 1) + np.diag(off, -1))
    return (1 + x) / 2, V[0] ** 2 / (alpha + 1)


def tensor_product(n: int, d: int) -> tuple[Array, Array]:
    """Return the n^d Gauss-Legendre points and weights on [-1, 1]^d."""
    x, w = legendre(n)
    grid = np.meshgrid(*[x] * d, indexing="ij")
    weights = np.meshgrid(*[w] * d, indexing="ij")
    return np.stack(grid, axis=-1).reshape(-1, d), np.prod(weights, axis=0).ravel()


def conical_simplex(n: int, d: int) -> tuple[Array, Array]:
    """Return the n^d Gauss-Jacobi product on the unit simplex; all weights are positive."""
    # Source: Stroud, Approximate Calculation of Multiple Integrals (1971), conical products.
    rules = [jacobi(n, d - 1 - i) for i in range(d)]
    grid = np.meshgrid(*[x for x, _ in rules], indexing="ij")
    weights = np.meshgrid(*[w for _, w in rules], indexing="ij")
    points, remainder = [], np.ones_like(grid[0])
    for x in grid:
        points.append(x * remainder)
        remainder = remainder * (1 - x)
    return np.stack(points, axis=-1).reshape(-1, d), np.prod(weights, axis=0).ravel()
