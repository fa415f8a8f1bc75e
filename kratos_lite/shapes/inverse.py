"""Inverse isoparametric map: from points X back to reference coordinates xi; inverse of Jacobians."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kratos_lite.shapes.base import Shape
from kratos_lite.typing import Array, Mask

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

INSIDE = 1e-9
"""How far outside the reference cell a point still counts as inside, in reference coordinates."""
NEXT, AFTER = np.array([1, 2, 0]), np.array([2, 0, 1])


def _cross(b: Array, c: Array) -> Array:
    """Return the vector product of (..., 3), for few vectors much faster than that of NumPy."""
    return b[..., NEXT] * c[..., AFTER] - b[..., AFTER] * c[..., NEXT]


def determinant(J: Array) -> Array:
    """Return det of (..., 3, 3)."""
    return (J[..., 0] * _cross(J[..., 1], J[..., 2])).sum(axis=-1)


def cofactors(J: Array) -> Array:
    """Return det(J) J^-1 of (..., 3, 3)."""
    a, b, c = J[..., 0], J[..., 1], J[..., 2]
    return np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=-2)


class Inverse(NamedTuple):
    """Reference coordinates of points, and what is known of them."""

    xi: Array  # (..., 3), reference coordinates
    inside: Mask  # (...), to 1e-9 of the size of the cell
    converged: Mask  # (...), whether Newton found X(xi) = point
    iterations: int  # of Newton, 1 where the map is affine


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
    """Return xi (..., 3) with Σ N_a(xi) X_a = point, by Newton from the centroid or `start`."""
    # An affine cell takes one step, a node none. Source: Solfec-1.0 theory, inverse map.
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
    with np.errstate(divide="ignore", invalid="ignore"):  # J may be singular there
        stretch = np.abs(cofactors(J) / determinant(J)[:, None, None]).sum(axis=2).max(axis=1)
    inside[doubtful] = outside[doubtful] <= INSIDE + digits[doubtful] * stretch
    return inside


def _solve(J: Array, r: Array) -> Array:
    """Return J^-1 r for (m, 3, 3) and (m, 3); not finite where J is singular."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return (cofactors(J) @ r[:, :, None])[:, :, 0] / determinant(J)[:, None]
