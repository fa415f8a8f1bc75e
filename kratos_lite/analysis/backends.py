"""Backends: what makes and solves the equations, our own solvers on one process or PETSc over many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.typing import Ints, Mask, Progress
from kratos_lite.validation import choice

if TYPE_CHECKING:
    from kratos_lite.solvers.constraint_map import ConstraintMap

BACKENDS = ("own", "petsc")


def backend_of(backend: str | None, petsc: str | None) -> str:
    """Return the backend: ``own`` if none is named and no PETSc options are given."""
    chosen = ("own" if petsc is None else "petsc") if backend is None else backend
    if choice(chosen, "backend", BACKENDS) == "own":
        if petsc is not None:
            raise InputError("PETSc options are for backend='petsc'; leave them out, or take that backend")
        return chosen
    from kratos_lite.distributed.communicator import started
    from kratos_lite.distributed.petsc import parsed
    from kratos_lite.distributed.petsc import petsc as load

    parsed(petsc)
    load()
    started()
    return chosen


def check_own(backend: str | None, petsc: str | None, what: str) -> None:
    """Raise InputError where another backend is asked for than the own one, which something needs."""
    if backend_of(backend, petsc) != "own":
        raise InputError(f"{what} is solved by the own backend alone; leave backend and PETSc options out")


def system_of(
    model: Structure,
    groups: Sequence[ElementGroup],
    held: Mask,
    solver: str,
    tolerance: float,
    progress: Progress | None,
    backend: str,
    petsc: str | None,
) -> ConstrainedSystem:
    """Return the constrained system of some elements of a model, for an backend.

    Components `held` (n, 3) of what supports leave free are 0, too.
    """

    def constraints(nodes: Ints) -> ConstraintMap:
        return model.supports.constraint_map(nodes).holding(held[nodes])

    if backend == "own":
        return ConstrainedSystem(
            model.mesh.points,
            groups,
            constraints,
            solver=solver,
            tolerance=tolerance,
            patterns=model.patterns,
            progress=progress,
            hanging=model.mesh.hanging,
        )
    from kratos_lite.distributed.communicator import started
    from kratos_lite.distributed.petsc_system import PetscSystem

    return PetscSystem(
        model.mesh.points,
        groups,
        constraints,
        started(),
        petsc,
        solver=solver,
        tolerance=tolerance,
        progress=progress,
    )
