"""Mortar integrals: displacements of one surface as means, by dual multipliers, of those of another.

∫ λ·(u_a - u_b) dA = 0 for all multipliers λ of surface a.  Cells of both are projected on the planes of
those of a, clipped there, and cut into triangles, over which all is integrated.  The functions of λ are
biorthogonal to those of u_a in each cell, so that their integrals D are diagonal.

Sources: Puso, Int. J. Numer. Meth. Eng. 59 (2004) 315-336; Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012;
Cichosz & Bischoff, Comput. Methods Appl. Mech. Eng. 200 (2011) 1317-1332, integrals where both are;
Popp, Wohlmuth, Gee & Wall, SIAM J. Sci. Comput. 34 (2012) B421-B446, quadratic cells.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kratos_lite.mesh import Block, distinct
from kratos_lite.quadrature import rule_for
from kratos_lite.typing import Array, Csr, Ints, Rows

ALPHA = 0.2
"""Part of each mid-edge function that its corners take, so that the integrals of all are positive."""
NEAR = 0.2
"""Distance up to which two cells meet, as a fraction of the larger radius."""
FACING = 0.5
"""Least cosine of the angle between two cells that meet."""
SMALL = 1e-9
"""Fraction of its radius by which a cell is not straight, or covered by others."""
PAIRS = 400
"""Pairs of cells that are clipped at a time."""
OUTLINES: dict[int, list[tuple[int, ...]]] = {
    6: [(0, 3, 5, 5), (3, 1, 4, 4), (5, 4, 2, 2), (3, 4, 5, 5)],
    8: [(0, 4, 7, 7), (1, 5, 4, 4), (2, 6, 5, 5), (3, 7, 6, 6), (4, 5, 6, 7)],
    9: [(0, 4, 8, 7), (4, 1, 5, 8), (8, 5, 2, 6), (7, 8, 6, 3)],
}
"""Polygons, of columns of nodes, that stand for a cell that is not straight."""


class Cells:
    """Cells of one shape: places X (m, k, 3); center, radius and axes of each, the last its normal."""

    def __init__(self, block: Block, points: Array) -> None:
        self.shape, self.nodes, self.X = block.known_shape, block.nodes, points[block.nodes]
        c, k = self.shape.corners, self.X.shape[1]
        X = self.X[:, :c]
        self.center = X.mean(axis=1)
        self.radius = np.linalg.norm(self.X - self.center[:, None], axis=2).max(axis=1)
        z = np.cross(X[:, c // 2] - X[:, 0], X[:, c - 1] - X[:, c - 3])
        y = np.cross(z, X[:, 1] - X[:, 0])
        axes = np.stack([np.cross(y, z), y, z], axis=1)
        self.axes = axes / np.linalg.norm(axes, axis=2, keepdims=True)
        linear = self.shape.linear()
        assert linear is not None
        bulge = np.abs(self.X - linear.N(self.shape.nodes) @ X).max(axis=(1, 2))
        straight = bool((bulge <= SMALL * self.radius).all())
        self.outlines = [(*range(c), c - 1)[:4]] if straight else OUTLINES[k]
        skew = np.abs(X[:, 0] + X[:, c // 2] - X[:, 1] - X[:, c - 1]).max(axis=1) if c == 4 else 0.0
        self.is_affine = straight and bool((skew <= SMALL * self.radius).all())
        places = np.indices((3, 3)).reshape(2, 9).T / 2.0
        self.polynomials = np.linalg.solve(_monomials(places), self.shape.N(places))
        self.degree = self.shape.degree * (1 if c == 3 else 2) + 4 * (straight and not self.is_affine)

    def on_planes(self, X: Array, i: Ints) -> Array:
        """Return places (m, k, 3) along the axes of cells i (m,)."""
        return np.asarray((X - self.center[i][:, None]) @ np.swapaxes(self.axes[i], 1, 2))

    def transformation(self) -> Array:
        """Return T (k, k) of u = T ũ: functions N T have positive integrals."""
        T, c = np.eye(len(self.shape.nodes)), self.shape.corners
        for e, edge in enumerate(self.shape.edges if len(T) > c else ()):
            T[c + e, [*edge, c + e]] = ALPHA, ALPHA, 1 - 2 * ALPHA
        return T


@dataclass(frozen=True, eq=False)
class Mortar:
    """D (ũ - W u) = 0 with u_a = T ũ ties the nodes of surface a."""

    nodes: Ints  # (d,) of the mesh
    D: Array  # (d,) m²
    W: Csr  # (d, n), of nodes of surface b
    T: Csr  # (d, d)
    inverse: Csr  # of T
    neighbors: Csr  # (d, d), other nodes of the same cells: corners of corners, others of others
    covered: float  # least fraction of a cell that surface b covers
    gap: float  # m, least distance of cells that are too far apart


def mortar(points: Array, a: Sequence[Block], b: Sequence[Block], tolerance: float | None) -> Mortar:
    """Return what ties surface a to surface b, up to `tolerance` in m away, or `NEAR` if that is None."""
    from scipy.sparse import coo_array, csr_array, diags_array

    every, others = ([Cells(block, points) for block in blocks] for blocks in (a, b))
    nodes = distinct(np.concatenate([cells.nodes.ravel() for cells in every]))
    D, covered, gap, shape = np.zeros(len(nodes)), 1.0, np.inf, (len(nodes), len(points))
    W: Csr = csr_array(shape)
    for cells in every:
        local = np.searchsorted(nodes, cells.nodes)
        sums, fraction, integrals, closest = _integrals(cells, others, tolerance)
        covered, gap = min(covered, float(fraction.min())), min(gap, closest)
        np.add.at(D, local, sums)
        for i, further, M in integrals:
            rows, columns = np.broadcast_arrays(local[i][:, :, None], further[:, None])
            W = W + csr_array(coo_array((M.ravel(), (rows.ravel(), columns.ravel())), shape=shape))
    W = csr_array(diags_array(1 / np.where(D > 0, D, 1.0)) @ W)
    W.data[np.abs(W.data) < 1e-14] = 0.0
    W.eliminate_zeros()
    return Mortar(nodes, D, W, *_transformations(every, nodes), _neighbors(every, nodes), covered, gap)


def _integrals(
    a: Cells, others: Sequence[Cells], tolerance: float | None
) -> tuple[Array, Array, Iterator[tuple[Ints, Rows, Array]], float]:
    """Return ∫ Ñ dA (m, k), what is covered (m,), and cells, nodes and ∫ Φ N dA of pairs; the least gap."""
    T, (m, k, _), gap = a.transformation(), a.X.shape, np.inf
    mass, area, integrals = np.zeros((m, k, k)), np.zeros(m), []
    for b in others:
        for i, j, N_a, N_b, weights, closest in _segments(a, b, tolerance):
            N, gap = N_a @ T, min(gap, closest)
            weighted = np.swapaxes(N * weights[..., None], 1, 2)
            np.add.at(mass, i, weighted @ N)
            np.add.at(area, i, weights.sum(axis=1))
            integrals.append((i, b.nodes[j], weighted @ N_b))
    flat = a.on_planes(a.X, np.arange(m))[..., :2]
    fraction = area / sum(_areas(flat[:, list(outline)]) for outline in a.outlines)
    sums = np.where(fraction[:, None] > SMALL, mass.sum(axis=2), 0.0)  # the functions add up to 1
    mass[fraction <= SMALL] = np.eye(k)
    dual = sums[..., None] * np.linalg.inv(mass)  # Φ = dual Ñ
    return sums, fraction, ((i, nodes, dual[i] @ M) for i, nodes, M in integrals), gap


def _segments(
    a: Cells, b: Cells, tolerance: float | None
) -> Iterator[tuple[Ints, Ints, Array, Array, Array, float]]:
    """Yield triangles (t,) of cells i of a, j of b: their functions (t, g, k), weights (t, g), and a gap."""
    rule = rule_for("triangle", a.degree + max(a.degree, b.degree))
    for i, j in _candidates(a, b, tolerance):
        A, B = a.on_planes(a.X[i], i), a.on_planes(b.X[j], i)
        limit = NEAR * np.maximum(a.radius[i], b.radius[j])
        limit = limit if tolerance is None else np.full(len(i), tolerance)
        for outline in a.outlines:
            for opposite in b.outlines:
                clipped = _clip(A[:, list(outline), :2], B[:, list(opposite), :2])
                fan = [clipped[:, [0, corner, corner + 1]] for corner in range(1, clipped.shape[1] - 1)]
                corners, pair = np.concatenate(fan), np.tile(np.arange(len(i)), len(fan))
                area = _areas(corners)
                some = area > 1e-12 * a.radius[i[pair]] ** 2
                corners, pair, area = corners[some], pair[some], area[some]
                at = corners[:, :1] + rule.points @ (corners[:, 1:] - corners[:, :1])
                N, N_b = _functions(a, A[pair, :, :2], at), _functions(b, B[pair, :, :2], at)
                apart = np.abs(N @ A[pair, :, 2:] - N_b @ B[pair, :, 2:]).mean(axis=(1, 2))
                meet = apart <= limit[pair]
                pair, weights = pair[meet], 2 * area[meet, None] * rule.weights
                yield i[pair], j[pair], N[meet], N_b[meet], weights, float(apart[~meet].min(initial=np.inf))


def _candidates(a: Cells, b: Cells, tolerance: float | None) -> Iterator[tuple[Ints, Ints]]:
    """Yield pairs of cells that face each other, are near and lie one above the other, some at a time."""
    from scipy.spatial import cKDTree

    reach = (1 + NEAR) * (a.radius + b.radius.max()) + (tolerance or 0.0)
    lists = cKDTree(b.center).query_ball_point(a.center, reach)
    i = np.repeat(np.arange(len(reach)), [len(near) for near in lists])
    j = np.concatenate([np.zeros(0, dtype=np.int64), *lists]).astype(np.int64)
    apart = np.linalg.norm(a.center[i] - b.center[j], axis=1)
    near = apart <= (1 + NEAR) * (a.radius[i] + b.radius[j]) + (tolerance or 0.0)
    near &= np.abs((a.axes[i, 2] * b.axes[j, 2]).sum(axis=1)) >= FACING
    i, j = i[near], j[near]
    A, B = a.on_planes(a.X[i], i), a.on_planes(b.X[j], i)
    over = (A.min(axis=1) < B.max(axis=1)) & (B.min(axis=1) < A.max(axis=1))
    i, j = (cells[over[:, :2].all(axis=1)] for cells in (i, j))
    for first in range(0, len(i), PAIRS):
        yield i[first : first + PAIRS], j[first : first + PAIRS]


def _areas(P: Array) -> Array:
    """Return the areas (m,) of polygons (m, v, 2), negative where they run clockwise."""
    Q = np.roll(P, -1, axis=1)
    return np.asarray((P[..., 0] * Q[..., 1] - P[..., 1] * Q[..., 0]).sum(axis=1) / 2)


def _clip(P: Array, Q: Array) -> Array:
    """Return what of polygons (m, v, 2) is inside convex ones (m, 4, 2), the last corner repeated."""
    # Source: Sutherland & Hodgman, Commun. ACM 17 (1974) 32-42.
    Q = np.where(_areas(Q)[:, None, None] < 0, Q[:, ::-1], Q)
    for e in range(4):
        side, along = Q[:, None, (e + 1) % 4] - Q[:, None, e], P - Q[:, None, e]
        d = side[..., 0] * along[..., 1] - side[..., 1] * along[..., 0]
        after, ahead = np.roll(d, -1, axis=1), np.roll(P, -1, axis=1) - P
        crosses = d * after < 0
        cut = P + (np.where(crosses, d, 0.0) / np.where(crosses, d - after, 1.0))[..., None] * ahead
        kept = np.stack([d >= 0, crosses], axis=2).reshape(len(P), -1)
        corners = np.stack([P, cut], axis=2).reshape(len(P), -1, 2)
        order = np.argsort(~kept, axis=1, kind="stable")[:, : P.shape[1] + 1]
        last = np.maximum(kept.sum(axis=1) - 1, 0)
        order = np.take_along_axis(order, np.minimum(np.arange(order.shape[1]), last[:, None]), axis=1)
        P = np.take_along_axis(corners, order[..., None], axis=1)
        P[~kept.any(axis=1)] = 0.0
    return P


def _functions(cells: Cells, X: Array, at: Array) -> Array:
    """Return the functions (m, g, k) of flat cells (m, k, 2) at places (m, g, 2) in them, by Newton."""
    shape, Xt = cells.shape, np.swapaxes(X, 1, 2)[:, None]
    middle = shape.nodes[: shape.corners].mean(axis=0)
    J, miss = Xt @ shape.dN(middle), at - (shape.N(middle) @ X)[:, None]
    xi = middle + miss @ np.linalg.inv(np.swapaxes(J, 2, 3))[:, 0]
    for _ in range(0 if cells.is_affine else 20):
        step = np.linalg.solve(Xt @ shape.dN(xi), (at - shape.N(xi) @ X)[..., None])[..., 0]
        xi += step
        if np.abs(step).max(initial=0.0) < 1e-12:
            break
    return _monomials(xi) @ cells.polynomials


def _monomials(xi: Array) -> Array:
    """Return x^a y^b (..., 9) with a, b = 0 … 2, of which the functions of all faces are sums."""
    x, y = (np.stack([np.ones_like(t), t, t * t], axis=-1) for t in (xi[..., 0], xi[..., 1]))
    return (x[..., :, None] * y[..., None, :]).reshape(*xi.shape[:-1], 9)


def _transformations(every: Sequence[Cells], nodes: Ints) -> tuple[Csr, Csr]:
    """Return T (d, d) of all cells, and its inverse."""
    from scipy.sparse import csr_array, diags_array

    edges, d = [np.zeros((0, 3), dtype=np.int32)], len(nodes)
    for cells in every:
        if len(cells.shape.nodes) > (c := cells.shape.corners):
            edges += [cells.nodes[:, [c + e, *edge]] for e, edge in enumerate(cells.shape.edges)]
    middle, *ends = np.searchsorted(nodes, np.concatenate(edges)).T
    middle, first = np.unique(middle, return_index=True)
    rows, columns = np.tile(middle, 2), np.concatenate([end[first] for end in ends])
    B, scale = csr_array((np.ones(len(rows)), (rows, columns)), shape=(d, d)), np.ones(d)
    scale[middle] = 1 - 2 * ALPHA
    inverse = diags_array(1 / scale) - ALPHA / (1 - 2 * ALPHA) * B
    return csr_array(diags_array(scale) + ALPHA * B), csr_array(inverse)


def _neighbors(every: Sequence[Cells], nodes: Ints) -> Csr:
    """Return which other nodes (d, d) share a cell, corners with corners, others with others."""
    from scipy.sparse import coo_array, csr_array

    pairs = [np.zeros((2, 0), dtype=np.int64)]
    for cells in every:
        local, c = np.searchsorted(nodes, cells.nodes), cells.shape.corners
        for some in (local[:, :c], local[:, c:]):
            one, other = np.broadcast_arrays(some[:, :, None], some[:, None])
            pairs.append(np.stack([one[one != other], other[one != other]]))
    at = np.concatenate(pairs, axis=1)
    return csr_array(coo_array((np.ones(at.shape[1]), tuple(at)), shape=(len(nodes), len(nodes))))
