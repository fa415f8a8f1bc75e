"""Engines: what makes and solves the equations, the own solvers of one process or PETSc over many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.typing import Array, Mask, Progress
from kratos_lite.validation import choice

if TYPE_CHECKING:
    from kratos_lite.distributed.petsc_system import PetscSystem

System: TypeAlias = "ConstrainedSystem | PetscSystem"
ENGINES = ("own", "petsc")


def engine_of(mesh: Mesh, engine: str | None, petsc: str | None) -> str:
    """Return the engine for a mesh: ``own`` or ``petsc``.

    Parameters
    ----------
    mesh : the whole one, or what a rank holds of it.
    engine : ``own``, ``petsc`` or None: the own one where the mesh is whole and no PETSc options are given.
    petsc : options of PETSc.

    Raises
    ------
    InputError
        There is no such engine, PETSc is not installed, its options cannot be read, or the engine does not
        take this mesh.

    Examples
    --------
    >>> from kratos_lite import box
    >>> engine_of(box(), None, None)
    'own'
    """
    shared = mesh.subdomain is not None
    chosen = ("petsc" if shared or petsc is not None else "own") if engine is None else engine
    if choice(chosen, "engine", ENGINES) == "own":
        if petsc is not None:
            raise InputError("PETSc options are for engine='petsc'; leave them out, or take that engine")
        if shared and mesh.ranks.size > 1:
            raise InputError(
                f"engine='own' solves on one process, and {mesh.ranks.size} share this mesh; take "
                "engine='petsc', or start without mpirun"
            )
        return chosen
    from kratos_lite.distributed.communicator import world
    from kratos_lite.distributed.petsc import parsed
    from kratos_lite.distributed.petsc import petsc as load

    parsed(petsc)
    load()
    if not shared and world().size > 1:
        raise InputError(
            f"{world().size} ranks have been started, and each has the whole mesh; let them share it: "
            "kratos_lite.box(comm=MPI.COMM_WORLD), or read_case(path, comm=MPI.COMM_WORLD)"
        )
    return chosen


def check_own(mesh: Mesh, engine: str | None, petsc: str | None, what: str) -> None:
    """Raise InputError or ModelError where the own engine, which something needs, cannot be taken."""
    if engine_of(mesh, engine, petsc) != "own" and (mesh.subdomain is None or engine is not None):
        raise InputError(f"{what} is solved by the own engine alone; leave engine and PETSc options out")
    check_whole(mesh, what)


def check_whole(mesh: Mesh, what: str) -> None:
    """Raise ModelError for what needs the whole mesh on one process, where ranks share it."""
    if mesh.ranks.size > 1:
        raise ModelError(
            f"{what} needs the whole mesh on one process, and {mesh.ranks.size} ranks share it: over ranks "
            "statics alone is solved; start without mpirun"
        )


def system_of(
    model: Structure,
    groups: Sequence[ElementGroup],
    held: Mask,
    solver: str,
    tolerance: float,
    progress: Progress | None,
    engine: str,
    petsc: str | None,
) -> System:
    """Return the constrained system of some elements of a model, for an engine.

    Components `held` (n, 3) of what supports leave free are 0, too.
    """
    supports = model.supports
    if engine == "own":
        return ConstrainedSystem(
            model.mesh.points,
            groups,
            lambda nodes: supports.constraint_map(nodes).holding(held[nodes]),
            solver=solver,
            tolerance=tolerance,
            patterns=model.patterns,
            progress=progress,
            hanging=model.mesh.hanging,
        )
    from kratos_lite.distributed.petsc_system import PetscSystem, Prescribed

    given = Prescribed(supports.fixed | held, supports.values, supports.turned(agree=True), supports.name)
    return PetscSystem(
        model.mesh, groups, given, solver=solver, tolerance=tolerance, options=petsc, progress=progress
    )


def release(system: System) -> None:
    """Let go of what PETSc holds of a system: all ranks do that at the same time."""
    if not isinstance(system, ConstrainedSystem):
        system.destroy()


def displacements(model: Structure, system: System, values: Array | None = None) -> Array:
    """Return what is prescribed at the nodes of a system, (3a,) in m; `values` (n, 3) replace the model's."""
    if isinstance(system, ConstrainedSystem):
        return model.supports.constraint_map(system.nodes, values).c
    return system.displacements(model.supports.values if values is None else values)
