"""Statics: from a model to displacements in one linear solve."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite import checks, solvers
from kratos_lite.assembly import Progress, assemble_dense, assemble_stiffness, internal_load
from kratos_lite.batches import Batch
from kratos_lite.errors import InputError, ModelError, SolveError
from kratos_lite.loads import check_loads
from kratos_lite.result import Report, Result, peak_memory
from kratos_lite.supports import Reduction, reduction, rigid_modes

if TYPE_CHECKING:
    from kratos_lite.model import Model

Array = NDArray[np.float64]


class Phases:
    """Seconds spent in each named phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Measure the body of a ``with`` statement."""
        start = perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start


def solve_static(
    model: Model, solver: str = "auto", tolerance: float = 1e-10, progress: Progress | None = None
) -> Result:
    """Solve K u = f with the supports of a model eliminated; see `Model.solve`."""
    if isinstance(tolerance, bool) or not isinstance(tolerance, (float, int)) or not 0 < tolerance < 1:
        raise InputError(f"tolerance must be a number between 0 and 1; got {tolerance!r}")
    if progress is not None and not callable(progress):
        raise InputError(f"progress must be a function of a phase and a share; got {progress!r}")
    solvers.choose(solver, 0)
    phase = Phases()
    with phase("check"):
        batches, warnings = model.checked_batches()
    with phase("load"):
        loads = external_loads(model, batches)
        forces = loads - initial_loads(model, batches)
    active, local = renumber(model, batches, forces)
    warnings += check_loads(model.loads, batches, forces, model.supports)
    points = model.mesh.points[active]
    reduced = reduction(model.supports, active)
    f = forces[active].ravel()
    method, reason = solvers.choose(solver, len(reduced.free), len(f))
    if method == "dense" and len(f) > solvers.DENSE_MAX:
        raise InputError(f"solver='dense' is for up to {solvers.DENSE_MAX} degrees of freedom; got {len(f)}")
    with phase("assemble"):
        K: Any
        if method == "dense":
            K = assemble_dense(points, local)
        else:
            pattern = model.patterns.get(len(points), [batch.nodes for batch in local])
            K = assemble_stiffness(points, local, pattern, progress)
    with phase("solve"):
        solution = solve_reduced(K, f, reduced, method, tolerance, points, progress)
        if solution.method == method:
            solution = replace(solution, reason=reason)
    with phase("verify"):
        u, reactions = recover(model, active, reduced.expand(solution.x), K, f)
        noise = float(np.finfo(float).eps * solvers.matrix_norm(K) * np.abs(u).max(initial=0.0))
        balance = checks.equilibrium(model.mesh.points, loads, reactions, noise * len(f) ** 0.5)
        judge(solution, u, balance)
        warnings += checks.check_rounding(noise, loads, loads - forces, reactions, model.supports)
    report = Report(
        unknowns=len(reduced.free),
        total_load=loads.sum(axis=0),
        total_reaction=reactions.sum(axis=0),
        solver=solution.method,
        reason=solution.reason,
        iterations=solution.iterations,
        backward_error=solution.backward_error,
        force_error=balance[0],
        moment_error=balance[1],
        seconds=phase.seconds,
        peak_memory=peak_memory(),
        warnings=warnings,
        notes=list(model.notes),
    )
    return Result(model.mesh, batches, u, reactions, loads, report, model.initial_displacement)


def recover(
    model: Model, active: NDArray[np.int64], displacement: Array, K: Any, f: Array
) -> tuple[Array, Array]:
    """Return displacements and reactions (n, 3) of all nodes from those of the active ones."""
    u = np.where(model.supports.fixed, model.supports.values, 0.0)
    u[active] = displacement.reshape(-1, 3)
    residual = np.zeros_like(u)
    residual[active] = (K @ displacement - f).reshape(-1, 3)
    return u, np.where(constrained(model), residual, 0.0)


def judge(solution: solvers.Solution, u: Array, balance: tuple[float, float]) -> None:
    """Raise SolveError for a solution that does not solve its equations or is not in equilibrium."""
    if not np.isfinite(u).all() or solution.backward_error > 1e-8:
        raise SolveError(
            f"{solution.method} solver reached a backward error of {solution.backward_error:.1e} only; "
            "ask for a smaller tolerance, or look for very thin elements, very unlike stiffnesses or "
            "nearly free parts"
        )
    if max(balance) > 1e-2:
        raise SolveError(
            f"loads and reactions miss equilibrium by {balance[0]:.1e} (forces) and {balance[1]:.1e} "
            "(moments) of their size; look for very unlike stiffnesses, spurious modes or nearly free "
            "parts, and please report a model that has none"
        )


def external_loads(model: Model, batches: Sequence[Batch]) -> Array:
    """Return the nodal forces (n, 3) in N of all loads."""
    total = np.zeros_like(model.mesh.points)
    for load in model.loads:
        total += load.forces(model.mesh, batches)
    return total


def initial_loads(model: Model, batches: Sequence[Batch]) -> Array:
    """Return ∫ B^T (σ0 - C ε0) dV: what prestress and stress-free displacement put on the nodes."""
    u0 = model.initial_displacement
    if u0 is None and model.prestress is None:
        return np.zeros_like(model.mesh.points)
    start = np.zeros_like(model.mesh.points) if u0 is None else -u0
    return internal_load(model.mesh.points, batches, start)


def renumber(model: Model, batches: list[Batch], forces: Array) -> tuple[NDArray[np.int64], list[Batch]]:
    """Return the rows of the nodes that elements use, and the batches numbered by them."""
    mesh = model.mesh
    used = mesh.used_nodes()
    lost = np.flatnonzero(~used & (forces != 0).any(axis=1))
    if len(lost):
        raise ModelError(f"node {mesh.node_ids[lost[0]]} carries a load but belongs to no element")
    active = np.flatnonzero(used)
    if used.all():
        return active, batches
    local = (np.cumsum(used) - 1).astype(np.int32)
    return active, [replace(batch, nodes=local[batch.nodes]) for batch in batches]


def constrained(model: Model) -> NDArray[np.bool_]:
    """Return a mask (n, 3) of the degrees of freedom that carry reactions or constraint forces."""
    mask = model.supports.fixed.copy()
    for link in model.supports.links:
        mask.flat[[link.slave, *link.masters]] = True
    return mask


def solve_reduced(
    K: Any,
    f: Array,
    reduced: Reduction,
    method: str,
    tolerance: float,
    points: Array,
    progress: Progress | None = None,
) -> solvers.Solution:
    """Solve T^T K T q = T^T (f - K c); fall back from multigrid to a factorisation if need be."""
    b = reduced.reduce(f - K @ reduced.c)
    if not len(b):
        return solvers.Solution(b, method, "", 0, 0.0)
    if method == "dense":
        A = K[np.ix_(reduced.free, reduced.free)] if reduced.T is None else reduced.T.T @ K @ reduced.T
        A = np.asarray(A)
        q = solvers.solve_dense(A, b)
        return solvers.Solution(q, method, "", 0, solvers.backward_error(A, q, b))
    why = ""
    if method == "amg":
        solution = iterate(K, b, reduced, tolerance, points, progress)
        if not solution.reason:
            return solution
        why = solution.reason
        if len(b) > solvers.FALLBACK_LIMIT:
            raise SolveError(
                f"{why}; {len(b)} unknowns are too many to factorise instead; look for thin elements or "
                "ν near 0.5, use quadratic elements, or ask for solver='direct'"
            )
    A = reduced_matrix(K, reduced)
    q = solvers.solve_direct(A, b)
    return solvers.Solution(q, "direct", why, 0, solvers.backward_error(A, q, b))


def iterate(
    K: Any, b: Array, reduced: Reduction, tolerance: float, points: Array, progress: Progress | None
) -> solvers.Solution:
    """Solve by multigrid; a solution with a reason is one that did not converge, and why.

    Without links the fixed degrees of freedom stay in the matrix, uncoupled, so that it keeps its
    3x3 blocks.
    """
    modes = rigid_modes(points)
    if reduced.T is None:
        free = np.zeros(len(reduced.c), dtype=bool)
        free[reduced.free] = True
        A, modes = uncoupled(K, free), modes * free[:, None]
        rhs = np.zeros(len(free))
        rhs[reduced.free] = b
    else:
        A, modes, rhs = reduced_matrix(K, reduced), modes[reduced.free], b
    norm = solvers.matrix_norm(A)
    x, iterations, converged = solvers.conjugate_gradients(
        A, rhs, solvers.multigrid(A, modes), tolerance, norm, progress=progress
    )
    error = solvers.backward_error(A, x, rhs, norm)
    q = x[reduced.free] if reduced.T is None else x
    reason = "" if converged else f"multigrid stopped after {iterations} iterations short of {tolerance:g}"
    return solvers.Solution(q, "amg", reason, iterations, error)


def uncoupled(K: Any, free: NDArray[np.bool_]) -> Any:
    """Return a copy of K in 3x3 blocks with the rows and columns of fixed degrees of freedom cleared.

    Their diagonal entries stay, so that the matrix keeps its scale.
    """
    from scipy.sparse import bsr_array

    mask = free.reshape(-1, 3)
    rows = np.repeat(np.arange(len(mask)), np.diff(K.indptr))
    data = K.data * mask[rows][:, :, None] * mask[K.indices][:, None, :]
    diagonal = np.flatnonzero(rows == K.indices)
    for axis in range(3):
        fixed = diagonal[~mask[rows[diagonal], axis]]
        data[fixed, axis, axis] = K.data[fixed, axis, axis]
    return bsr_array((data, K.indices, K.indptr), shape=K.shape)


def reduced_matrix(K: Any, reduced: Reduction) -> Any:
    """Return T^T K T as CSR."""
    A = K.tocsr()
    if reduced.T is not None:
        return (reduced.T.T @ A @ reduced.T).tocsr()
    if len(reduced.free) == A.shape[0]:
        return A
    return A[reduced.free][:, reduced.free]
