"""Inverse isoparametric map: from points X back to reference coordinates xi."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.shapes.base import Array, Shape


class Inverse(NamedTuple):
    """Reference coordinates of points, and what is known of them.

    Attributes
    ----------
    xi : (..., 3) float, reference coordinates.
    inside : (...) bool, whether the point lies in the cell (to 1e-9 of its size).
    converged : (...) bool, whether Newton found a xi with X(xi) = the point.
    iterations : Newton steps taken (1 where the map is affine).
    """

    xi: Array
    inside: NDArray[np.bool_]
    converged: NDArray[np.bool_]
    iterations: int


def outside_by(cell: str, xi: Array) -> Array:
    """Return by how much reference points (..., 3) lie outside a cell; ≤ 0 inside."""
    r, s, t = np.moveaxis(xi, -1, 0)
    if cell == "tetrahedron":
        distances = [-r, -s, -t, r + s + t - 1]
    elif cell == "wedge":
        distances = [-r, -s, r + s - 1, np.abs(t) - 1]
    elif cell == "pyramid":
        distances = [-t, np.abs(r) + t - 1, np.abs(s) + t - 1]
    else:
        distances = [np.abs(r) - 1, np.abs(s) - 1, np.abs(t) - 1]
    return np.asarray(np.max(distances, axis=0))


def inverse_map(
    shape: type[Shape],
    X: ArrayLike,
    points: ArrayLike,
    tolerance: float = 1e-13,
    max_iterations: int = 30,
) -> Inverse:
    """Return xi with Σ N_a(xi) X_a = point, by Newton from the centroid.

    Parameters
    ----------
    shape : the reference cell.
    X : (..., n, 3) float, m; nodes of the cells.
    points : (..., 3) float, m; one point per cell, or broadcast against them.
    tolerance : size of the last step, in reference coordinates, at which Newton stops.
    max_iterations : steps after which a point counts as not converged.

    Returns
    -------
    Inverse

    Notes
    -----
    Where the map is affine one step is exact.  Steps are limited to the size of the cell, and
    points that run away (they lie outside a curved cell) are reported as not converged.
    Source: Solfec-1.0 theory, finite-element shape functions, inverse map.

    Examples
    --------
    >>> from kratos_lite.shapes import Hexahedron8
    >>> found = inverse_map(Hexahedron8, Hexahedron8.nodes * 2, [1.0, 0.5, -1.0])
    >>> found.xi.tolist(), bool(found.inside), found.iterations
    ([0.5, 0.25, -0.5], True, 1)
    """
    X, p = np.asarray(X, dtype=float), np.asarray(points, dtype=float)
    batch = np.broadcast_shapes(X.shape[:-2], p.shape[:-1])
    X = np.broadcast_to(X, (*batch, *X.shape[-2:])).reshape(-1, *X.shape[-2:])
    p = np.broadcast_to(p, (*batch, 3)).reshape(-1, 3)
    size = np.ptp(X, axis=1).max(axis=1)
    xi = np.tile(shape.nodes[: shape.corners].mean(axis=0), (len(p), 1))
    converged = np.zeros(len(p), dtype=bool)
    steps = 0
    active = np.arange(len(p))
    while len(active) and steps < max_iterations:
        steps += 1
        at, cells = xi[active], X[active]
        miss = p[active] - (shape.N(at)[:, None, :] @ cells)[:, 0]
        J = np.swapaxes(cells, 1, 2) @ shape.dN(at)
        step = _solve(J, miss)
        length = np.abs(step).max(axis=1)
        xi[active] = at + step * np.minimum(1.0, 2.0 / np.maximum(length, 1e-300))[:, None]
        left = p[active] - (shape.N(xi[active])[:, None, :] @ cells)[:, 0]
        done = (np.abs(left).max(axis=1) <= 4e-15 * _scale(size, p)[active]) | (length <= tolerance)
        converged[active[done & np.isfinite(length)]] = True
        active = active[~done & np.isfinite(length)]
    inside = converged & (outside_by(shape.cell, xi) <= 1e-9)
    return Inverse(xi.reshape(*batch, 3), inside.reshape(batch), converged.reshape(batch), steps)


def _scale(size: Array, p: Array) -> Array:
    """Return the size of a cell, or of its distance from the origin where that is larger."""
    return np.asarray(np.maximum(size, np.abs(p).max(axis=1)))


def _solve(J: Array, r: Array) -> Array:
    """Return J^-1 r for (m, 3, 3) and (m, 3); not finite where J is singular."""
    a, b, c = np.moveaxis(J, -1, 0)
    bc, ca, ab = np.cross(b, c), np.cross(c, a), np.cross(a, b)
    det = (a * bc).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.stack([(m * r).sum(axis=1) for m in (bc, ca, ab)], axis=1) / det[:, None])
