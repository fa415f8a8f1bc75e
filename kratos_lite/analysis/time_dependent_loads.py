"""Loads and prescribed motion of a structure in time, as vectors (3a,) of its equations."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from kratos_lite.analysis.nodal_loads import initial_loads
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.model.checks import check_carried
from kratos_lite.model.loads import Load, TimeDependentLoad
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.typing import Array, Mask


class AppliedLoads:
    """The nodal forces of the loads of a structure at a time; what does not change is made once."""

    def __init__(self, model: Structure, system: ConstrainedSystem, groups: list[ElementGroup]) -> None:
        self.model, self.system, self._groups = model, system, groups

    def __call__(self, time: float) -> Array:
        """Return the nodal forces (3a,) in N at a time in s."""
        total = self._constant.copy()
        for history in self._histories:
            total += history(time)
        return total

    def _forces_of(self, load: Load) -> Array:
        forces = load.forces(self.model.mesh, self._groups)
        check_carried(self.model.mesh, forces, self._used)
        return self.system.gather(forces)

    @cached_property
    def _used(self) -> Mask:
        used = np.zeros(self.system.n_nodes, dtype=bool)
        used[self.system.nodes] = True
        return used

    @cached_property
    def _constant(self) -> Array:
        total = np.zeros(3 * len(self.system.nodes))
        initial = initial_loads(self.model, self._groups)
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


class PrescribedDisplacement:
    """What supports and constraints prescribe at a time; it is linear in the prescribed motion."""

    def __init__(self, model: Structure, system: ConstrainedSystem) -> None:
        self.supports, self.system = model.supports, system

    def __call__(self, time: float) -> Array:
        """Return the displacements (3a,) in m at a time in s where the free ones are 0."""
        resting, shares = self._shares
        return resting + sum(function(time) * share for function, share in shares)

    @cached_property
    def _shares(self) -> tuple[Array, list[tuple[Callable[[float], float], Array]]]:
        """What is prescribed while all that moves is at 0, and the share (3a,) of each motion, at 1."""
        values = self.supports.values.copy()
        motions = self.supports.motions
        for _, moved in motions:
            values[moved] = 0.0
        resting, shares = self._at(values), []
        for function, moved in motions:
            shares.append((function, self._at(np.where(moved, 1.0, values)) - resting))
        return resting, shares

    def _at(self, values: Array) -> Array:
        """Return the displacements (3a,) for prescribed values (n, 3), 0 where they are free."""
        found = self.supports.constraint_map(self.system.nodes, values)
        found.c[found.free] = 0.0
        return found.c
