"""Exact rules: quadrature chosen by the polynomial degree of N N det J and by the geometry of a cell.

In the coordinates of its rule (x / (1 - z), y / (1 - z) and z for a pyramid) a cell has polynomial shape
functions.  With functions of degree p in each direction of a product, det J has degree 3p - 1; if the edges
are straight and mid-edge nodes in the middle, 2; if the cell is affine, 0.  Over a tetrahedron, where degrees
are total ones, it has 3(p - 1) or 0.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from kratos_lite.quadrature import CELLS, Rule, rule_for
from kratos_lite.registry import remembered
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints

if TYPE_CHECKING:
    from numpy.typing import NDArray

AFFINE, STRAIGHT, CURVED = range(3)
"""Geometry of a cell: constant J; that of its corners alone; any."""
Geometries: TypeAlias = "NDArray[np.int8]"
"""The geometry of each of many cells."""
ROUNDING = 8 * np.finfo(float).eps
"""How far, relative to the largest coordinate, rounding may move a node from where its geometry has it."""
MOST = 11
"""Highest degree of shape functions that is recognized."""

_LINES = {
    "tetrahedron": [((0.05, 0.1, 0.2), (0.7, 0.2, 0.05)), ((0.1, 0.05, 0.7), (0.2, 0.6, 0.05))],
    "hexahedron": [
        ((-0.9, -0.3, 0.4), (0.9, -0.3, 0.4)),
        ((0.2, -0.9, 0.4), (0.2, 0.9, 0.4)),
        ((0.2, -0.3, -0.9), (0.2, -0.3, 0.9)),
    ],
    "wedge": [
        ((0.1, 0.2, -0.3), (0.7, 0.1, -0.3)),
        ((0.2, 0.7, 0.4), (0.1, 0.1, 0.4)),
        ((0.2, 0.3, -0.9), (0.2, 0.3, 0.9)),
    ],
    "pyramid": [
        ((-0.6, 0.2, 0.3), (0.6, 0.2, 0.3)),
        ((0.2, -0.6, 0.3), (0.2, 0.6, 0.3)),
        ((0.6, -0.4, 0.0), (0.06, -0.04, 0.9)),
    ],
}
"""Lines in reference cells along which one coordinate of the rule varies alone; of a tetrahedron, any."""


@remembered
def degree_of(shape: type[Shape]) -> int:
    """Return the degree of shape functions along directions of a rule; `Shape.degree` if not polynomials."""
    degree, k = 0, np.arange(MOST + 2)
    T = np.cos(np.outer(k, np.pi * (k + 0.5) / (MOST + 2)))  # Chebyshev polynomials at the zeros of the last
    for start, end in np.array(_LINES[shape.cell]):
        N = np.asarray(shape.N(start + (1 + T[1][:, None]) / 2 * (end - start)), dtype=float)
        size = np.abs(T @ N).max(axis=1)  # of the coefficients
        degree = max(degree, int(np.flatnonzero(size > 1e-10 * size.max())[-1]))
    return degree if degree <= MOST else shape.degree


@remembered
def exact_rule(shape: type[Shape], factors: int, geometry: int = CURVED, flow: bool = False) -> Rule:
    """Return the rule that integrates a product of shape functions, or N c·grad N (`flow`), with det J."""
    p, simplex = degree_of(shape), shape.cell == "tetrahedron"
    curved = 3 * (p - 1) if simplex else 3 * p - 1
    degree = factors * p + (0, 0 if simplex else 2, curved)[geometry]
    if flow and not simplex:
        degree = max(degree, 2 * p + 2)
    return rule_for(shape.cell, min(degree, 40))


def has_rules(shape: type[Shape]) -> bool:
    """Return whether the family of a cell is one whose degrees are known."""
    return shape.cell in CELLS and shape.cell in _LINES


@remembered
def interpolations(shape: type[Shape]) -> list[tuple[Array, Array] | None]:
    """Return nodes and C of AFFINE and STRAIGHT cells, X = C X[nodes]; None if a shape spans none."""
    if not has_rules(shape):
        return [None, None]
    xi = shape.nodes
    base = [0]  # corners that span the cell
    for a in range(1, shape.corners):
        if len(base) < 4 and np.linalg.matrix_rank(xi[[*base[1:], a]] - xi[0]) == len(base):
            base.append(a)

    def affine(points: Array) -> Array:
        ones = np.ones((len(points), 1))
        return np.hstack([ones, points]) @ np.linalg.inv(np.column_stack([np.ones(4), xi[base]]))

    linear = shape.linear()
    maps: list[tuple[Array, Array] | None] = [_spanned(shape, np.array(base), affine)]
    return [*maps, _spanned(shape, np.arange(shape.corners), linear.N) if linear else None]


def _spanned(
    shape: type[Shape], nodes: Ints, functions: Callable[[Array], Array]
) -> tuple[Array, Array] | None:
    """Return nodes and functions at the nodes of a shape, or None if it does not span these functions."""
    C = functions(shape.nodes)
    points = np.array([xi for line in _LINES[shape.cell] for xi in line])
    if np.abs(shape.N(points) @ C - functions(points)).max() > 1e-12:
        return None
    return nodes.astype(np.int32), np.ascontiguousarray(C, dtype=float)


def geometries(shape: type[Shape], X: Array) -> Geometries:
    """Return AFFINE, STRAIGHT or CURVED of cells X (..., n, 3)."""
    near = ROUNDING * np.abs(X).max(axis=(-2, -1))
    X = X - X[..., :1, :]
    geometry_of = np.full(X.shape[:-2], CURVED, dtype=np.int8)
    for geometry in (STRAIGHT, AFFINE):
        if spanned := interpolations(shape)[geometry]:
            nodes, C = spanned
            geometry_of[np.abs(X - C @ X[..., nodes, :]).max(axis=(-2, -1)) <= near] = geometry
    return geometry_of
