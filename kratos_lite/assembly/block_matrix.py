"""The global matrix: a sparse matrix of 3x3 blocks, one row of blocks for each node."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kratos_lite.native import kernels
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from scipy.sparse import bsr_array

Ints = NDArray[np.int32]


class BlockMatrix:
    """A square matrix (3n, 3n) of 3x3 blocks in rows (BSR), columns sorted within a row.

    It needs no sparse library as long as it is only multiplied; `scipy` gives the same matrix, on
    the same memory, to those that factorize or slice.

    Attributes
    ----------
    data : (nnz, 3, 3) float.
    indices : (nnz,) int32, column of each block.
    indptr : (n + 1,) int32, where the blocks of each row start.

    Examples
    --------
    >>> import numpy as np
    >>> A = BlockMatrix(2.0 * np.eye(3)[None], np.zeros(1, np.int32), np.array([0, 1], np.int32))
    >>> A @ np.array([1.0, 2.0, 3.0])
    array([2., 4., 6.])
    """

    def __init__(self, data: Array, indices: Ints, indptr: Ints) -> None:
        self.data, self.indices, self.indptr = data, indices, indptr

    @property
    def shape(self) -> tuple[int, int]:
        """The number of rows and columns, counted in single numbers."""
        n = 3 * (len(self.indptr) - 1)
        return n, n

    def __matmul__(self, x: Array) -> Array:
        """Return A x of a vector (3n,)."""
        compiled = kernels("sparse")
        if compiled is None or x.ndim != 1:
            return np.asarray(self.scipy() @ x)
        x = np.ascontiguousarray(x, dtype=float)
        return np.asarray(compiled.multiply(self.indptr, self.indices, self.data, x))

    def scipy(self) -> bsr_array:
        """Return the matrix as a scipy.sparse.bsr_array on the same memory."""
        from scipy.sparse import bsr_array

        return bsr_array((self.data, self.indices, self.indptr), shape=self.shape)

    def rows(self) -> Ints:
        """Return the row of each block, (nnz,)."""
        return np.repeat(np.arange(len(self.indptr) - 1, dtype=np.int32), np.diff(self.indptr))

    def diagonal_blocks(self) -> NDArray[np.int64]:
        """Return the place in `data` of the diagonal block of each row, (n,)."""
        return np.flatnonzero(self.rows() == self.indices)

    def norm(self) -> float:
        """Return the largest row sum of |A|."""
        compiled = kernels("sparse")
        if compiled is not None:
            return float(compiled.norm(self.indptr, self.data))
        if not len(self.indices):
            return 0.0
        sums = np.abs(self.data).sum(axis=2)
        starts = self.indptr[:-1][np.diff(self.indptr) > 0]
        return float(np.add.reduceat(sums, starts, axis=0).max(initial=0.0))


@dataclass(eq=False)
class LinearLevel:
    """The linear elements inside a mesh of quadratic ones, as the coarse level of a p-multigrid.

    Attributes
    ----------
    K : (3m, 3m) stiffness matrix of the linear elements on the corner nodes.
    nodes : (m,) int, row among all n nodes of each corner node.
    indptr, indices, weights : interpolation (n, m) from corner nodes to all nodes in rows (CSR).
    """

    K: BlockMatrix
    nodes: NDArray[np.int64]
    indptr: Ints
    indices: Ints
    weights: Array
