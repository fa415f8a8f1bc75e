"""Own rows of the stiffness matrix as a matrix of PETSc, without dependents, and its rigid-body modes.

Every element at an own node is on this rank, so that assembly sends nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.distributed.communicator import Alone
from kratos_lite.distributed.cut import Dependents
from kratos_lite.distributed.petsc import petsc
from kratos_lite.distributed.stiffness import SharedStiffness


def communicator(ranks: Alone) -> Any:
    """Return the communicator of ranks for PETSc; that of this process alone if it has the whole mesh."""
    return getattr(ranks, "comm", None) or petsc().COMM_SELF


def petsc_matrix(K: SharedStiffness) -> Any:
    """Return own rows without what is held as a matrix in single entries (AIJ); those of K change."""
    # Rows and columns of held degrees of freedom are 0 but for their own diagonal: the matrix stays symmetric
    # and positive definite, and its blocks whole, as multigrid of PETSc needs them. Multigrid (GAMG) takes no
    # blocks (BAIJ), but single entries with a block size.
    PETSc, matrix, own = petsc(), K.K, K.ghosts.own
    assert isinstance(matrix, BlockMatrix)
    A = PETSc.Mat().create(communicator(K.ranks))
    A.setSizes(((3 * own, None),) * 2, bsize=3)
    A.setType(PETSc.Mat.Type.AIJ)
    row, is_own = matrix.rows(), matrix.indices < own
    is_ghost = ~is_own & (K.number[matrix.indices] >= 0)
    counts = (np.bincount(row[chosen], minlength=own) for chosen in (is_own, is_ghost))
    A.setPreallocationNNZ(tuple(np.repeat(3 * count, 3).astype(np.int32) for count in counts))
    # without rows, PETSc does not see that room was made, and would wait for the others in assembly
    A.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
    A.setOption(PETSc.Mat.Option.NO_OFF_PROC_ENTRIES, True)
    touched = np.flatnonzero(K.held[row].any(axis=1) | K.held[matrix.indices].any(axis=1))
    i, j = row[touched], matrix.indices[touched]
    free = ~K.held[i][:, :, None] & ~K.held[j][:, None, :]
    matrix.data[touched] *= free | ((i == j)[:, None, None] & np.eye(3, dtype=bool))
    columns = K.number[matrix.indices].astype(
        np.int32
    )  # PETSc leaves out those of nodes without equations, -1
    A.setValuesBlockedIJV(matrix.indptr, columns, matrix.data, rowmap=K.number[:own].astype(np.int32))
    A.assemble()
    A.setOption(PETSc.Mat.Option.SPD, True)
    return A


def add_rigid_modes(A: Any, K: SharedStiffness) -> None:
    """Give a matrix the rigid-body modes of its own nodes, from which multigrid makes its coarse levels."""
    own = K.ghosts.own
    modes = K.modes(K.points[:own], K.free[:own]).reshape(-1, 6)
    sizes, axes = np.linalg.eigh(K.ranks.sum(modes.T @ modes))
    some = sizes > 1e-12 * sizes.max(initial=0.0)  # orthonormal, as PETSc wants them
    modes = modes @ (axes[:, some] / np.sqrt(sizes[some]))
    vectors = []
    for mode in modes.T:
        vectors.append(A.createVecLeft())
        vectors[-1].setArray(mode)
    near = petsc().NullSpace().create(vectors=vectors, comm=A.comm)
    A.setNearNullSpace(near)
    for kept in (near, *vectors):
        kept.destroy()


def eliminated(A: Any, dependents: Dependents) -> Any:
    """Return T^T A T of u = T q, with the diagonal of A at the dependents, its own rows; A is destroyed."""
    PETSc = petsc()
    first, last = A.getOwnershipRange()
    rows = dependents[0]
    T, left = _transformation(A, dependents), A.getDiagonal()
    values = np.zeros(last - first)
    values[rows - first] = left.getArray()[rows - first]
    every = np.arange(last - first + 1, dtype=np.int32)
    diagonal = PETSc.Mat().createAIJ(
        A.getSizes(), bsize=3, csr=(every, first + every[:-1], values), comm=A.comm
    )
    reduced = A.ptap(T)
    reduced.axpy(1.0, diagonal, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    reduced.setBlockSize(3)
    reduced.setOption(PETSc.Mat.Option.SPD, True)
    for used in (left, diagonal, T, A):
        used.destroy()
    return reduced


def _transformation(A: Any, dependents: Dependents) -> Any:
    """Return T as a matrix of PETSc: 1 on its diagonal, but for the dependents."""
    from scipy.sparse import csr_array

    first, last = A.getOwnershipRange()
    rows, columns, weights = dependents
    plain = np.setdiff1d(np.arange(first, last), rows)
    entries = np.append(rows, plain) - first, np.append(columns, plain)
    shape = (last - first, A.getSize()[1])
    T = csr_array((np.append(weights, np.ones(len(plain))), entries), shape=shape)
    pointers, columns = T.indptr.astype(np.int32), T.indices.astype(np.int32)
    return petsc().Mat().createAIJ(A.getSizes(), bsize=3, csr=(pointers, columns, T.data), comm=A.comm)
