"""The global matrix: a sparse matrix of 3x3 blocks, one row of blocks for each node."""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.native import kernels
from kratos_lite.typing import Array, Bsr, Csr, Ints, Rows


def block_rows(indptr: Rows) -> Ints:
    """Return the row of each block of rows that start at indptr (n + 1,), as (nnz,)."""
    return np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))


def dependent_rows(T: Any) -> tuple[Rows, Rows, Rows, Array]:
    """Return the dependents of u = T u (3n, 3n), and their rows as indptr, indices and weights."""
    dependents = np.flatnonzero((np.diff(T.indptr) > 0) & (T.diagonal() == 0)).astype(np.int32)
    rows = T[dependents]
    return dependents, rows.indptr.astype(np.int32), rows.indices.astype(np.int32), rows.data


class BlockMatrix:
    """A square matrix (3n, 3n) of 3x3 blocks in rows (BSR), columns sorted within a row."""

    ties: tuple[BlockMatrix, Any] | None = None
    """K and T (3n, 3n), if this is T^T K T."""

    def __init__(self, data: Array, indices: Rows, indptr: Rows) -> None:
        self.data, self.indices, self.indptr = data, indices, indptr

    @classmethod
    def of(cls, A: Any) -> BlockMatrix:
        """Return a sparse matrix of SciPy (3n, 3n) in blocks."""
        A = A.tobsr((3, 3))
        A.sort_indices()
        return cls(np.ascontiguousarray(A.data), A.indices.astype(np.int32), A.indptr.astype(np.int32))

    @property
    def shape(self) -> tuple[int, int]:
        """The number of rows and columns, counted in single numbers."""
        n = 3 * (len(self.indptr) - 1)
        return n, n

    def __matmul__(self, x: Array) -> Array:
        """Return A x of a vector (3n,)."""
        return self.times(x) if x.ndim == 1 else self.scipy() @ x

    def times(self, x: Array) -> Array:
        """Return A x of a vector (3n,), or of several (k, 3n), which read the matrix together."""
        compiled = kernels("sparse")
        if compiled is None:
            return np.asarray((self.scipy() @ x.T).T)
        x = np.ascontiguousarray(x, dtype=float)
        return compiled.multiply(self.indptr, self.indices, self.data, x)

    def scipy(self) -> Bsr:
        """Return the matrix as a scipy.sparse.bsr_array on the same memory."""
        from scipy.sparse import bsr_array

        return bsr_array((self.data, self.indices, self.indptr), shape=self.shape)

    def rows(self) -> Ints:
        """Return the row of each block, (nnz,)."""
        return block_rows(self.indptr)

    def diagonal_blocks(self) -> Ints:
        """Return the place in `data` of the diagonal block of each row, (n,)."""
        return np.flatnonzero(self.rows() == self.indices)

    def norm(self) -> float:
        """Return the largest row sum of |A|."""
        compiled = kernels("sparse")
        if compiled is not None:
            return float(compiled.norm(self.indptr, self.data))
        return float(np.asarray(abs(self.scipy()).sum(axis=1)).max(initial=0.0))

    def add_scalar(self, m: Array, at: Ints | None = None) -> None:
        """Add numbers to the diagonals of blocks: A += m 1, in place."""
        diagonals = self.data.reshape(-1, 9)[:, ::4]
        if at is None:
            diagonals += m[:, None]
        else:
            diagonals[at] += m[:, None]


def rows_of_numbers(A: BlockMatrix | Csr) -> Csr:
    """Return a matrix as CSR (3n, 3n): of blocks, moved in place, or of numbers for all three components."""
    from scipy.sparse import csr_array, eye_array, kron

    compiled = kernels("sparse")
    if compiled is None or max(3 * len(A.indices), A.data.size) > np.iinfo(np.int32).max:
        return A.scipy().tocsr() if isinstance(A, BlockMatrix) else kron(A, eye_array(3), "csr")
    indptr, indices, data = compiled.rows_of_numbers(A.indptr, A.indices, A.data)
    return csr_array((data.ravel(), indices, indptr), shape=(len(indptr) - 1,) * 2)


def times_numbers(A: Csr, v: Array) -> Array:
    """Return A v, alike for all three components, of a nodal vector (3n,), or of several (k, 3n)."""
    compiled = kernels("sparse")
    vectors = np.ascontiguousarray(v).reshape(-1, 3 * A.shape[0])
    if compiled is not None:
        return np.asarray(compiled.multiply(A.indptr, A.indices, A.data, vectors).reshape(v.shape))
    nodal = np.moveaxis(vectors.reshape(len(vectors), -1, 3), 0, 2)
    product = (A @ nodal.reshape(len(nodal), -1)).reshape(nodal.shape)
    return np.asarray(np.moveaxis(product, 2, 0).reshape(v.shape))
