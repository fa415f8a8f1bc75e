"""Nodal forces of a structure: of its loads, of its initial stress and of the stresses of a result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import chain
from typing import TypeAlias

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, add_nodal
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.mesh.blocks import NO_ROWS, mask_of
from kratos_lite.model.checks import check_carried
from kratos_lite.model.loads import Load, TimeDependentLoad
from kratos_lite.model.loads.base import InTime
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.merging import joined
from kratos_lite.model.loads.temperature import Temperature, heated
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.tangents import Changes
from kratos_lite.typing import Array, Ints

Temperatures: TypeAlias = list[tuple[float, Load]]
"""Temperatures that act, each with a factor."""


def nodal_forces(
    model: Structure, groups: Sequence[ElementGroup], loads: Iterable[Load], time: float = 0.0
) -> Iterator[tuple[Ints, Array]]:
    """Yield nodes (k,) and the forces (k, 3) in N of some loads there, added masses' weight among them."""
    for factor, load in joined(model.mesh, chain.from_iterable(load.acting(time) for load in loads)):
        nodes, forces = load.on_nodes(model.mesh, groups)
        yield nodes, factor * forces
        if model.attached and isinstance(load, Gravity) and load.where is None:
            weight = (model.attached.M @ load.at(model.mesh.points).ravel()).reshape(-1, 3)
            yield np.arange(len(weight)), factor * weight


def external_loads(model: Structure, groups: Sequence[ElementGroup], loads: Iterable[Load]) -> Array:
    """Return the nodal forces (n, 3) in N of all loads."""
    total = np.zeros_like(model.mesh.points)
    for nodes, forces in nodal_forces(model, groups, loads):
        add_nodal(total, nodes, forces)
    return total


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
        self._followers: tuple[float, list[tuple[float, Load]]] = np.nan, []  # at a time
        self._initial = initial  # whether the initial stress is a load, as where stresses are C ε alone

    def __call__(self, time: float) -> Array:
        """Return the nodal forces (3a,) in N at a time in s."""
        total = self._constant.copy()
        for factor, (nodes, forces) in self._changing(time):
            total[nodes] += factor * forces
        return self.system.gather(total)

    def following(self, time: float, u: Array) -> tuple[Array, Changes]:
        """Return what displacements u (3a,) change of the loads at a time in s, and its tangent.

        Forces (3a,) in N, and for some nodes (m, k) of the equations the derivatives (m, k, 3, k, 3) in N/m.
        """
        mesh, changes = self.model.mesh, Changes()
        x, total = mesh.points + self.system.scatter(u), np.zeros_like(mesh.points)
        if time != self._followers[0]:
            acting = chain.from_iterable(load.acting(time) for load in self.model.loads)
            following = (one for one in acting if getattr(one[1], "follower", True))
            self._followers = time, list(joined(mesh, following))
        for factor, load in self._followers[1]:
            for nodes, forces, tangent in load.follow(mesh, x):
                add_nodal(total, nodes, factor * forces)
                changes.append((np.searchsorted(self.system.nodes, nodes), factor * tangent))
        return self.system.gather(total), changes

    def _on_nodes(self, loads: Sequence[Load]) -> tuple[Ints, Array]:
        """Return nodes (k,), each once, and the forces (k, 3) in N that some loads put on them."""
        mesh, used = self.model.mesh, mask_of(self.system.nodes, self.system.n_nodes)
        found = list(nodal_forces(self.model, self._groups, loads))
        hot = [(1.0, load) for load in loads if isinstance(load, Temperature) and self._initial]
        if hot:
            cold, at_rest = [group.without_initial for group in self._groups], np.zeros_like(mesh.points)
            forces = -internal_load(mesh.points, heated(mesh, cold, hot), at_rest)
            found.append((np.arange(len(forces)), forces))
        nodes, at = np.unique(np.concatenate([NO_ROWS, *(some for some, _ in found)]), return_inverse=True)
        total = np.zeros((len(nodes), 3))
        add_nodal(total, at, np.concatenate([total[:0], *(forces for _, forces in found)]))
        check_carried(mesh, nodes, total, used)
        return nodes, total

    @cached_property
    def _constant(self) -> Array:
        initial = initial_loads(self.model, self._groups) if self._initial else None
        nodes, forces = self._on_nodes([x for x in self.model.loads if not isinstance(x, TimeDependentLoad)])
        total = np.zeros_like(self.model.mesh.points) if initial is None else -initial
        total[nodes] += forces
        return total

    @cached_property
    def _changing(self) -> Callable[[float], list[tuple[float, tuple[Ints, Array]]]]:
        return InTime([x for x in self.model.loads if isinstance(x, TimeDependentLoad)], self._on_nodes)
