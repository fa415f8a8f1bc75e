"""Inverse isoparametric map: from points X back to reference coordinates xi."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kratos_lite.shapes.base import Shape
from kratos_lite.typing import Array, Mask

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

INSIDE = 1e-9
"""How far outside the reference cell a point still counts as inside, in reference coordinates."""


class Inverse(NamedTuple):
    """Reference coordinates of points, and what is known of them.

    Attributes
    ----------
    xi : (..., 3) float, reference coordinates.
    inside : (...) bool, whether the point lies in the cell, to 1e-9 of its size and the last digits of
        the coordinates.
    converged : (...) bool, whether Newton found a xi with X(xi) = the point.
    iterations : Newton steps taken (1 where the map is affine).
    """

    xi: Array
    inside: Mask
    converged: Mask
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
    return np.max(distances, axis=0)


def inverse_map(
    shape: type[Shape],
    X: ArrayLike,
    points: ArrayLike,
    tolerance: float = 1e-13,
    max_iterations: int = 30,
    start: ArrayLike | None = None,
) -> Inverse:
    """Return xi with Σ N_a(xi) X_a = point, by Newton from the centroid.

    Parameters
    ----------
    shape : the reference cell.
    X : (..., n, 3) float, m; nodes of the cells.
    points : (..., 3) float, m; one point per cell, or broadcast against them.
    tolerance : size of the last step, in reference coordinates, at which Newton stops.
    max_iterations : steps after which a point counts as not converged.
    start : (..., 3) float, reference coordinates at which Newton starts instead of the centroid.

    Returns
    -------
    Inverse

    Notes
    -----
    Where the map is affine one step is exact, and a node, such as the apex of a pyramid where the Jacobian
    has no limit, is found without any.  Steps are limited to the size of the cell, and points that run away
    (they lie outside a curved cell) are reported as not converged.  A curved cell may take two xi to one
    point, one of them outside; another `start` may then find the other.
    Source: Solfec-1.0 theory, finite-element shape functions, inverse map.

    Examples
    --------
    >>> from kratos_lite.shapes.hexahedra import Hexahedron8
    >>> found = inverse_map(Hexahedron8, Hexahedron8.nodes * 2, [1.0, 0.5, -1.0])
    >>> found.xi.tolist(), bool(found.inside), found.iterations
    ([0.5, 0.25, -0.5], True, 1)
    """
    X, p = np.asarray(X, dtype=float), np.asarray(points, dtype=float)
    batch = np.broadcast_shapes(X.shape[:-2], p.shape[:-1])
    X = np.broadcast_to(X, (*batch, *X.shape[-2:])).reshape(-1, *X.shape[-2:])
    p = np.broadcast_to(p, (*batch, 3)).reshape(-1, 3)
    first = np.broadcast_to(
        shape.nodes[: shape.corners].mean(axis=0) if start is None else np.asarray(start, dtype=float),
        (*batch, 3),
    ).reshape(-1, 3)
    middle = X[:, : shape.corners].mean(axis=1)  # taken off, so that no digits are lost far from the origin
    cells = X - middle[:, None]
    xi, converged, steps = _newton(shape, cells, p - middle, first, tolerance, max_iterations)
    for a, node in enumerate(shape.nodes):
        at_node = (X[:, a] == p).all(axis=1)
        xi[at_node], converged[at_node] = node, True
    digits = 4 * np.finfo(float).eps * np.abs(X).max(axis=(1, 2))
    inside = converged & _inside(shape, cells, xi, digits)
    return Inverse(xi.reshape(*batch, 3), inside.reshape(batch), converged.reshape(batch), steps)


def _newton(
    shape: type[Shape], X: Array, p: Array, start: Array, tolerance: float, max_iterations: int
) -> tuple[Array, Mask, int]:
    """Return xi (m, 3), whether Newton found it (m,), and the steps taken, for X (m, n, 3) and p (m, 3)."""
    small = 4e-15 * np.maximum(np.abs(X).max(axis=(1, 2)), np.abs(p).max(axis=1))
    xi = start.copy()
    converged = np.zeros(len(p), dtype=bool)
    miss = p - (shape.N(xi)[:, None, :] @ X)[:, 0]
    steps = 0
    active = np.arange(len(p))
    while len(active) and steps < max_iterations:
        steps += 1
        at, cells = xi[active], X[active]
        J = np.swapaxes(cells, 1, 2) @ shape.dN(at)
        step = _solve(J, miss)
        length = np.abs(step).max(axis=1)
        step[~np.isfinite(length)] = 0.0  # J is singular there: the point is given up
        xi[active] = at = at + step * np.minimum(1.0, 2.0 / np.maximum(length, 1e-300))[:, None]
        miss = p[active] - (shape.N(at)[:, None, :] @ cells)[:, 0]
        done = (np.abs(miss).max(axis=1) <= small[active]) | (length <= tolerance)
        converged[active[done & np.isfinite(length)]] = True
        going = ~done & np.isfinite(length)
        active, miss = active[going], miss[going]
    return xi, converged, steps


def _inside(shape: type[Shape], X: Array, xi: Array, digits: Array) -> Mask:
    """Return whether xi (m, 3) lie in the reference cell, as far as the last digits of X (m, n, 3) tell."""
    outside = outside_by(shape.cell, xi)
    inside = outside <= INSIDE
    doubtful = np.flatnonzero((outside > INSIDE) & (outside < 1e-3))
    J = np.swapaxes(X[doubtful], 1, 2) @ shape.dN(xi[doubtful])
    columns = [np.abs(_solve(J, np.tile(axis, (len(J), 1)))) for axis in np.eye(3)]
    stretch = np.sum(columns, axis=0).max(axis=1)
    inside[doubtful] = outside[doubtful] <= INSIDE + digits[doubtful] * stretch
    return inside


def _solve(J: Array, r: Array) -> Array:
    """Return J^-1 r for (m, 3, 3) and (m, 3); not finite where J is singular."""
    a, b, c = np.moveaxis(J, -1, 0)
    bc, ca, ab = np.cross(b, c), np.cross(c, a), np.cross(a, b)
    det = (a * bc).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack([(m * r).sum(axis=1) for m in (bc, ca, ab)], axis=1) / det[:, None]
