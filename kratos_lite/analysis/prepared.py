"""The start of static solutions: a checked structure, its Dirichlet conditions, load sets and equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.analysis.nodal_loads import external_loads, initial_loads, nodal_forces
from kratos_lite.analysis.solution_checks import Phases
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError, ModelError
from kratos_lite.model import checks
from kratos_lite.model.free_motions import FreeMotions
from kratos_lite.model.loads import Load
from kratos_lite.model.loads.temperature import heated
from kratos_lite.model.structure import Structure
from kratos_lite.model.supports import Supports
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.typing import Array, Ints, Mask, Progress
from kratos_lite.validation import choice

if TYPE_CHECKING:
    from kratos_lite.solvers.constraints import ConstraintMap


@dataclass(frozen=True, eq=False)
class Prepared:
    """A structure that has passed its checks."""

    version: tuple[int, int]  # of the structure
    groups: list[ElementGroup]
    warnings: list[str]  # of the checks
    free: FreeMotions  # the rigid motions that supports leave to its components

    @cached_property
    def component(self) -> Ints:
        """The component of each node (n,), -1 without elements."""
        return self.free.component

    @cached_property
    def used(self) -> Mask:
        """Whether elements use each node (n,)."""
        return np.asarray(self.component >= 0)

    def components_with(self, nodes: Mask) -> Mask:
        """Return the components with one of some nodes, a mask (n,)."""
        chosen = np.zeros(len(self.free.counts), dtype=bool)
        chosen[self.component[nodes & self.used]] = True
        return chosen


def prepared(model: Structure) -> Prepared:
    """Return a structure checked; MeshError, ModelError or InputError where it is broken."""
    version = model.version
    groups, warnings = model.checked(loads=False)
    return Prepared(version, groups, warnings, model.free_motions(groups))


@dataclass(frozen=True, eq=False)
class DirichletConditions:
    """Which nodes (n,) are displaced and which constrained at rest; how many components are prescribed."""

    version: int
    displaced: Mask
    at_rest: Mask
    count: int


def dirichlet_conditions(supports: Supports, used: Mask) -> DirichletConditions:
    """Return what supports prescribe; ModelError where their constraints contradict one another."""
    dependents = supports.dependents()
    moved = supports.fixed & (supports.values != 0)
    moved.flat[dependents.dependents[dependents.constants != 0]] = True
    displaced = any_axis(moved)
    at_rest = ~any_axis(~supports.fixed) & ~displaced
    return DirichletConditions(supports.value_version, displaced, at_rest, int(supports.fixed[used].sum()))


@dataclass(frozen=True, eq=False)
class Equations:
    """The equations of some components (p,), and how many of their elements have all nodes at rest.

    `prescribed` (3a,) is what supports prescribe where it differs from that of the system.
    """

    system: ConstrainedSystem
    components: Mask
    n_at_rest: int
    prescribed: Array | None = None


@dataclass(eq=False)
class LoadSet:
    """Loads, their nodal forces (n, 3) in N without and with initial stress, and components they strain."""

    loads: list[Load]
    groups: list[ElementGroup]  # the elements with the temperatures among them
    external: Array
    forces: Array
    moving: Mask
    phase: Phases
    warnings: list[str] = field(default_factory=list)  # of functions that jump


def load_set(
    model: Structure,
    state: Prepared,
    dirichlet: DirichletConditions,
    loads: Load | Sequence[Load],
    phase: Phases,
) -> LoadSet:
    """Return loads as nodal forces; an error where they do not fit, or a free component is not in balance."""
    loads = [loads] if isinstance(loads, Load) else loads
    if not isinstance(loads, (list, tuple)):
        raise InputError(f"a load, or a list of them, is needed; got {type(loads).__name__}")
    for load in loads:
        if not isinstance(load, Load):
            raise InputError(f"a load such as Gravity or Traction is needed; got {type(load).__name__}")
    mesh, supports = model.mesh, model.supports
    with phase("load"):
        external = supports.on_independents(external_loads(model, state.groups, loads))
        groups = heated(mesh, state.groups, chain.from_iterable(load.acting(0.0) for load in loads))
        initial = initial_loads(model, groups)
        forces = external if initial is None else external - supports.on_independents(initial)
        checks.check_carried(mesh, np.arange(len(forces)), forces, state.used)
        pushed = any_axis((forces != 0) & ~supports.fixed)
        moving = state.components_with(pushed | dirichlet.displaced)
        state.free.check(nodal_forces(model, state.groups, loads), moving)
    return LoadSet(list(loads), groups, external, forces, moving, phase)


def any_axis(mask: Mask) -> Mask:
    """Return mask.any(axis=1) of a mask (n, 3), faster."""
    return mask[:, 0] | mask[:, 1] | mask[:, 2]


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
    """Raise InputError where another backend is requested than the own one, which something needs."""
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
    """Return the constrained system of some elements of a model, for a backend.

    Components `held` (n, 3) of what supports leave free are 0, too.
    """

    def constraints(nodes: Ints) -> ConstraintMap:
        return model.supports.constraint_map(nodes).holding(held[nodes])

    what = model.mesh.points, groups, constraints
    how: dict[str, Any] = {"solver": solver, "tolerance": tolerance, "progress": progress}
    if backend == "own":
        how |= {"patterns": model.patterns, "hanging": model.mesh.hanging, "attached": model.attached}
        return ConstrainedSystem(*what, **how, ordered=True)
    if model.attached:
        text = "leave backend and PETSc options out"
        raise ModelError(f"springs and added masses are for the own backend; {text}")
    from kratos_lite.distributed.communicator import started
    from kratos_lite.distributed.petsc_system import PetscSystem

    return PetscSystem(*what, started(), petsc, **how)
