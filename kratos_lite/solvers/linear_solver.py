"""LinearSolver: one matrix with its supports, solved for many right sides by a method chosen for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.matrix_free import MatrixFree
from kratos_lite.errors import SolveError
from kratos_lite.solvers import direct
from kratos_lite.solvers.constraints import ConstraintMap
from kratos_lite.solvers.iteration import Monitor, conjugate_gradients
from kratos_lite.solvers.plan import Plan, after, is_quick_to_factorize, tolerance_of
from kratos_lite.typing import Array, Ints, Progress

if TYPE_CHECKING:
    from kratos_lite.assembly.element_groups import ElementGroup
    from kratos_lite.mesh.hanging import HangingNodes
    from kratos_lite.solvers.coarse_level import PCoarseLevel
    from kratos_lite.solvers.multigrid import Solver

WIDE, MOST_MEANS = 100, 24
"""Independents of a dependent that is a mean over a part, and how many such are treated by themselves."""
RESTART, MAX_RESTARTS = 30, 20
"""Iterations of GMRES after which it starts anew, and how often."""


@dataclass(frozen=True)
class Solution:
    """The solution of A x = b and how it was computed."""

    x: Array  # (n,) float
    method: str  # ``dense``, ``direct``, ``amg`` or ``displacement-pressure``, and why
    reason: str
    iterations: int  # 0 for a factorization
    backward_error: float  # |b - A x| / (|A| |x| + |b|) in the maximum norm


@dataclass(eq=False)
class LinearSolver:
    """K u = f + reactions with u = T q + c, solved as T^T K T q = T^T (f - K c); what it prepares is kept."""

    K: Any  # full for ``dense``, split for ``displacement-pressure``, else blocks or a product; (3n, 3n) N/m
    constraint_map: ConstraintMap  # the supports
    points: Array  # (n, 3) m, from which multigrid knows the rigid modes
    plan: Plan  # how it is solved
    symmetric: bool = True  # positive definite, too
    near: LinearSolver | None = None  # of a matrix not far from K, symmetric: its multigrid serves K, too
    groups: Sequence[ElementGroup] = ()  # with `hanging`: quadratic elements, whose linear ones are a level
    hanging: HangingNodes | None = None
    springs: Any = None  # (3n, 3n) N/m, what K has beside the groups, or None
    mass: Array | None = None  # of nodes (n,), where K is K + M of the groups

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: what a method has prepared lives outside of Python, and is made anew."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def solve(
        self,
        f: Array,
        tolerance: float,
        progress: Progress | None = None,
        prescribed: Array | None = None,
        start: Array | None = None,
        reduction: float = 0.0,
    ) -> Solution:
        """Return the displacements (3n,) under nodal forces f (3n,) as a Solution.

        `prescribed` displacements (3n,) take the place of c of the constraint map.  An iteration begins at
        `start` (3n,), of which the free components count, if that is nearer than 0.  With a `reduction` it
        ends where the residual is this fraction of that of 0 or the start, whichever is less; if K is
        symmetric, it begins at the multiple of the start that is nearest, and the residual does no work on
        the solution.  The backward error is not computed then: NaN.
        """
        reduce, expand = self.constraint_map.reduce, self.constraint_map.expand
        c = self.constraint_map.c if prescribed is None else prescribed
        u, b = c, reduce(f - self.K @ c if c.any() else f)
        whole, size = b, float(np.linalg.norm(b))
        norm = size
        aim = tolerance * self._fraction(f, c, size) * size
        if start is not None and self.plan.iterates:
            near = (start - c)[self.constraint_map.free]
            image = reduce(self.K @ self.constraint_map.transform(near))
            if reduction:
                aim = reduction * min(size, float(np.linalg.norm(b - image)))
            energy = float(near @ image)
            scale = float(near @ b) / energy if reduction and self.symmetric and energy > 0 else 1.0
            near, residual = expand(scale * near, c), b - scale * image
            if float(np.linalg.norm(residual)) <= size:
                u, b, norm = near, residual, float(np.linalg.norm(residual))
            if u is near or reduction:
                rounding = 2 * float(np.finfo(float).eps)
                aim = max(aim, rounding * (self.norm * float(np.linalg.norm(near)) + size))
        tolerance = aim / (norm or 1.0)
        q, iterations, plan = np.zeros(len(b)), 0, self.plan
        if len(b) and (u is c or tolerance < 1):
            q, iterations, plan = self._solve(b, tolerance, progress, u is not c or reduction > 0)
        begun, u = u - c, expand(q, u)
        if reduction and self.symmetric and begun.any():
            # The scale of x with r·x = 0, as from 0: a residual without work, so that steps keep energy.
            free = self.constraint_map.free
            of_load, of_r = (u - c)[free] @ whole, begun[free] @ b - q @ (whole - b)
            u = c + (u - c) * (of_load / (of_load - of_r) if of_load > of_r else 1.0)
        error = np.nan if reduction else backward_error(reduce(f - self.K @ u), self.norm, u, f)
        return Solution(u, plan.method, plan.reason, iterations, error)

    def times(self, u: Array) -> Array:
        """Return K u of several vectors (k, N)."""
        if isinstance(self.K, BlockMatrix | MatrixFree):
            return self.K.times(u)
        return np.stack([self.K @ each for each in u])

    def precondition(self, r: Array) -> Array:
        """Return about K⁻¹ r of all components (k, N), 0 where they are not free: a cycle, or a solution.

        The residuals r are 0 there, too.
        """
        free = self.constraint_map.free
        if not self.plan.iterates:
            out = np.zeros_like(r)
            out[:, free] = self.factors.rows(r[:, free])
            return out
        if self._without_means is not None:
            return self._without_means.precondition(r)
        out = self._multigrid.precondition(r)
        out[:, self.constraint_map.constrained] = 0.0
        return out

    def linear_level(self) -> tuple[LinearSolver, PCoarseLevel] | None:
        """Return the equations of the linear elements inside quadratic ones, where multigrid has them."""
        if self.plan.method != "amg" or self._without_means is not None:
            return None
        multigrid: Any = self._multigrid
        linear: PCoarseLevel | None = getattr(multigrid, "linear", None)
        if linear is None or linear.weights.ndim > 1:
            return None
        constraints = self.constraint_map.at(linear.nodes)
        below = LinearSolver(linear.K, constraints, self.points[linear.nodes], self.plan)
        vars(below)["_multigrid"] = multigrid.below()
        return below, linear

    def _fraction(self, f: Array, c: Array, size: float) -> float:
        """Return the fraction of |b|, a `size`, that tolerances refer to."""
        # Where prescribed displacements of nearly incompressible bodies are large forces in K, these are no
        # measure of what has to be in equilibrium: the bulk modulus does not count.
        soft = getattr(self.K, "A", None)
        if soft is None or not c.any():
            return 1.0
        return min(1.0, float(np.linalg.norm(self.constraint_map.reduce(f - soft @ c))) / (size or 1.0))

    def _solve(
        self, b: Array, tolerance: float, progress: Progress | None, continued: bool
    ) -> tuple[Array, int, Plan]:
        """Return q, iterations, and how it is solved: in another way if iterations did not converge."""
        plan = self.plan
        if plan.iterates:
            q, iterations, plan = self._iterate(b, tolerance, progress, continued)
            if plan.iterates:
                return q, iterations, plan
        return self._prepared("factors", "factorize", progress).solve(b), 0, plan

    def _prepared(self, name: str, phase: str, progress: Progress | None) -> Any:
        """Return what a method prepares, and report a phase if it is made now."""
        if progress is None or name in vars(self):
            return getattr(self, name)
        progress(phase, 0.0)
        prepared = getattr(self, name)
        progress(phase, 1.0)
        return prepared

    @cached_property
    def reduced_matrix(self) -> Any:
        """The reduced matrix: a full array for the method ``dense``, else CSR."""
        T, free = self.constraint_map.T, self.constraint_map.free
        if self.plan.method != "dense":
            return self.constraint_map.reduce_matrix(self.K.scipy().tocsr())
        return self.K[np.ix_(free, free)] if T is None else T.T @ self.K @ T

    @cached_property
    def factors(self) -> direct.Factorization:
        """The reduced matrix factorized."""
        if self.plan.method == "dense":
            return direct.factorize_dense(self.reduced_matrix)
        return direct.factorize(self.reduced_matrix, self.symmetric)

    @cached_property
    def _blocks(self) -> Any:
        """The matrix on all components, constraints worked in, of which only the free ones count."""
        T, free = self.constraint_map.T, self.constraint_map.free
        if T is None:
            return self.K
        if isinstance(self.K, BlockMatrix):
            return constrained(self.K, T, free)
        if isinstance(self.K, MatrixFree):
            return self.K.tie(on_all(T, free))
        D = (self.K.D.tocsr() @ on_all(T, free)).tobsr(self.K.D.blocksize)
        return replace(self.K, A=constrained(self.K.A, T, free), D=D)

    @cached_property
    def _without_means(self) -> LinearSolver | None:
        """What holds the dependents of means: their rows of T join all nodes of a part, and spoil cycles."""
        # Beside it the reduced matrix has two other eigenvalues for each row: as many further iterations.
        map, T = self.constraint_map, self.constraint_map.T
        if T is None or not self.symmetric or self.plan.method != "amg":
            return None
        wide = np.diff(T.indptr) >= WIDE
        if not 0 < wide.sum() <= MOST_MEANS:
            return None
        rest = T.multiply(~wide[:, None]).tocsr()
        rest.eliminate_zeros()
        held = replace(map, T=None if rest.nnz == len(map.free) else rest)
        return replace(self, constraint_map=held, near=None)

    @cached_property
    def _multigrid(self) -> Solver:
        from kratos_lite.solvers.coarse_level import apply_ties, p_coarse_level  # a quick start

        linear, map = p_coarse_level(self.points, self.groups, self.hanging), self.constraint_map
        if linear is not None and self.springs is not None:
            linear = linear.with_springs(self.springs)
        if linear is not None and self.mass is not None:
            linear = linear.with_mass(self.mass)
        if linear is not None and map.T is not None:
            linear = apply_ties(linear, map.T, map.free)
        make: Any
        if self.plan.method == "amg":
            from kratos_lite.solvers.multigrid import multigrid as make
        else:
            from kratos_lite.solvers.displacement_pressure import DisplacementPressure as make
        return make(self._blocks, map.is_free, self.points, linear)

    @cached_property
    def norm(self) -> float:
        """The largest row sum of |K|."""
        return float(np.abs(self.K).sum(axis=1).max() if self.plan.method == "dense" else self.K.norm())

    def _iterate(
        self, b: Array, tolerance: float, progress: Progress | None, continued: bool
    ) -> tuple[Array, int, Plan]:
        """Solve by multigrid; return q, iterations, and how to solve it instead if they do not converge."""
        free, rhs = self.constraint_map.free, np.zeros(len(self.constraint_map.c))
        rhs[free] = b
        aim = tolerance if continued else tolerance_of(tolerance, len(b))
        if (near := self.near or self._without_means) is not None:
            q, iterations, good = self._by_near(b, aim if self.near is None else tolerance, near, progress)
            if good:
                return q, iterations, self.plan
            self.near = None  # not near enough
        multigrid = self._prepared("_multigrid", "set up", progress)
        norm = self.norm if self._blocks is self.K else self._blocks.norm()
        monitor = Monitor(tolerance, progress, is_quick_to_factorize(len(b)))
        x, iterations, converged = multigrid.solve(rhs, aim, norm, monitor)
        if not converged:
            return x[free], iterations, after(iterations, tolerance, len(b), monitor.is_slow)
        monitor.finish()
        return x[free], iterations, self.plan

    def _by_near(
        self, b: Array, tolerance: float, near: LinearSolver, progress: Progress | None
    ) -> tuple[Array, int, bool]:
        """Return q, iterations and success with the multigrid of `near`; GMRES where K is not symmetric."""
        constraints, iterations = self.constraint_map, 0

        def times(q: Array) -> Array:
            nonlocal iterations
            iterations += 1
            return constraints.reduce(self.K @ constraints.transform(q))

        def precondition(r: Array) -> Array:
            whole = np.zeros((1, len(constraints.c)))
            whole[0, constraints.free] = r
            return near.precondition(whole)[0, constraints.free]

        if self.symmetric:
            monitor = Monitor(tolerance, progress, is_quick_to_factorize(len(b)))
            return conjugate_gradients(times, b, precondition, tolerance, self.norm, monitor)
        from scipy.sparse.linalg import LinearOperator, gmres

        A, M = (LinearOperator((len(b), len(b)), matvec=f, dtype=float) for f in (times, precondition))
        q, failed = gmres(A, b, rtol=tolerance, atol=0.0, restart=RESTART, maxiter=MAX_RESTARTS, M=M)
        if failed:
            raise SolveError(
                f"equations that are not symmetric were not solved to {tolerance:g} in {iterations} "
                "iterations; take smaller steps"
            )
        return q, iterations, True


def constrained(K: BlockMatrix, T: Any, free: Ints) -> BlockMatrix:
    """Return T^T K T in the numbering of all components, in 3x3 blocks; u = T q with q = u[free]."""
    # With dependents u_d = W u it is K + W^T K_d + K_d^T W + W^T K_dd W: only rows near dependents change.
    # Rows and columns of components that are not free mean nothing.
    from scipy.sparse import bsr_array, csr_array

    full = on_all(T, free)
    dependents = np.flatnonzero((np.diff(full.indptr) > 0) & (full.diagonal() == 0))
    entries = full[dependents].tocoo()
    nodes, row = np.unique(dependents // 3, return_inverse=True)
    d, n = len(nodes), K.shape[0] // 3
    at = 3 * row[entries.row] + dependents[entries.row] % 3, entries.col
    W = csr_array((entries.data, at), shape=(3 * d, 3 * n)).tobsr((3, 3))
    blocks = np.broadcast_to(np.eye(3), (d, 3, 3))
    select = bsr_array((blocks, nodes, np.arange(d + 1)), shape=(3 * d, 3 * n))
    A = K.scipy()
    K_d = select @ A
    half = W.T @ (K_d + 0.5 * (K_d @ select.T @ W))
    half.sort_indices()
    change = half + half.T
    change.sort_indices()  # sums of sorted rows are made three times as fast
    tied = BlockMatrix.of(A + change)
    tied.ties = K, full
    return tied


def on_all(T: Any, free: Ints) -> Any:
    """Return T (N, q) with its columns in the places of the free components, (N, N)."""
    from scipy.sparse import csr_array

    return csr_array((T.data, free[T.indices], T.indptr), shape=(T.shape[0], T.shape[0]))


def backward_error(residual: Array, norm: float, x: Array, b: Array) -> float:
    """Return |b - A x| / (|A| |x| + |b|) in the maximum norm."""
    scale = norm * np.abs(x).max() + np.abs(b).max()
    return float(np.abs(residual).max(initial=0.0) / scale) if scale > 0 else 0.0
