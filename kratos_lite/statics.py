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
from kratos_lite.assembly import Progress, assemble_dense, assemble_stiffness
from kratos_lite.batches import Batch
from kratos_lite.errors import InputError, ModelError, SolveError
from kratos_lite.fields import internal_load
from kratos_lite.loads import check_loads
from kratos_lite.result import Report, Result, peak_memory
from kratos_lite.solvers.common import DENSE_MAX
from kratos_lite.supports import reduction

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
    if method == "dense" and len(f) > DENSE_MAX:
        raise InputError(f"solver='dense' is for up to {DENSE_MAX} degrees of freedom; got {len(f)}")
    with phase("assemble"):
        K: Any
        if method == "dense":
            K = assemble_dense(points, local)
        else:
            pattern = model.patterns.get(len(points), [batch.nodes for batch in local])
            K = assemble_stiffness(points, local, pattern, progress)
    with phase("solve"):
        equations = solvers.Equations(K, reduced, points, method, reason)
        solution = equations.solve(f, tolerance, progress)
    with phase("verify"):
        u, reactions = recover(model, active, solution.x, K, f)
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
