"""Prescribed motion: displacement, velocity and acceleration of supports over the steps in time.

Newmark's formulas would take velocity and acceleration of a support from its displacements and ring for ever
with what they get wrong in one step.  Differences over steps do not, have order 2, and keep the whole impulse
of a table's kinks.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.errors import ModelError
from kratos_lite.model.supports import Supports
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.typing import Array, Mask

Kinematics: TypeAlias = tuple[Array, Array, Array]
"""Displacement, velocity and acceleration (3a,)."""


class PrescribedMotion:
    """What supports and constraints prescribe at a time; it is linear in the prescribed motion."""

    def __init__(self, supports: Supports, system: ConstrainedSystem) -> None:
        self.supports, self.system = supports, system

    def __call__(self, time: float) -> Array:
        """Return the displacements (3a,) in m at a time in s where the free ones are 0."""
        values, resting, moving = self._fields
        total = resting.copy()
        for function, moved, field in moving:
            size = function(time)
            if np.isnan(size).any():
                text = "a support whose function returns None is one of quasi-static analysis alone"
                raise ModelError(f"at t = {time:g} s: {text}")
            many = np.ndim(size) > 0
            total += self._at(np.where(moved, size[:, None], values)) - resting if many else size * field
        return total

    @cached_property
    def _fields(self) -> tuple[Array, Array, list[tuple[Callable[[float], Any], Mask, Array]]]:
        """Values (n, 3) while all that moves is at 0, what they prescribe, and the motions, (3a,) at 1."""
        values = self.supports.values.copy()
        motions = self.supports.motions
        for _, moved in motions:
            values[moved] = 0.0
        resting = self._at(values)
        fields = (self._at(np.where(moved, 1.0, values)) - resting for _, moved in motions)
        return values, resting, [(*motion, field) for motion, field in zip(motions, fields, strict=True)]

    def _at(self, values: Array) -> Array:
        """Return the displacements (3a,) for prescribed values (n, 3), 0 where they are free."""
        constraints = self.supports.constraint_map(self.system.nodes, values)
        constraints.c[constraints.free] = 0.0
        return constraints.c

    def part(self, x: Array) -> Array:
        """Return what vectors (3a,) have beyond their free components and what constraints make of those."""
        constraints = self.system.constraint_map
        return np.asarray(x - constraints.transform(x[constraints.free]))

    def replace(self, x: Array, prescribed: Array) -> Array:
        """Return vectors (3a,) with the free components of x; the others follow from supports."""
        constraints = self.system.constraint_map
        return np.asarray(constraints.transform(x[constraints.free]) + prescribed)

    def at_start(self, h: float = np.inf) -> Kinematics:
        """Return what is prescribed at the time 0, by one-sided differences of order 2 over steps up to h."""
        g = self(0.0)
        if not self.supports.motions:
            return g, np.zeros_like(g), np.zeros_like(g)
        short, long = min(h, 1e-6), min(h, 1e-5)
        velocity = (-3 * g + 4 * self(short) - self(2 * short)) / (2 * short)
        later = [self(i * long) for i in (1, 2, 3)]
        return g, velocity, (2 * g - 5 * later[0] + 4 * later[1] - later[2]) / long**2

    def at_end(self, time: float, h: float) -> Kinematics:
        """Return what is prescribed at the end of a step, time ≥ h, by central differences over steps h."""
        before, now, after = (self(time + k * h) for k in (-1, 0, 1))
        return now, (after - before) / (2 * h), (after - 2 * now + before) / h**2
