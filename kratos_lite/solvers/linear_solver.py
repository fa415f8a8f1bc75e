"""LinearSolver: one matrix with its supports, solved for many right sides by a method chosen for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.errors import SolveError
from kratos_lite.native import kernels
from kratos_lite.solvers import direct
from kratos_lite.solvers.constraint_map import ConstraintMap
from kratos_lite.typing import Array, Ints, Mask, Progress
from kratos_lite.validation import choice

if TYPE_CHECKING:
    from kratos_lite.solvers.coarse_level import LinearLevel
    from kratos_lite.solvers.multigrid import Solver

DENSE_LIMIT = 600
"""Up to this many unknowns a full matrix needs no sparse library at all."""
COMPILED_DENSE_LIMIT = 60
"""Up to this many it is faster than compiled multigrid, which needs none either."""
DENSE_MAX = 10_000
"""Above this many degrees of freedom a full matrix is refused (it would take 0.8 GB several times)."""
DIRECT_LIMIT = 10_000
"""Up to this many unknowns factorizing is the fastest sparse way."""
METHODS = ("auto", "dense", "direct", "amg")
FALLBACK_LIMIT = 150_000
"""Up to this many unknowns a factorization is tried when the iteration fails."""
SUPERLU_LIMIT = 30_000
"""Up to this many unknowns SuperLU factorizes in less time than a slow iteration takes."""
ROUND_OFF = 1e-15
"""Tolerance that the iteration cannot reach: it stops at what round-off allows."""


@dataclass(frozen=True)
class Solution:
    """The solution of A x = b and how it was found.

    Attributes
    ----------
    x : (n,) float.
    method, reason : ``dense``, ``direct``, ``amg`` or ``displacement-pressure``, and why.
    iterations : 0 for a factorization.
    backward_error : |b - A x| / (|A| |x| + |b|) in the maximum norm.
    """

    x: Array
    method: str
    reason: str
    iterations: int
    backward_error: float


def choose(method: str, unknowns: int, dofs: int = 0, symmetric: bool = True) -> tuple[str, str]:
    """Return the method to use for `unknowns` free ones of `dofs`, and the reason in words.

    Raises
    ------
    InputError
        If there is no such method.

    Examples
    --------
    >>> choose("auto", 24)[0]
    'dense'
    """
    if choice(method, "solver", METHODS) != "auto":
        return method, "asked for"
    few = unknowns <= COMPILED_DENSE_LIMIT  # no kernel needs to be loaded
    compiled = not few and symmetric and kernels("multigrid") is not None
    limit = COMPILED_DENSE_LIMIT if few or compiled else DENSE_LIMIT
    if unknowns <= limit and dofs <= 4 * DENSE_LIMIT:
        return "dense", f"{unknowns} unknowns ≤ {limit}: a full matrix is fastest"
    if compiled:
        return "amg", f"{unknowns} unknowns > {limit}: multigrid is fastest and takes least memory"
    if unknowns <= DIRECT_LIMIT:
        return "direct", f"{unknowns} unknowns ≤ {DIRECT_LIMIT}: sparse factorization is fastest"
    if not symmetric:
        return "direct", "the matrix is not symmetric: conjugate gradients do not apply"
    return "amg", f"{unknowns} unknowns > {DIRECT_LIMIT}: multigrid is fastest and takes least memory"


@dataclass(eq=False)
class LinearSolver:
    """K u = f + reactions with u = T q + c, solved as T^T K T q = T^T (f - K c).

    Attributes
    ----------
    K : full array for the method ``dense``, else blocks, or split for ``amg``; (3n, 3n) in N/m.
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

    def solve(
        self,
        f: Array,
        tolerance: float,
        progress: Progress | None = None,
        prescribed: Array | None = None,
        start: Array | None = None,
    ) -> Solution:
        """Return the displacements (3n,) under nodal forces f (3n,) as a Solution.

        `prescribed` displacements (3n,) take the place of c of the constraint map.  An iteration begins at
        `start` (3n,), of which the free components count, if that is nearer than 0.

        Raises
        ------
        SolveError
            If the matrix is singular, or the iteration stalls where no factorization fits.
        """
        c = self.reduced.c if prescribed is None else prescribed
        b = self.reduced.reduce(f - self.K @ c)
        tolerance *= self._share(f, c, b)
        if start is not None and self.method == "amg":
            near = self.reduced.expand((start - c)[self.reduced.free], c)
            left = self.reduced.reduce(f - self.K @ near)
            size = float(np.linalg.norm(b))
            if np.linalg.norm(left) <= size:
                return self._continue(f, near, left, size, tolerance, progress)
        solution = self._solve(b, tolerance, progress) if len(b) else Solution(b, self.method, "", 0, 0.0)
        if not solution.reason:
            solution = replace(solution, reason=self.reason)
        return replace(solution, x=self.reduced.expand(solution.x, c))

    def _share(self, f: Array, c: Array, b: Array) -> float:
        """Return the share of |b| that tolerances refer to.

        Where prescribed displacements of nearly incompressible bodies are large forces in K, these are no
        measure of what has to be in equilibrium: the bulk modulus is left out.
        """
        soft = getattr(self.K, "A", None)
        if soft is None or not c.any():
            return 1.0
        size = float(np.linalg.norm(self.reduced.reduce(f - soft @ c)))
        return min(1.0, size / (float(np.linalg.norm(b)) or 1.0))

    def _continue(
        self, f: Array, near: Array, left: Array, size: float, tolerance: float, progress: Progress | None
    ) -> Solution:
        """Solve for what the displacements `near` leave of the load, whose norm is `size`."""
        rest, rounding = float(np.linalg.norm(left)), 2 * float(np.finfo(float).eps)
        aim = max(tolerance * size, rounding * (self.norm * float(np.linalg.norm(near)) + size))
        found = Solution(np.zeros(len(left)), *self._iteration, 0, 0.0)
        if rest > aim:
            found = self._solve(left, aim / rest, progress, continued=True)
        u = self.reduced.expand(found.x, near)
        off, scale = self.reduced.reduce(f - self.K @ u), self.norm * np.abs(u).max() + np.abs(f).max()
        error = float(np.abs(off).max() / scale) if scale > 0 else 0.0
        return replace(found, x=u, backward_error=error)

    def _solve(
        self, b: Array, tolerance: float, progress: Progress | None, continued: bool = False
    ) -> Solution:
        if self.method == "dense":
            q = self._made("factors", "factorize", progress).solve(b)
            return Solution(q, "dense", "", 0, backward_error(self._full, q, b))
        why = ""
        if self.method == "amg":
            solution, why = self._iterate(b, tolerance, progress, continued)
            if not why:
                return solution
            if len(b) > FALLBACK_LIMIT:
                raise SolveError(
                    f"{why}; {len(b)} unknowns are too many to factorize instead; look for thin elements, "
                    "for plain ones with ν near 0.5 (formulation='non_locking' takes others), or ask for "
                    "solver='direct'"
                )
        q = self._made("factors", "factorize", progress).solve(b)
        return Solution(q, "direct", why, 0, backward_error(self._sparse, q, b))

    def _made(self, name: str, phase: str, progress: Progress | None) -> Any:
        """Return what a method prepares, and report a phase if it is made now."""
        if progress is None or name in vars(self):
            return getattr(self, name)
        progress(phase, 0.0)
        made = getattr(self, name)
        progress(phase, 1.0)
        return made

    @cached_property
    def _full(self) -> Array:
        """The reduced matrix as a full array."""
        T = self.reduced.T
        if T is None:
            return self.K[np.ix_(self.reduced.free, self.reduced.free)]
        return T.T @ self.K @ T

    @cached_property
    def _sparse(self) -> Any:
        """The reduced matrix as CSR."""
        return self.reduced.reduce_matrix(self.K.scipy().tocsr())

    @cached_property
    def factors(self) -> direct.Factorization:
        """The reduced matrix factorized."""
        return (
            direct.factorize_dense(self._full)
            if self.method == "dense"
            else direct.factorize(self._sparse, self.symmetric)
        )

    @cached_property
    def _blocks(self) -> Any:
        """The matrix on all components, constraints worked in, of which only the free ones count.

        It is a BlockMatrix, a MatrixFree or a SplitMatrix, as K is.
        """
        T, free = self.reduced.T, self.reduced.free
        if T is None:
            return self.K
        if isinstance(self.K, BlockMatrix):
            return constrained(self.K, T, free)
        D = (self.K.D.tocsr() @ on_all(T, free)).tobsr(self.K.D.blocksize)
        return replace(self.K, A=constrained(self.K.A, T, free), D=D)

    @cached_property
    def _free(self) -> Mask:
        free = np.zeros(len(self.reduced.c), dtype=bool)
        free[self.reduced.free] = True
        return free

    @cached_property
    def _multigrid(self) -> Solver:
        linear, matrix = self.linear_level() if self.linear_level else None, self._blocks
        if linear is not None and self.reduced.T is not None:
            from kratos_lite.solvers.coarse_level import tied  # rarely needed

            linear = tied(linear, self.reduced.T, self.reduced.free)
        if not matrix.is_split:
            from kratos_lite.solvers.multigrid import multigrid  # a quick start for small models

            return multigrid(matrix, self._free, self.points, linear)
        from kratos_lite.solvers.displacement_pressure import DisplacementPressure  # rarely needed

        return DisplacementPressure(matrix, self._free, self.points, linear)

    @property
    def _iteration(self) -> tuple[str, str]:
        """The method that iterates, and the reason for it."""
        if not self.K.is_split:
            return "amg", self.reason
        from kratos_lite.solvers.dilatation import REASON  # rarely needed

        return "displacement-pressure", REASON

    @cached_property
    def norm(self) -> float:
        """The largest row sum of |K|."""
        return matrix_norm(self.K)

    @cached_property
    def _norm(self) -> float:
        return self.norm if self._blocks is self.K else self._blocks.norm()

    def _iterate(
        self, b: Array, tolerance: float, progress: Progress | None, continued: bool
    ) -> tuple[Solution, str]:
        """Solve by multigrid; return also why it did not converge, or "" where it did."""
        from kratos_lite.solvers.iteration import PATIENCE, ConvergenceForecast  # as for multigrid

        free, rhs = self.reduced.free, np.zeros(len(self._free))
        rhs[free] = b
        # On few unknowns some iterations more, to round-off, make it as exact as a factorization.
        exact = len(b) <= DIRECT_LIMIT and not continued
        aim = min(tolerance, ROUND_OFF) if exact else tolerance
        forecast = ConvergenceForecast(tolerance) if quick_to_factorize(len(b)) else None
        hierarchy = self._made("_multigrid", "set up", progress)
        x, iterations, converged = hierarchy.solve(rhs, aim, self._norm, progress, forecast)
        q, scale = x[free], self._norm * np.abs(x).max() + np.abs(b).max()
        error = float(np.abs(b - (self._blocks @ x)[free]).max() / scale) if scale > 0 else 0.0
        stopped = f"multigrid stopped after {iterations} iterations short of {tolerance:g}"
        if forecast and forecast.stopped:
            stopped += f", at a rate that takes more than {PATIENCE}: a factorization is faster"
        return Solution(q, *self._iteration, iterations, error), "" if converged else stopped


def quick_to_factorize(unknowns: int) -> bool:
    """Return whether a factorization takes less time than some hundred iterations.

    >>> quick_to_factorize(FALLBACK_LIMIT + 1)
    False
    """
    from importlib.util import find_spec  # a quick start for small models

    return unknowns <= (FALLBACK_LIMIT if find_spec("pypardiso") else SUPERLU_LIMIT)


def constrained(K: BlockMatrix, T: Any, free: Ints) -> BlockMatrix:
    """Return T^T K T in the numbering of all components, in 3x3 blocks; u = T q with q = u[free]."""
    full = on_all(T, free)
    A = (full.T @ K.scipy().tocsr() @ full).tobsr((3, 3))
    A.sort_indices()
    return BlockMatrix(np.ascontiguousarray(A.data), A.indices.astype(np.int32), A.indptr.astype(np.int32))


def on_all(T: Any, free: Ints) -> Any:
    """Return T (N, q) with its columns in the places of the free components, (N, N)."""
    from scipy.sparse import csr_array

    q = len(free)
    return T @ csr_array((np.ones(q), (np.arange(q), free)), shape=(q, T.shape[0]))


def matrix_norm(A: Any) -> float:
    """Return the largest row sum of |A|."""
    if hasattr(A, "norm"):  # blocks, split or not, or a product alone
        return float(A.norm())
    return float(np.asarray(abs(A).sum(axis=1)).max(initial=0.0))


def backward_error(A: Any, x: Array, b: Array) -> float:
    """Return |b - A x| / (|A| |x| + |b|) in the maximum norm."""
    scale = matrix_norm(A) * np.abs(x).max() + np.abs(b).max()
    return float(np.abs(b - A @ x).max() / scale) if scale > 0 else 0.0
