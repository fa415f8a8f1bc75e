"""Forcing: what drives a model in time, loads and supports that move, as vectors (3a,) of its equations."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.analysis.static import initial_loads
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.model.loads import Load, Timed, Varying
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.supports import reduction, resolve
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from kratos_lite.analysis.model import Model


class AppliedLoads:
    """The nodal forces of the loads of a model at a time; what does not change is made once."""

    def __init__(self, model: Model, system: ConstrainedSystem, groups: list[ElementGroup]) -> None:
        self.model, self.system, self._batches = model, system, groups

    def __call__(self, time: float) -> Array:
        """Return the nodal forces (3a,) in N at a time in s."""
        total = self._constant.copy()
        for factor, forces in self._scaled:
            total += factor(time) * forces
        for timed in self._timed:
            total += timed(time)
        return total

    def _of(self, load: Load) -> Array:
        return self.system.local(load.forces(self.model.mesh, self._batches))

    @cached_property
    def _constant(self) -> Array:
        total = np.zeros(3 * len(self.system.nodes))
        initial = initial_loads(self.model, self._batches)
        if initial is not None:
            total -= self.system.local(initial)
        for load in self.model.loads:
            if not isinstance(load, (Varying, Timed)):
                total += self._of(load)
        return total

    @cached_property
    def _scaled(self) -> list[tuple[Callable[[float], float], Array]]:
        return [(load.factor, self._of(load.load)) for load in self.model.loads if isinstance(load, Varying)]

    @cached_property
    def _timed(self) -> list[_TimedForces]:
        return [_TimedForces(load, self._of) for load in self.model.loads if isinstance(load, Timed)]


class _TimedForces:
    """Nodal forces (3a,) of a `Timed` load; those of the last two times are kept."""

    def __init__(self, timed: Timed, forces_of: Callable[[Load], Array]) -> None:
        self.timed, self.forces_of = timed, forces_of
        self.kept: list[tuple[float, Load | None, Array | float]] = []

    def __call__(self, time: float) -> Array | float:
        """Return the forces at a time; 0 where nothing acts."""
        for at, _, forces in self.kept:
            if at == time:
                return forces
        load = self.timed.at(time)
        same = [forces for _, one, forces in self.kept if one is load]
        forces = same[0] if same else 0.0 if load is None else self.forces_of(load)
        self.kept = [*self.kept[-1:], (time, load, forces)]
        return forces


class Prescribed:
    """What supports and constraints prescribe at a time; it is linear in the displacements that move."""

    def __init__(self, model: Model, system: ConstrainedSystem) -> None:
        self.supports, self.system = model.supports, system

    def __call__(self, time: float) -> Array:
        """Return the displacements (3a,) in m at a time in s where the free ones are 0."""
        resting, shares = self._moved
        return resting + sum(course(time) * share for course, share in shares)

    @cached_property
    def _moved(self) -> tuple[Array, list[tuple[Callable[[float], float], Array]]]:
        """What is prescribed while all that moves is at 0, and the share (3a,) of each that moves, at 1."""
        supports = self.supports
        kept = supports.values.copy()
        try:
            for one in supports.movements:
                supports.values[one.rows, one.axis] = 0.0
            resting, shares = self._at_values(), []
            for one in supports.movements:
                supports.values[one.rows, one.axis] = 1.0
                shares.append((one.course, self._at_values() - resting))
                supports.values[one.rows, one.axis] = 0.0
            return resting, shares
        finally:
            supports.values[...] = kept

    def _at_values(self) -> Array:
        """Return the displacements (3a,) for the present values of the supports, 0 where they are free."""
        used = np.zeros(self.system.n_nodes, dtype=bool)
        used[self.system.nodes] = True
        links = resolve(self.supports, used, agree=False) if self.supports.links else {}
        found = reduction(self.supports, self.system.nodes, links)
        found.c[found.free] = 0.0
        return found.c
