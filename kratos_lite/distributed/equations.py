"""Equations of a part: own rows of T^T K T in PETSc, and the iteration or factorization that solves them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.distributed.communicator import Alone, Ranks
from kratos_lite.distributed.cut import Dependents, Part
from kratos_lite.distributed.krylov import Krylov, options_of
from kratos_lite.distributed.petsc import LIVE, petsc, plain_errors
from kratos_lite.distributed.stiffness import SharedStiffness
from kratos_lite.errors import SolveError
from kratos_lite.native import kernels
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.solvers.plan import Plan
from kratos_lite.typing import Array, Progress

CURE = (
    "look for thin elements, nearly free parts or plain elements with ν near 0.5 "
    "(formulation='non_locking' takes others), or ask for solver='direct'"
)
"""What helps where an iteration fails."""
CURE_OF_FACTORS = "look for nearly free parts or a large stiffness contrast, or take more memory"
"""What helps where a factorization fails."""


@dataclass(frozen=True)
class Method:
    """How equations are solved."""

    name: str  # direct or amg
    options: Mapping[str, str | None]  # of PETSc, by the user
    constrained: bool  # whether any rank has dependent degrees of freedom
    most: int  # iterations

    @property
    def takes_own_multigrid(self) -> bool:
        """Whether our multigrid preconditions, in a third of the time of PETSc's: without constraints."""
        is_free = not self.constrained and "pc_type" not in self.options
        return self.name == "amg" and is_free and kernels("multigrid") is not None


class Outcome(NamedTuple):
    """How equations were solved: by what, in how many iterations, how well, or why not."""

    name: str
    iterations: int
    error: float
    failure: str
    unused: list[str]  # options that PETSc has not used

    def solution(self, x: Array, plan: Plan) -> tuple[Solution, list[str]]:
        """Return the solution x and what is to be said of it; SolveError if it was not found."""
        if self.failure:
            raise SolveError(f"{self.failure}; {CURE if plan.iterates else CURE_OF_FACTORS}")
        words = " ".join(f"-{option}" for option in self.unused)
        notes = [f"PETSc has not used these options: {words}; they may be misspelt"] if words else []
        return Solution(x, self.name, plan.reason, self.iterations, self.error), notes


class Equations:
    """The equations of a part; all ranks make them and call each method."""

    def __init__(self, ranks: Alone, part: Part, method: Method, progress: Progress | None = None) -> None:
        self.ranks, self._progress = ranks, progress
        self._A: Any = None
        self._solver: Any = None
        LIVE.add(self)
        own = method.takes_own_multigrid
        K = SharedStiffness(ranks, part, progress, own_rows=not own)
        self.norm = K.norm()  # largest row sum of |K| at nodes with equations
        options = options_of(method.name, method.options, not own)
        with plain_errors():
            self._A = self._product(K) if own else self._matrix(K, part)
            self._solver = Krylov(self._A, options, method.options, method.most)
            if own:
                preconditioner = self._solver.ksp.getPC()
                preconditioner.setType("python")
                preconditioner.setPythonContext(_Cycle(K))

    def _product(self, K: SharedStiffness) -> Any:
        """Return a matrix of PETSc that multiplies by K."""
        PETSc, sizes = petsc(), ((K.own, None), (K.own, None))
        A = PETSc.Mat().createPython(sizes, _Product(K), comm=communicator(K.ranks))
        A.setUp()
        A.setOption(PETSc.Mat.Option.SPD, True)
        return A

    def _matrix(self, K: SharedStiffness, part: Part) -> Any:
        """Return T^T K T as a matrix of PETSc; that of K goes."""
        A = petsc_matrix(K)
        del K.K
        if self.ranks.sum(len(part.dependents[0])):
            A = eliminated(A, part.dependents)
        add_rigid_modes(A, K)
        return A

    def solve(self, forces: Array, tolerance: float, start: Array | None = None) -> tuple[Array, Outcome]:
        """Solve for the free degrees of freedom of own nodes."""
        with plain_errors():
            b, x = self._A.createVecLeft(), self._A.createVecLeft()
            b.setArray(forces.ravel())
            if start is not None:
                x.setArray(start.ravel())
            given = tolerance, self.norm, self._progress, start is not None
            count, error, failure = self._solver.solve(b, x, *given)
            found = x.getArray().reshape(-1, 3).copy()
            b.destroy()
            x.destroy()
        return found, Outcome(self._solver.name, count, error, failure, self._solver.unused())

    def destroy(self) -> None:
        """Release matrix and solver; all ranks call it at the same time, as PETSc asks for."""
        for held in (self._solver, self._A):
            if held is not None:
                held.destroy()
        LIVE.discard(self)

    def keep(self) -> None:
        """Leave matrix and solver to the end of the process."""
        for held in (self._solver and self._solver.ksp, self._A):
            if held is not None:
                held.incRef()


class _Product:
    """K x, as PETSc calls it."""

    def __init__(self, K: SharedStiffness) -> None:
        self.K = K

    def mult(self, matrix: Any, x: Any, y: Any) -> None:
        y.setArray(_safely(self.K, self.K.times, x.getArray(readonly=True)))


class _Cycle:
    """One V-cycle of the own multigrid, as PETSc calls it; it is made when the solver is set up."""

    def __init__(self, K: SharedStiffness) -> None:
        self.K = K
        self.multigrid: Any = None

    def setUp(self, preconditioner: Any) -> None:
        if self.multigrid is None:
            self.multigrid = _safely(self.K, self.K.multigrid)

    def apply(self, preconditioner: Any, x: Any, y: Any) -> None:
        y.setArray(_safely(self.K, self.multigrid.precondition, x.getArray(readonly=True)))


def _safely(K: SharedStiffness, call: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a call returns; an error ends all ranks, as the others wait for this one in an exchange."""
    try:
        return call(*arguments)
    except Exception as error:
        if isinstance(K.ranks, Ranks):
            K.ranks.abort(error)
        raise


# ---- own rows of the stiffness matrix in PETSc, without dependents, and its rigid-body modes ---------------

# Every element at an own node is on this rank, so that assembly sends nothing.


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
    columns = K.number[matrix.indices].astype(np.int32)  # PETSc omits those of nodes without equations, -1
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
