"""Own rows of the stiffness matrix as a matrix of PETSc, and its rigid-body modes.

Every element at an own node is on this rank, so that assembly sends nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.distributed.communicator import Alone
from kratos_lite.distributed.petsc import petsc
from kratos_lite.solvers.constraint_map import rigid_modes
from kratos_lite.typing import Array, Ints, Mask, Rows

BLOCKS_AT_ONCE = 500_000
"""Blocks that are copied at once: 50 MB, little beside a matrix for which memory counts."""


def communicator(ranks: Alone) -> Any:
    """Return the communicator of ranks for PETSc; that of this process alone if it has the whole mesh."""
    return getattr(ranks, "comm", None) or petsc().COMM_SELF


def petsc_matrix(ranks: Alone, K: BlockMatrix, rows: Ints, number: Ints, held: Mask) -> Any:
    """Return the rows of own nodes of K, without what is held, as a matrix in single entries (AIJ).

    Rows and columns of held degrees of freedom are 0 but for their own diagonal: the matrix stays
    symmetric and positive definite, and its blocks whole, as multigrid of PETSc needs them.  Multigrid
    (GAMG) takes no blocks (BAIJ), but single entries with a block size.
    """
    PETSc = petsc()
    A = PETSc.Mat().create(communicator(ranks))
    A.setSizes(((3 * len(rows), None),) * 2, bsize=3)
    A.setType(PETSc.Mat.Type.AIJ)
    counts = _counts(K, rows, number)
    A.setPreallocationNNZ(tuple(np.repeat(3 * one, 3).astype(np.int32) for one in counts))
    # without rows, PETSc does not see that room was made, and would wait for the others in assembly
    A.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
    A.setOption(PETSc.Mat.Option.NO_OFF_PROC_ENTRIES, True)
    lengths = np.concatenate([[0], np.cumsum(np.diff(K.indptr)[rows])])
    start = 0
    while start < len(rows):
        stop = int(np.searchsorted(lengths, lengths[start] + BLOCKS_AT_ONCE, side="right")) - 1
        stop = max(stop, start + 1)
        some = rows[start:stop]
        pointers, columns, blocks = _blocks(K, some, number, held)
        A.setValuesBlockedIJV(pointers, columns, blocks, rowmap=number[some].astype(np.int32))
        start = stop
    A.assemble()
    A.setOption(PETSc.Mat.Option.SPD, True)
    return A


def _places(K: BlockMatrix, rows: Ints) -> Ints:
    """Return the places of the blocks of some rows, one row after the other."""
    counts = np.diff(K.indptr)[rows].astype(np.int64)
    ends = np.cumsum(counts)
    return np.arange(counts.sum()) + np.repeat(K.indptr[rows] - (ends - counts), counts)


def _counts(K: BlockMatrix, rows: Ints, number: Ints) -> tuple[Ints, Ints]:
    """Return how many blocks each row has in the columns of own nodes, and in those of others."""
    of_row = np.repeat(np.arange(len(rows)), np.diff(K.indptr)[rows])
    columns = K.indices[_places(K, rows)]
    own = np.zeros(len(number), dtype=bool)
    own[rows] = True
    inside = np.bincount(of_row[own[columns]], minlength=len(rows))
    outside = np.bincount(of_row[~own[columns] & (number[columns] >= 0)], minlength=len(rows))
    return inside, outside


def _blocks(K: BlockMatrix, rows: Ints, number: Ints, held: Mask) -> tuple[Rows, Rows, Array]:
    """Return the blocks of some rows as (indptr, columns, blocks), without what is held."""
    places = _places(K, rows)
    of_row = np.repeat(np.arange(len(rows)), np.diff(K.indptr)[rows])
    used = number[K.indices[places]] >= 0
    places, of_row = places[used], of_row[used]
    nodes, blocks = K.indices[places], K.data[places]
    here, there = held[rows[of_row]], held[nodes]
    touched = np.flatnonzero(here.any(axis=1) | there.any(axis=1))
    free = ~here[touched, :, None] & ~there[touched, None, :]
    own = (nodes[touched] == rows[of_row[touched]])[:, None, None] & np.eye(3, dtype=bool)
    blocks[touched] *= free | own
    pointers = np.concatenate([[0], np.cumsum(np.bincount(of_row, minlength=len(rows)))])
    return pointers.astype(np.int32), number[nodes].astype(np.int32), blocks


def add_rigid_modes(ranks: Alone, A: Any, points: Array, free: Mask) -> None:
    """Give a matrix the rigid-body modes of its own nodes, from which multigrid makes its coarse levels."""
    count = max(ranks.sum(len(points)), 1)
    modes = rigid_modes(points, ranks.sum(points.sum(axis=0)) / count) * free.reshape(-1, 1)
    sizes, axes = np.linalg.eigh(ranks.sum(modes.T @ modes))
    some = sizes > 1e-12 * sizes.max(initial=0.0)  # orthonormal, as PETSc wants them
    modes = modes @ (axes[:, some] / np.sqrt(sizes[some]))
    vectors = []
    for mode in modes.T:
        vectors.append(A.createVecLeft())
        vectors[-1].setArray(mode)
    near = petsc().NullSpace().create(vectors=vectors, comm=A.comm)
    A.setNearNullSpace(near)
    for one in (near, *vectors):
        one.destroy()


def largest_row_sum(K: BlockMatrix, rows: Ints) -> float:
    """Return the largest row sum of |K| at some nodes."""
    largest = 0.0
    for some in np.array_split(rows, max(1, len(rows) // 20_000)):
        lengths = np.diff(K.indptr)[some]
        if len(some):
            sums = np.abs(K.data[_places(K, some)]).sum(axis=2)
            starts = np.concatenate([[0], np.cumsum(lengths)[:-1]])[lengths > 0]
            largest = max(largest, float(np.add.reduceat(sums, starts, axis=0).max(initial=0.0)))
    return largest


def transformation(A: Any, dependents: Mapping[int, Mapping[int, float]]) -> Any:
    """Return T of u = T q, as a matrix of PETSc: 1 on its diagonal, but for the dependents."""
    first, last = A.getOwnershipRange()
    lengths = np.ones(last - first, dtype=np.int32)
    for row, terms in dependents.items():
        lengths[row - first] = len(terms)
    pointers = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
    columns, weights = np.zeros(pointers[-1], dtype=np.int32), np.ones(pointers[-1])
    plain = np.ones(last - first, dtype=bool)
    plain[[row - first for row in dependents]] = False
    columns[pointers[:-1][plain]] = first + np.flatnonzero(plain)
    for row, terms in dependents.items():
        at = slice(pointers[row - first], pointers[row - first + 1])
        columns[at], weights[at] = sorted(terms), [terms[one] for one in sorted(terms)]
    size = (A.getSizes()[0], A.getSizes()[1])
    return petsc().Mat().createAIJ(size, bsize=3, csr=(pointers, columns, weights), comm=A.comm)


def eliminated(A: Any, T: Any, dependents: Ints) -> Any:
    """Return T^T A T, with the diagonal of A at the dependents, its own rows; A is destroyed."""
    PETSc = petsc()
    diagonal = A.getDiagonal()
    first, last = A.getOwnershipRange()
    lengths = np.zeros(last - first, dtype=np.int32)
    lengths[dependents - first] = 1
    pointers = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
    at = np.sort(dependents)
    entries = (pointers, at.astype(np.int32), diagonal.getArray()[at - first])
    left = PETSc.Mat().createAIJ(A.getSizes(), bsize=3, csr=entries, comm=A.comm)
    reduced = A.ptap(T)
    reduced.axpy(1.0, left, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    reduced.setBlockSize(3)
    reduced.setOption(PETSc.Mat.Option.SPD, True)
    for one in (diagonal, left, A):
        one.destroy()
    return reduced
