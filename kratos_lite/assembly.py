"""Assembly: element matrices into one sparse matrix of 3x3 node blocks.

The sparsity pattern is made from the node graph, once for each connectivity; element matrices are computed in
cache-sized chunks and added at known positions.  Neither all element matrices nor a triplet
list of the whole model ever exists.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from kratos_lite.batches import Batch
from kratos_lite.blockmatrix import BlockMatrix

Array = NDArray[np.float64]
SCATTER_BYTES = 64_000_000
"""Memory of the element matrices that are added to the global matrix at once."""
Progress = Callable[[str, float], None]
"""Called with the name of a phase and the share that is done, 0 … 1."""


class Pattern:
    """Sparsity of the node graph in rows of node blocks, with the place of every element entry.

    Parameters
    ----------
    n_nodes : number of nodes.
    connectivity : (m, k) node rows of each group of elements.
    """

    def __init__(self, n_nodes: int, connectivity: Sequence[NDArray[np.int32]]) -> None:
        from scipy.sparse import csr_array, hstack

        groups = []
        for nodes in connectivity:
            m, k = nodes.shape
            pointer = np.arange(0, m * k + 1, k)
            # booleans, as the product only asks whether two nodes share an element, however many
            ones = np.ones(m * k, dtype=bool)
            groups.append(csr_array((ones, nodes.ravel(), pointer), shape=(m, n_nodes)).T)
        incidence = hstack(groups, format="csr", dtype=bool)
        graph = (incidence @ incidence.T).tocsr()
        graph.sort_indices()
        self.n_nodes = n_nodes
        self.indptr, self.indices = graph.indptr.astype(np.int32), graph.indices.astype(np.int32)
        rows = np.repeat(np.arange(n_nodes, dtype=np.int64), np.diff(self.indptr))
        keys = rows * n_nodes + self.indices
        self.positions = [self._find(keys, nodes) for nodes in connectivity]

    def _find(self, keys: NDArray[np.int64], nodes: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the position of each node pair of each element, (m, k, k)."""
        m, k = nodes.shape
        found = np.zeros((m, k, k), dtype=np.int32)
        step = max(1, 1_000_000 // (k * k))
        for start in range(0, m, step):
            n = nodes[start : start + step].astype(np.int64)
            wanted = n[:, :, None] * self.n_nodes + n[:, None, :]
            place = np.searchsorted(keys, wanted)
            if (keys[np.minimum(place, len(keys) - 1)] != wanted).any():
                raise AssertionError("the sparsity pattern misses a pair of nodes that share an element")
            found[start : start + step] = place
        return found


class PatternCache:
    """The last pattern made, for as long as the connectivity stays the same."""

    def __init__(self) -> None:
        self._key: tuple[int, ...] = ()
        self._pattern: Pattern | None = None

    def get(self, n_nodes: int, connectivity: Sequence[NDArray[np.int32]]) -> Pattern:
        """Return the pattern of this connectivity, made anew only if it differs from the last."""
        key = (n_nodes, *(hash((nodes.shape, nodes.tobytes())) for nodes in connectivity))
        if self._pattern is None or key != self._key:
            self._key, self._pattern = key, Pattern(n_nodes, connectivity)
        return self._pattern


def _add_blocks(data: Array, positions: NDArray[np.int32], matrices: Array) -> None:
    """Add element matrices (m, 3, k, 3, k) to node blocks `data` (nnz, 3, 3)."""
    low, high = int(positions.min()), int(positions.max()) + 1
    flat = positions.ravel() - low
    for i in range(3):
        for j in range(3):
            weights = matrices[:, i, :, j, :].ravel()
            data[low:high, i, j] += np.bincount(flat, weights=weights, minlength=high - low)


def assemble_stiffness(
    points: Array, batches: Sequence[Batch], pattern: Pattern, progress: Progress | None = None
) -> BlockMatrix:
    """Return the stiffness matrix as 3x3 blocks, (3n, 3n) in N/m."""
    data = np.zeros((len(pattern.indices), 3, 3))
    done, total = 0, sum(len(batch) for batch in batches)
    for batch, positions in zip(batches, pattern.positions, strict=True):
        k = batch.nodes.shape[1]
        for window in batch.chunks(SCATTER_BYTES):
            matrices = np.zeros((window.stop - window.start, 3, k, 3, k))
            for chunk in batch.chunks(within=window):
                place = slice(chunk.start - window.start, chunk.stop - window.start)
                matrices[place] = batch.at(points, chunk).stiffness_by_axis(batch.material.C)
            _add_blocks(data, positions[window], matrices)
            done += len(matrices)
            if progress:
                progress("assemble", done / total)
    return BlockMatrix(data, pattern.indices, pattern.indptr)


def assemble_dense(points: Array, batches: Sequence[Batch]) -> Array:
    """Return the stiffness matrix of a small model as a full (3n, 3n) array in N/m."""
    n = 3 * len(points)
    K = np.zeros(n * n)
    for batch in batches:
        for chunk in batch.chunks():
            dofs = 3 * batch.nodes[chunk].astype(np.int64)[:, None, :] + np.arange(3)[:, None]
            dofs = dofs.reshape(len(dofs), -1)
            places = (dofs[:, :, None] * n + dofs[:, None, :]).ravel()
            matrices = batch.at(points, chunk).stiffness_by_axis(batch.material.C)
            K += np.bincount(places, weights=matrices.ravel(), minlength=n * n)
    return K.reshape(n, n)
