"""LinearSolver: one matrix with its supports, solved for many right sides."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.errors import SolveError
from kratos_lite.solvers import direct, multigrid
from kratos_lite.solvers.coarse_level import LinearLevel
from kratos_lite.solvers.common import DIRECT_LIMIT, Solution, backward_error
from kratos_lite.solvers.supports import ConstraintMap
from kratos_lite.typing import Array, Progress

FALLBACK_LIMIT = 150_000
"""Up to this many unknowns a factorization is tried when the iteration fails."""
SUPERLU_LIMIT = 30_000
"""Up to this many unknowns SuperLU factorizes in less time than a slow iteration takes."""
PATIENCE, PATIENCE_FROM = 400, 60
"""Iterations that take as long as a factorization, and those that show a rate."""
ROUND_OFF = 1e-15
"""Tolerance that the iteration cannot reach: it stops at what round-off allows."""


class Outlook:
    """Tells from the residuals so far, as shares of the first, whether an iteration is worth going on with.

    It is not when, after 60 iterations, their rate promises more than `PATIENCE` in all.  The rate is
    that between the last two quarters, each the mean of its logarithms: residuals grow at first and jump.

    Attributes
    ----------
    stopped : whether it has said so.

    Examples
    --------
    >>> fast, slow = Outlook(1e-8), Outlook(1e-8)
    >>> all(fast(0.9**k) for k in range(150)), [slow(0.99**k) for k in range(100)].index(False)
    (True, 59)
    """

    def __init__(self, tolerance: float) -> None:
        self.tolerance, self.stopped = tolerance, False
        self._logs: list[float] = []

    def __call__(self, residual: float) -> bool:
        """Take the next residual; return whether to go on."""
        self._logs.append(math.log(max(residual, 1e-300)))
        done, left = len(self._logs), self._logs[-1] - math.log(self.tolerance)
        if done < PATIENCE_FROM or left <= 0:
            return True
        quarter = done // 4
        before, now = self._logs[-2 * quarter : -quarter], self._logs[-quarter:]
        rate = (math.fsum(before) - math.fsum(now)) / quarter**2
        self.stopped = (PATIENCE - done) * rate < left
        return not self.stopped


@dataclass(eq=False)
class LinearSolver:
    """K u = f + reactions with u = T q + c, solved as T^T K T q = T^T (f - K c).

    Attributes
    ----------
    K : full array for the method ``dense``, else blocks; (3n, 3n) in N/m.
    reduced : the supports.
    points : (n, 3) m, from which multigrid knows the rigid modes.
    method, reason : as `choose` gives them.
    linear_level : makes the linear elements within quadratic ones, for multigrid.
    symmetric : whether K is symmetric positive definite; otherwise the method is ``dense`` or ``direct``.

    What a method prepares (the reduced matrix, its factors, the multigrid hierarchy) is made once and kept.
    """

    K: Any
    reduced: ConstraintMap
    points: Array
    method: str
    reason: str
    linear_level: Callable[[], LinearLevel | None] | None = None
    symmetric: bool = True

    def solve(self, f: Array, tolerance: float, progress: Progress | None = None) -> Solution:
        """Return the displacements (3n,) under nodal forces f (3n,) as a Solution.

        Raises
        ------
        SolveError
            If the matrix is singular, or the iteration stalls where no factorization fits.
        """
        b = self.reduced.reduce(f - self.K @ self.reduced.c)
        solution = self._solve(b, tolerance, progress) if len(b) else Solution(b, self.method, "", 0, 0.0)
        if not solution.reason:
            solution = replace(solution, reason=self.reason)
        return replace(solution, x=self.reduced.expand(solution.x))

    def _solve(self, b: Array, tolerance: float, progress: Progress | None) -> Solution:
        if self.method == "dense":
            q = self.factors.solve(b)
            return Solution(q, "dense", "", 0, backward_error(self._full, q, b))
        why = ""
        if self.method == "amg":
            solution = self._iterate(b, tolerance, progress)
            if not solution.reason:
                return solution
            why = solution.reason
            if len(b) > FALLBACK_LIMIT:
                raise SolveError(
                    f"{why}; {len(b)} unknowns are too many to factorize instead; look for thin elements or "
                    "ν near 0.5, use quadratic elements, or ask for solver='direct'"
                )
        q = self.factors.solve(b)
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
        return self.reduced.restrict(self.K.scipy().tocsr())

    @cached_property
    def factors(self) -> direct.Factorization:
        """The reduced matrix factorized."""
        return (
            direct.factorize_dense(self._full)
            if self.method == "dense"
            else direct.factorize(self._sparse, self.symmetric)
        )

    @cached_property
    def _blocks(self) -> BlockMatrix:
        """The matrix on all components in 3x3 blocks, links worked in; only its free components count."""
        T = self.reduced.T
        return self.K if T is None else linked(self.K, T, self.reduced.free)

    @cached_property
    def _free(self) -> NDArray[np.bool_]:
        free = np.zeros(len(self.reduced.c), dtype=bool)
        free[self.reduced.free] = True
        return free

    @cached_property
    def _multigrid(self) -> multigrid.Solver:
        linear = self.linear_level() if self.linear_level else None
        return multigrid.multigrid(self._blocks, self._free, self.points, linear)

    @cached_property
    def _norm(self) -> float:
        return self._blocks.norm()

    def _iterate(self, b: Array, tolerance: float, progress: Progress | None) -> Solution:
        """Solve by multigrid; a solution with a reason is one that did not converge, and why."""
        free, rhs = self.reduced.free, np.zeros(len(self._free))
        rhs[free] = b
        # On few unknowns some iterations more, to round-off, make it as exact as a factorization.
        aim = min(tolerance, ROUND_OFF) if len(b) <= DIRECT_LIMIT else tolerance
        outlook = Outlook(tolerance) if quick_to_factorize(len(b)) else None
        x, iterations, converged = self._multigrid.solve(rhs, aim, self._norm, progress, outlook)
        q, scale = x[free], self._norm * np.abs(x).max() + np.abs(b).max()
        error = float(np.abs(b - (self._blocks @ x)[free]).max() / scale) if scale > 0 else 0.0
        stopped = f"multigrid stopped after {iterations} iterations short of {tolerance:g}"
        if outlook and outlook.stopped:
            stopped += f", at a rate that takes more than {PATIENCE}: a factorization is faster"
        return Solution(q, "amg", "" if converged else stopped, iterations, error)


def quick_to_factorize(unknowns: int) -> bool:
    """Tell whether a factorization takes less time than some hundred iterations.

    >>> quick_to_factorize(FALLBACK_LIMIT + 1)
    False
    """
    return unknowns <= (FALLBACK_LIMIT if find_spec("pypardiso") else SUPERLU_LIMIT)


def linked(K: BlockMatrix, T: Any, free: NDArray[np.int64]) -> BlockMatrix:
    """Return T^T K T in the numbering of all components, in 3x3 blocks; u = T q with q = u[free]."""
    from scipy.sparse import csr_array

    n = K.shape[0]
    spread = csr_array((np.ones(len(free)), (np.arange(len(free)), free)), shape=(len(free), n))
    whole = T @ spread
    A = (whole.T @ K.scipy().tocsr() @ whole).tobsr((3, 3))
    A.sort_indices()
    return BlockMatrix(np.ascontiguousarray(A.data), A.indices.astype(np.int32), A.indptr.astype(np.int32))
