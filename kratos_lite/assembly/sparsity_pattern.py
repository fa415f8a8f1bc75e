"""Sparsity pattern: which blocks of a global matrix the elements fill, and where.

It is made from the node graph, once for each connectivity.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from kratos_lite.assembly.block_matrix import block_rows
from kratos_lite.native import kernels
from kratos_lite.typing import Array, Ints, Rows


class Pattern:
    """Sparsity of the node graph in rows of node blocks."""

    def __init__(self, n_nodes: int, connectivity: Sequence[Rows]) -> None:
        self.n_nodes = n_nodes
        self.connectivity = [np.ascontiguousarray(nodes, dtype=np.int32) for nodes in connectivity]
        module = kernels("stiffness")
        self.indptr: Rows
        self.indices: Rows
        self.indptr, self.indices = (module.pattern if module else _pattern)(n_nodes, self.connectivity)

    def rows(self) -> Ints:
        """Return the row of each block, (nnz,)."""
        return block_rows(self.indptr)

    @cached_property
    def diagonal(self) -> Ints:
        """Place of the diagonal block of each row, (n,)."""
        return np.flatnonzero(self.rows() == self.indices)

    @cached_property
    def _keys(self) -> Ints:
        """A number for each block, ascending."""
        return self.rows() * self.n_nodes + self.indices

    def add(self, data: Array, number: int, window: slice, matrices: Array) -> None:
        """Add matrices of some elements of a number: (m, k, k, 3, 3) to (nnz, 3, 3), (m, k, k) to (nnz,)."""
        self.add_at(data, self.connectivity[number][window], matrices)

    def add_matrix(self, data: Array, A: Any, factor: float = 1.0) -> None:
        """Add a sparse matrix (3n, 3n), whose nodes share elements, to (nnz, 3, 3)."""
        A = A.tobsr((3, 3))
        A.sort_indices()
        places = np.searchsorted(self._keys, block_rows(A.indptr) * self.n_nodes + A.indices)
        data[places] += factor * A.data

    def add_tangents(self, data: Array, tangents: Sequence[tuple[Ints, Array]]) -> None:
        """Add tangents (m, k, 3, k, 3) at nodes (m, k), each of one element."""
        for nodes, matrices in tangents:
            self.add_at(data, nodes.astype(np.int32), matrices.transpose(0, 1, 3, 2, 4))

    def add_at(self, data: Array, nodes: Rows, matrices: Array) -> None:
        """Add matrices to nodes (m, k) that are each of one element."""
        if module := kernels("stiffness"):
            matrices = np.ascontiguousarray(matrices)
            module.add_matrices(nodes, matrices, self.indptr, self.indices, data)
        else:
            n = nodes.astype(np.int64)
            places = np.searchsorted(self._keys, n[:, :, None] * self.n_nodes + n[:, None, :])
            _add_blocks(data, places, matrices)


def _pattern(n_nodes: int, connectivity: Sequence[Rows]) -> tuple[Rows, Rows]:
    """Return rows (indptr, indices) of the nodes that share an element."""
    from scipy.sparse import csr_array, hstack

    incident = []
    for nodes in connectivity:
        m, k = nodes.shape
        pointer = np.arange(0, m * k + 1, k)
        # booleans, as the product only asks whether two nodes share an element, however many
        ones = np.ones(m * k, dtype=bool)
        incident.append(csr_array((ones, nodes.ravel(), pointer), shape=(m, n_nodes)).T)
    incidence = hstack(incident, format="csr", dtype=bool)
    graph = (incidence @ incidence.T).tocsr()
    graph.sort_indices()
    return graph.indptr.astype(np.int32), graph.indices.astype(np.int32)


class PatternCache:
    """The last pattern made, for as long as the connectivity stays the same."""

    def __init__(self) -> None:
        self._key: tuple[int, ...] = ()
        self._pattern: Pattern | None = None

    def get(self, n_nodes: int, connectivity: Sequence[Rows]) -> Pattern:
        """Return the pattern of this connectivity, made anew only if it differs from the last."""
        key = (n_nodes, *(hash((nodes.shape, nodes.tobytes())) for nodes in connectivity))
        if self._pattern is None or key != self._key:
            self._key, self._pattern = key, Pattern(n_nodes, connectivity)
        return self._pattern


def _add_blocks(data: Array, positions: Ints, matrices: Array) -> None:
    """Add element matrices to node blocks `data`; see `Pattern.add`."""
    from scipy.sparse import csc_array

    low, high = int(positions.min()), int(positions.max()) + 1
    flat = positions.ravel() - low
    # the matrix that takes each block to its place, by columns: a product adds one block after the other
    selection = csc_array((np.ones(len(flat)), flat, np.arange(len(flat) + 1)), shape=(high - low, len(flat)))
    total = np.asarray(selection @ matrices.reshape(len(flat), -1))
    data[low:high] += total.reshape(data[low:high].shape)


def dofs_of(nodes: Ints) -> Ints:
    """Return the degrees of freedom (3k,) of nodes (k,): 3·node + axis."""
    return np.asarray((3 * nodes[:, None] + np.arange(3)).ravel())
