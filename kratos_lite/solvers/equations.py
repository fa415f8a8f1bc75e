"""Equations: one matrix with its supports, solved for many right sides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite.blockmatrix import BlockMatrix
from kratos_lite.errors import SolveError
from kratos_lite.solvers import direct, iteration, multigrid
from kratos_lite.solvers.common import Progress, Solution, backward_error, matrix_norm
from kratos_lite.supports import Reduction, rigid_modes

Array = NDArray[np.float64]

FALLBACK_LIMIT = 150_000
"""Up to this many unknowns a factorisation is tried when the iteration fails."""


@dataclass(eq=False)
class Equations:
    """K u = f + reactions with u = T q + c, solved as T^T K T q = T^T (f - K c).

    Attributes
    ----------
    K : full array for the method ``dense``, else blocks; (3n, 3n) in N/m.
    reduced : the supports.
    points : (n, 3) m, from which multigrid knows the rigid modes.
    method, reason : as `choose` gives them.

    What a method prepares (the reduced matrix, its factors, the multigrid hierarchy) is made once and kept.
    """

    K: Any
    reduced: Reduction
    points: Array
    method: str
    reason: str

    def solve(self, f: Array, tolerance: float, progress: Progress | None = None) -> Solution:
        """Return the displacements (3n,) under nodal forces f (3n,) as a Solution.

        Raises
        ------
        SolveError
            If the matrix is singular, or the iteration stalls where no factorisation fits.
        """
        b = self.reduced.reduce(f - self.K @ self.reduced.c)
        solution = self._solve(b, tolerance, progress) if len(b) else Solution(b, self.method, "", 0, 0.0)
        if not solution.reason:
            solution = replace(solution, reason=self.reason)
        return replace(solution, x=self.reduced.expand(solution.x))

    def _solve(self, b: Array, tolerance: float, progress: Progress | None) -> Solution:
        if self.method == "dense":
            q = self._factors.solve(b)
            return Solution(q, "dense", "", 0, backward_error(self._full, q, b))
        why = ""
        if self.method == "amg":
            solution = self._iterate(b, tolerance, progress)
            if not solution.reason:
                return solution
            why = solution.reason
            if len(b) > FALLBACK_LIMIT:
                raise SolveError(
                    f"{why}; {len(b)} unknowns are too many to factorise instead; look for thin elements or "
                    "ν near 0.5, use quadratic elements, or ask for solver='direct'"
                )
        q = self._factors.solve(b)
        return Solution(q, "direct", why, 0, backward_error(self._sparse, q, b))

    @cached_property
    def _full(self) -> Array:
        """The reduced matrix as a full array."""
        T = self.reduced.T
        if T is None:
            return np.asarray(self.K[np.ix_(self.reduced.free, self.reduced.free)])
        return np.asarray(T.T @ self.K @ T)

    @cached_property
    def _sparse(self) -> Any:
        """The reduced matrix as CSR."""
        A, free, T = self.K.scipy().tocsr(), self.reduced.free, self.reduced.T
        if T is not None:
            return (T.T @ A @ T).tocsr()
        return A if len(free) == A.shape[0] else A[free][:, free]

    @cached_property
    def _factors(self) -> direct.Factorisation:
        """The reduced matrix factorised."""
        return (
            direct.factorise_dense(self._full) if self.method == "dense" else direct.factorise(self._sparse)
        )

    @cached_property
    def _hierarchy(self) -> tuple[Any, Callable[[Array], Array], float]:
        """Matrix, multigrid cycle and norm; without links fixed components stay in, uncoupled."""
        modes = rigid_modes(self.points)
        if self.reduced.T is None:
            free = self._free
            A, modes = uncoupled(self.K, free), modes * free[:, None]
            return A, multigrid.multigrid(A.scipy(), modes), A.norm()
        B = self._sparse
        return B, multigrid.multigrid(B, modes[self.reduced.free]), matrix_norm(B)

    @cached_property
    def _free(self) -> NDArray[np.bool_]:
        free = np.zeros(len(self.reduced.c), dtype=bool)
        free[self.reduced.free] = True
        return free

    def _iterate(self, b: Array, tolerance: float, progress: Progress | None) -> Solution:
        """Solve by multigrid; a solution with a reason is one that did not converge, and why."""
        A, precondition, norm = self._hierarchy
        rhs = b
        if self.reduced.T is None:
            rhs = np.zeros(len(self._free))
            rhs[self.reduced.free] = b
        x, iterations, converged = iteration.conjugate_gradients(
            A, rhs, precondition, tolerance, norm, progress=progress
        )
        error = backward_error(A, x, rhs, norm)
        q = x[self.reduced.free] if self.reduced.T is None else x
        reason = (
            "" if converged else f"multigrid stopped after {iterations} iterations short of {tolerance:g}"
        )
        return Solution(q, "amg", reason, iterations, error)


def uncoupled(K: BlockMatrix, free: NDArray[np.bool_]) -> BlockMatrix:
    """Return a copy of K with the rows and columns of fixed degrees of freedom cleared.

    Their diagonal entries stay, so that the matrix keeps its scale.
    """
    mask = free.reshape(-1, 3)
    data = K.data * mask[K.rows()][:, :, None] * mask[K.indices][:, None, :]
    diagonal = K.diagonal_blocks()
    for axis in range(3):
        fixed = diagonal[~mask[:, axis]]
        data[fixed, axis, axis] = K.data[fixed, axis, axis]
    return BlockMatrix(data, K.indices, K.indptr)
