"""The inverse of a matrix within groups of strongly coupled nodes: lines in flat meshes, or single nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix, block_rows
from kratos_lite.typing import Array, Ints, Mask

if TYPE_CHECKING:
    from scipy.sparse import bsr_array

STRONG = 0.4
"""Nodes are strongly coupled where |A_ij| exceeds this fraction of sqrt(|A_ii| |A_jj|)."""
NEAR = 3.0
"""Distance of such nodes to that of the nearest ones at most: quadratic cells couple others as strongly."""
LONGEST = 40
"""Nodes of the largest group; larger ones are taken as single nodes."""


def block_inverse(A: BlockMatrix, free: Mask, points: Array, D: bsr_array, factor: Array) -> bsr_array:
    """Return the inverse (3n, 3n) of A - Dᵀ factor D within each group on its free components, else 0.

    Both are positive definite there; nodes that share a row of R x 3 blocks of D (p, 3n) share a block of A.
    """
    from scipy.sparse import bsr_array

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


def _square(D: bsr_array, factor: Array, group: Ints) -> bsr_array:
    """Return Dᵀ factor D (3n, 3n) within each group of nodes."""
    from scipy.sparse import bsr_array

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
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

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
