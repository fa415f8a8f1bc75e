"""Nodal forces of a structure: of its loads, of its initial stress and of the stresses of a result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import chain
from typing import TypeAlias

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, add_nodal
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.model.checks import check_carried
from kratos_lite.model.loads import Load, TimeDependentLoad
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.temperature import Temperature, heated
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.tangents import Changes
from kratos_lite.typing import Array

Temperatures: TypeAlias = list[tuple[float, Load]]
"""Temperatures that act, each with a factor."""


def forces_of(model: Structure, groups: Sequence[ElementGroup], load: Load) -> Array:
    """Return the nodal forces (n, 3) in N of a load at the time 0, the weight of added masses among them."""
    rest = np.zeros_like(model.mesh.points)
    if isinstance(load, TimeDependentLoad):
        return rest + load.history(lambda one: forces_of(model, groups, one))(0.0)
    forces = load.forces(model.mesh, groups)
    if model.attached and isinstance(load, Gravity) and load.where is None:
        forces += (model.attached.M @ load.at(model.mesh.points).ravel()).reshape(-1, 3)
    return forces


def external_loads(model: Structure, groups: Sequence[ElementGroup], loads: Sequence[Load]) -> Array:
    """Return the nodal forces (n, 3) in N of all loads."""
    return sum((forces_of(model, groups, load) for load in loads), np.zeros_like(model.mesh.points))


def initial_loads(model: Structure, groups: Sequence[ElementGroup]) -> Array | None:
    """Return ∫ B^T σ dV at rest: what prestress, temperature and stress-free state put on the nodes."""
    at_rest = model.initial_displacement is None and model.prestress is None
    if at_rest and all(group.heating is None for group in groups):
        return None
    return stress_load(model, groups, np.zeros_like(model.mesh.points))


def stress_load(model: Structure, groups: Sequence[ElementGroup], u: Array) -> Array:
    """Return ∫ B^T σ dV (n, 3) in N of the stresses that a result of u shows, with those of prestress."""
    u0 = model.initial_displacement
    return internal_load(model.mesh.points, groups, u if u0 is None else u - u0)


def temperatures(model: Structure, time: float) -> Temperatures:
    """Return the temperatures of a model at a time in s, each with a factor."""
    acting = chain.from_iterable(load.acting(time) for load in model.loads)
    return [(factor, load) for factor, load in acting if isinstance(load, Temperature)]


def at_temperature(model: Structure, groups: Sequence[ElementGroup], time: float) -> list[ElementGroup]:
    """Return groups with the temperatures of the model at a time in s; the same ones without any."""
    return heated(model.mesh, groups, temperatures(model, time))


class AppliedLoads:
    """The nodal forces of the loads of a structure at a time; what does not change is made once."""

    def __init__(
        self, model: Structure, system: ConstrainedSystem, groups: list[ElementGroup], initial: bool = True
    ) -> None:
        self.model, self.system, self._groups = model, system, groups
        self._initial = initial  # whether the initial stress is a load, as where stresses are C ε alone

    def __call__(self, time: float) -> Array:
        """Return the nodal forces (3a,) in N at a time in s."""
        total = self._constant.copy()
        for history in self._histories:
            total += history(time)
        return total

    def following(self, time: float, u: Array) -> tuple[Array, Changes]:
        """Return what displacements u (3a,) change of the loads at a time in s, and its tangent.

        Forces (3a,) in N, and for some nodes (m, k) of the equations the derivatives (m, k, 3, k, 3) in N/m.
        """
        mesh, changes = self.model.mesh, Changes()
        x, total = mesh.points + self.system.scatter(u), np.zeros_like(mesh.points)
        for factor, load in chain.from_iterable(load.acting(time) for load in self.model.loads):
            for nodes, forces, tangent in load.follow(mesh, x):
                add_nodal(total, nodes, factor * forces)
                changes.append((np.searchsorted(self.system.nodes, nodes), factor * tangent))
        return self.system.gather(total), changes

    def _forces_of(self, load: Load) -> Array:
        used = np.zeros(self.system.n_nodes, dtype=bool)
        used[self.system.nodes] = True
        mesh = self.model.mesh
        forces = forces_of(self.model, self._groups, load)
        if isinstance(load, Temperature) and self._initial:
            cold = [group.without_initial for group in self._groups]
            forces = -internal_load(mesh.points, heated(mesh, cold, [(1.0, load)]), np.zeros_like(forces))
        check_carried(self.model.mesh, forces, used)
        return self.system.gather(forces)

    @cached_property
    def _constant(self) -> Array:
        total = np.zeros(3 * len(self.system.nodes))
        initial = initial_loads(self.model, self._groups) if self._initial else None
        if initial is not None:
            total -= self.system.gather(initial)
        for load in self.model.loads:
            if not isinstance(load, TimeDependentLoad):
                total += self._forces_of(load)
        return total

    @cached_property
    def _histories(self) -> list[Callable[[float], Array | float]]:
        loads = [load for load in self.model.loads if isinstance(load, TimeDependentLoad)]
        return [load.history(self._forces_of) for load in loads]
