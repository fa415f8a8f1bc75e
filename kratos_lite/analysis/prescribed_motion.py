"""Prescribed motion: displacement, velocity and acceleration of supports over the steps in time.

Newmark's formulas would take velocity and acceleration of a support from its displacements and ring for ever
with what they get wrong in one step.  Differences over steps do not, have order 2, and keep the whole impulse
of a table's kinks.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.typing import Array

Kinematics: TypeAlias = tuple[Array, Array, Array]
"""Displacement, velocity and acceleration (3a,)."""


def prescribed_part(e: EquationsOfMotion, x: Array) -> Array:
    """Return what vectors (3a,) have beyond their free components and what constraints make of those."""
    constraints = e.system.constraint_map
    return np.asarray(x - constraints.transform(x[constraints.free]))


def with_prescribed(e: EquationsOfMotion, x: Array, prescribed: Array) -> Array:
    """Return vectors (3a,) with the free components of x; the others follow from supports and constraints."""
    constraints = e.system.constraint_map
    return np.asarray(constraints.transform(x[constraints.free]) + prescribed)


def at_start(e: EquationsOfMotion, h: float = np.inf) -> Kinematics:
    """Return what is prescribed at the time 0, by one-sided differences of order 2 over steps up to h."""
    g, zero = e.prescribed(0.0), np.zeros(e.size)
    if not e.model.supports.motions:
        return g, zero, zero
    short, long = min(h, 1e-6), min(h, 1e-5)
    velocity = (-3 * g + 4 * e.prescribed(short) - e.prescribed(2 * short)) / (2 * short)
    later = [e.prescribed(i * long) for i in (1, 2, 3)]
    return g, velocity, (2 * g - 5 * later[0] + 4 * later[1] - later[2]) / long**2


def at_end(e: EquationsOfMotion, time: float, h: float) -> Kinematics:
    """Return what is prescribed at the end of a step, time ≥ h, by central differences over steps h."""
    before, now, after = (e.prescribed(time + k * h) for k in (-1, 0, 1))
    return now, (after - before) / (2 * h), (after - 2 * now + before) / h**2
