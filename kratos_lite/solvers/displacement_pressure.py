"""Displacements and a pressure in each nearly incompressible element, solved for together.

With p = κ D u the equations (A + Dᵀ κ D) u = b are

    [A  Dᵀ  ] [u]   [b]
    [D  -1/κ] [p] = [0],

which stay well-conditioned for ν → ½.  Minimal residuals (GMRES) solve them.  Each step takes
p = -(S⁻¹ + λ) r_p, with λ in A, and one multigrid cycle for A u = r_u - Dᵀ p.  With A₀ = A - Dᵀ λ D,

    S = D blocks(A₀)⁻¹ Dᵀ + (means around corners)² / 2μ + 1/κ  ≈  D A₀⁻¹ Dᵀ + 1/κ:

the second term holds for smooth pressures, the first one for those that change sign from element to element.
Some of these hardly act on the nodes (checkerboards): no element needs to be stable.  For the others
S⁻¹ + λ = (D A⁻¹ Dᵀ)⁻¹ is nearer to λ + 2μ the more of λ is kept (augmented Lagrangian).

Sources: Elman, Silvester & Wathen, Finite Elements and Fast Iterative Solvers (2014), chapter 4; Benzi &
Olshanskii, SIAM J. Sci. Comput. 28 (2006) 2095-2113 (augmented Lagrangian).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import bsr_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components

from kratos_lite.assembly.block_matrix import BlockMatrix, block_rows
from kratos_lite.solvers.coarse_level import PCoarseLevel
from kratos_lite.solvers.dilatation import SplitMatrix
from kratos_lite.solvers.iteration import GoOn
from kratos_lite.solvers.multigrid import Compiled
from kratos_lite.typing import Array, Bsr, Ints, Mask, Rows

DIRECTIONS = 80
"""Iterations after which they start anew from the residual."""
REDUCED = 1e-10
"""Fraction of the residual at which they start anew, as rounding allows no more."""
ROUGH = 0.03
"""Relative residual of a rough solution."""
MAX_ITERATIONS = 400
"""Iterations after which it does not converge."""
DEGREE = 3
"""Degree of the smoother: an iteration more takes longer than a better cycle."""
INNER, INNER_MAX = 0.1, 120
"""Fraction of the energy at which a solution with S ends, and its most iterations."""

STRONG = 0.4
"""Nodes are strongly coupled where |A_ij| exceeds this fraction of sqrt(|A_ii| |A_jj|)."""
NEAR = 3.0
"""Distance of such nodes to that of the nearest ones at most: quadratic cells couple others as strongly."""
LONGEST = 40
"""Nodes of the largest group; larger ones are taken as single nodes."""


class DisplacementPressure:
    """What solves K u = b for one right side after another, where K is split; it needs the kernels."""

    def __init__(self, K: SplitMatrix, free: Mask, points: Array, linear: PCoarseLevel | None = None) -> None:
        self._cycle = Compiled(K.A, free, points, linear, DEGREE)
        self.levels: list[int] = self._cycle.levels
        inverse = block_inverse(K.A, free, points, K.D, K.kept)
        # residuals are measured by the energy that they stand for
        self._weight = np.sqrt(np.concatenate([inverse.diagonal(), K.modulus]))
        self._S, self._scale = _pressure_operator(K, inverse, free)
        vectors = self._scale, K.bulk, K.kept, self._weight, INNER, INNER_MAX
        self._kernel = self._cycle.with_pressures(_arrays(K.D), _arrays(self._S), *vectors)

    def precondition(self, r: Array) -> Array:
        """Return about K⁻¹ r (3n,), or that of several vectors (k, 3n): rough solutions."""
        return np.apply_along_axis(lambda each: self.solve(each, ROUGH, 0.0)[0], -1, r)

    def solve(
        self, b: Array, tolerance: float, norm: float, each: GoOn | None = None
    ) -> tuple[Array, int, bool]:
        """Return u, iterations and success."""
        go_on = each or (lambda residual: True)
        return self._kernel.solve(b, tolerance, norm, MAX_ITERATIONS, DIRECTIONS, REDUCED, go_on)


def _arrays(A: Bsr) -> tuple[Rows, Rows, Array]:
    """Return what a kernel takes of a matrix of blocks."""
    return A.indptr.astype(np.int32), A.indices.astype(np.int32), np.ascontiguousarray(A.data)


def _pressure_operator(K: SplitMatrix, inverse: Bsr, free: Mask) -> tuple[Bsr, Array]:
    """Return S in single precision, scaled to a diagonal of 1, and the scale."""
    is_loose = np.asarray(free.reshape(-1, 3).any(axis=1))
    around_free = is_loose[K.means.ends].any(axis=1)  # around constrained nodes checkerboards have means, too
    means = K.means.matrix @ diags_array(1.0 * np.asarray(around_free))
    S = (K.D @ inverse @ K.D.T).tocsr() + means @ means.T + diags_array(1 / K.bulk)
    size = np.asarray(1 / np.sqrt(S.diagonal()))
    scale = diags_array(size)
    return (scale @ S @ scale).astype(np.float32).tocsr().tobsr(2 * K.D.blocksize[:1]), size


# ---- the inverse within groups of strongly coupled nodes: lines in flat meshes, or single nodes ----------


def block_inverse(A: BlockMatrix, free: Mask, points: Array, D: Bsr, factor: Array) -> Bsr:
    """Return the inverse (3n, 3n) of A - Dᵀ factor D within each group on its free components, else 0.

    Both are positive definite there; nodes that share a row of R x 3 blocks of D (p, 3n) share a block of A.
    """
    rows, columns, n = A.rows(), A.indices, len(A.indptr) - 1
    group, place = _groups(A, rows, points)
    within = np.flatnonzero(group[rows] == group[columns])
    stiffness = rows[within], columns[within], A.data[within]
    square = _square(D, factor, group)
    dilatations = block_rows(square.indptr), square.indices, square.data
    size = np.bincount(group)
    members, mask, inverses = np.argsort(group, kind="stable"), free.reshape(-1, 3), []
    for k in np.unique(size):
        nodes = members[size[group[members]] == k].reshape(-1, k)
        number = np.empty(len(size), dtype=int)
        number[group[nodes[:, 0]]] = np.arange(len(nodes))
        blocks = np.zeros((len(nodes), k, 3, k, 3))
        for sign, (rows, columns, data) in ((1, stiffness), (-1, dilatations)):
            alike = size[group[rows]] == k
            i, j = rows[alike], columns[alike]
            blocks[number[group[i]], place[i], :, place[j], :] += sign * data[alike]
        inverse = _inverse(blocks.reshape(-1, 3 * k, 3 * k), mask[nodes].reshape(-1, 3 * k))
        ends = np.repeat(nodes, k, axis=1), np.tile(nodes, (1, k))
        inverses.append((*ends, inverse.reshape(-1, k, 3, k, 3).swapaxes(2, 3)))
    i, j = (np.concatenate([part[end].ravel() for part in inverses]) for end in (0, 1))
    data = np.concatenate([part[2].reshape(-1, 3, 3) for part in inverses])
    order = np.argsort(i, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(i, minlength=n))])
    return bsr_array((data[order], j[order], starts), shape=A.shape)


def _square(D: Bsr, factor: Array, group: Ints) -> Bsr:
    """Return Dᵀ factor D (3n, 3n) within each group of nodes."""
    row, R = block_rows(D.indptr), D.blocksize[0]
    data = D.data * np.sqrt(factor).reshape(-1, R, 1)[row]
    if group.max(initial=0) < len(group) - 1:  # what a row has within a group is a row of its own
        row = np.unique(row * len(group) + group[D.indices], return_inverse=True)[1]
    else:
        row = np.arange(len(row))
    order = np.argsort(row, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(row))])
    B = bsr_array((data[order], D.indices[order], starts), shape=(R * (len(starts) - 1), D.shape[1]))
    return B.T @ B


def _near(A: BlockMatrix, rows: Ints, points: Array) -> Mask:
    """Return which entries couple nodes no farther than `NEAR` times the nearest of both, (nnz,)."""
    apart = np.linalg.norm(points[rows] - points[A.indices], axis=1)
    apart[rows == A.indices] = np.inf
    starts = np.minimum(A.indptr[:-1], len(apart) - 1)
    nearest: Array = np.minimum.reduceat(apart, starts)
    return np.asarray(apart <= NEAR * np.minimum(nearest[rows], nearest[A.indices]))


def _groups(A: BlockMatrix, rows: Ints, points: Array) -> tuple[Ints, Ints]:
    """Return the group of each node, and its place in the group."""
    n = len(A.indptr) - 1
    size = np.sqrt(np.einsum("nij,nij->n", A.data, A.data))
    root = np.zeros(n)
    on = A.diagonal_blocks()
    root[A.indices[on]] = np.sqrt(size[on])
    strong = size > STRONG * root[rows] * root[A.indices]
    strong &= _near(A, rows, points)
    graph = csr_array((np.ones(strong.sum()), (rows[strong], A.indices[strong])), shape=(n, n))
    group: Ints = connected_components(graph, directed=False)[1].astype(np.int64)
    large = np.bincount(group)[group] > LONGEST
    group[large] = n + np.arange(large.sum())
    group = np.unique(group, return_inverse=True)[1].astype(np.int64)
    order = np.argsort(group, kind="stable")
    first = np.concatenate([[0], np.cumsum(np.bincount(group))[:-1]])
    place = np.empty(n, dtype=np.int64)
    place[order] = np.arange(n) - first[group[order]]
    return group, place


def _inverse(blocks: Array, free: Mask) -> Array:
    """Return the inverses of (m, k, k) on their free rows and columns (m, k), 0 on the others."""
    both = free[:, :, None] & free[:, None, :]
    inverse: Array = np.linalg.inv(np.where(both, blocks, np.eye(blocks.shape[-1])))
    return np.where(both, inverse, 0.0)
