"""Static analysis of a mesh in parts, one for each process, which solves an ordinary model of its part."""

from __future__ import annotations

from collections import Counter
from operator import itemgetter

import numpy as np

from kratos_lite.analysis.nodal_loads import external_loads, initial_loads, stress_load
from kratos_lite.analysis.report import element_counts
from kratos_lite.analysis.result import Result, result_of
from kratos_lite.analysis.solution_checks import Phases, check_arguments, check_solution
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.distributed.partition import Partition
from kratos_lite.distributed.petsc_system import PartSystem
from kratos_lite.errors import ModelError
from kratos_lite.model import checks
from kratos_lite.model.loads import Load, ScaledLoad
from kratos_lite.model.loads.nodal import NodalForces, PointLoad
from kratos_lite.model.loads.temperature import Temperature
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constraints import rigid_modes
from kratos_lite.typing import Array, Mask, Progress

FREE = 1e-12
"""Smallest to largest eigenvalue of what supports do to rigid-body modes, up to which one is free."""


class PartResult(Result):
    """The result of one part; what its table and report say holds for all parts together."""

    partition: Partition

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of the summary, the same in all parts; all of them ask for it."""
        partition, counts = self.partition, Counter[str]()
        for some in partition.gather(element_counts(self.mesh, self.groups, self.report.formulation)):
            counts.update(some)
        displacement, mises = (
            max(partition.gather(largest), key=itemgetter(0))
            for largest in (self.largest_displacement(), self.largest_von_mises())
        )
        extremes = displacement, partition.sum(self.energy()), mises
        return self._summary((int(partition.offsets[-1]), counts), extremes)


def solve_part(
    model: Structure,
    partition: Partition,
    solver: str = "auto",
    tolerance: float = 1e-10,
    progress: Progress | None = None,
    petsc: str | None = None,
) -> PartResult:
    """Solve a model of which each process has a part; all of them call it.

    Each element is checked; of the whole it is checked that supports leave no rigid-body mode free, and that
    the solution is in equilibrium.

    Parameters
    ----------
    model : of the part of this process: its mesh, with what supports and loads it has.
    partition : how the parts meet.
    solver, tolerance, progress, petsc : as for `Model.solve`.

    Returns
    -------
    PartResult

    Raises
    ------
    MeshError, ModelError, InputError
        A part is broken, supports leave rigid-body modes free, or the model has what needs the whole mesh:
        constraints, a motion, a point load at a place without node.
    SolveError
        If the accuracy requested cannot be reached.
    """
    mesh, own = model.mesh, partition.own
    phase = Phases(progress if partition.rank == 0 else None)
    with partition.agree_on_errors():
        check_arguments(solver, tolerance)
        model.require_linear("a mesh in parts")
        with phase("check"):
            groups, warnings = _checked(model)
        with phase("load"):
            forces = _forces(model, groups, partition.own)
            initial = initial_loads(model, groups)
    held = np.asarray(partition.add(model.supports.fixed.astype(float)) > 0)
    values = np.asarray(partition.fetch(model.supports.values))
    external = np.asarray(partition.add(forces))
    loads = external if initial is None else external - partition.add(initial)
    with partition.agree_on_errors():
        _check_supports(partition, mesh.points, held & own[:, None])
    with phase("assemble"):
        system = PartSystem(mesh.points, groups, partition, held, solver, tolerance, petsc, phase.progress)
    try:
        with phase("solve"):
            u, solution = system.solve(loads, np.where(held, values, 0.0))
    finally:
        system.destroy()
    with phase("verify"):
        inner = np.asarray(partition.add(stress_load(model, groups, u)))
        reactions = np.where(held, inner - external, 0.0)
        total = own[:, None] * (external + reactions - inner)
        size = partition.sum(float(np.abs(own[:, None] * np.stack([external, reactions])).sum()))
        off = partition.sum(float(np.abs(total).sum())) / size if size else 0.0
        check_solution(solution, u, (off, 0.0))
        work = partition.sum(checks.work_of(u[own], inner[own], external[own], reactions[own]))
        system.warnings += [] if initial is not None else checks.check_energy(work)
    found = [text for some in partition.gather(warnings) for text in some]
    warnings = [*dict.fromkeys(found), *system.warnings]
    known = {"unknowns": system.unknowns, "seconds": phase.seconds, "warnings": warnings}
    fields = u, reactions, external
    result = result_of(PartResult, None, model, groups, fields, solution, (off, 0.0), **known)
    report = result.report
    report.total_load, report.total_reaction = (
        partition.sum(f[own].sum(axis=0)) for f in (external, reactions)
    )
    report.notes = list(dict.fromkeys(text for some in partition.gather(report.notes) for text in some))
    result.partition = partition
    return result


def _checked(model: Structure) -> tuple[list[ElementGroup], list[str]]:
    """Return elements and warnings of a part whose elements are sound; refuse what needs the whole mesh."""
    if len(model.supports.constraints) or model.motion is not None or model.mesh.hanging is not None:
        raise ModelError(
            "constraints, hanging nodes and motions need the whole mesh on one process; solve it by "
            "`kratos-lite solve` from one file"
        )
    warnings = model.check_geometry()
    groups = model.element_groups()
    if any(isinstance(one, Temperature) for load in model.loads for _, one in load.acting(0.0)):
        raise ModelError("temperatures need the whole mesh on one process; solve it there")
    if any(group.element.spurious_modes for group in groups):
        raise ModelError("whether reduced integration leaves elements free is found in a whole mesh alone")
    return groups, warnings


def _forces(model: Structure, groups: list[ElementGroup], own: Mask) -> Array:
    """Return what the loads put on the nodes of a part (n, 3), to be summed over parts."""
    total = np.zeros_like(model.mesh.points)
    for shared in (True, False):
        loads = [load for load in model.loads if _acts_on_nodes(load) is shared]
        forces = external_loads(model, groups, loads)
        total += forces * own[:, None] if shared else forces
    return total


def _acts_on_nodes(load: Load) -> bool:
    """Return whether all parts that have a node give the same force on it."""
    while isinstance(load, ScaledLoad):
        load = load.load
    return isinstance(load, (PointLoad, NodalForces))


def _check_supports(partition: Partition, points: Array, held: Mask) -> None:
    """Raise ModelError where supports of all parts leave rigid-body modes free."""
    own = partition.own
    center = partition.sum(points[own].sum(axis=0)) / max(int(partition.offsets[-1]), 1)
    X = points - center
    size = partition.max(float(np.abs(X).max(initial=0.0))) or 1.0
    R = rigid_modes(X / size, np.zeros(3))[held.ravel()]
    values = np.linalg.eigvalsh(partition.sum(R.T @ R))
    if values[0] <= FREE * max(values[-1], 1.0):
        free = int((values <= FREE * max(values[-1], 1.0)).sum())
        raise ModelError(f"the supports leave {free} rigid-body modes free. Fix more nodes or components")
