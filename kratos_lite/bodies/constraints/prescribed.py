"""Constraints that move points along a direction as prescribed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.bodies.constraints.base import Points
from kratos_lite.bodies.constraints.fixed import AlongDirection
from kratos_lite.bodies.free_body import FreeBody
from kratos_lite.time_series import Factor, function_of, integral_of
from kratos_lite.typing import Array

SHORT = 1e-3
"""Fraction of a step over which the slope of a displacement is taken."""


class PrescribedDisplacement(AlongDirection):
    """Points that move along a direction as prescribed.

    Parameters
    ----------
    points, direction : as for `FixDirection`.
    displacement : m, number, `TimeSeries` or function of the time: by how much the points are moved from
        where they were when the constraint was made.  A motion starts where the body is; a body at rest
        (`find_equilibrium`) may be moved by a number.
    """

    def __init__(self, points: Points, direction: ArrayLike, displacement: Factor) -> None:
        super().__init__(points, direction)
        self.displacement = function_of(displacement, "a displacement")

    def gap(self, x: Array, v: Array, time: float, h: float) -> Array:
        """Return by how much the points are off; see `Constraint.gap`."""
        return (self._moved(x) - self.displacement(time)) * (2 / h)

    def starting_velocities(self, v: Array, time: float, h: float) -> Array:
        """Return the slope of the displacement at a time; see `Constraint.starting_velocities`."""
        short = SHORT * h
        return np.full_like(v, (self.displacement(time + short) - self.displacement(time)) / short)


class PrescribedVelocity(AlongDirection):
    """Points with a prescribed velocity along a direction at the end of each step.

    Parameters
    ----------
    points, direction : as for `FixDirection`.
    velocity : m/s, number, `TimeSeries` or function of the time.
    """

    positional = False

    def __init__(self, points: Points, direction: ArrayLike, velocity: Factor) -> None:
        super().__init__(points, direction)
        self.speed = function_of(velocity, "a velocity")

    def gap(self, x: Array, v: Array, time: float, h: float) -> Array:
        """Return the velocity error; see `Constraint.gap`."""
        return np.asarray(v @ self.direction)[:, None] - self.speed(time)

    def starting_velocities(self, v: Array, time: float, h: float) -> Array:
        """Return the velocity at a time; see `Constraint.starting_velocities`."""
        return np.full_like(v, self.speed(time))


class PrescribedAcceleration(AlongDirection):
    """Points with a prescribed acceleration along a direction: it adds up to their velocity.

    Parameters
    ----------
    points, direction : as for `FixDirection`.
    acceleration : m/s², number, `TimeSeries` or function of the time.
    """

    positional = False

    def __init__(self, points: Points, direction: ArrayLike, acceleration: Factor) -> None:
        super().__init__(points, direction)
        function_of(acceleration, "an acceleration")
        self.acceleration = acceleration

    def begin(self, body: FreeBody, h: float) -> None:
        """Add what the acceleration adds to the velocity in a step."""
        gained = integral_of(self.acceleration, body.time, body.time + h)
        self._target = (body.velocity(self.points) @ self.direction)[:, None] + gained

    def gap(self, x: Array, v: Array, time: float, h: float) -> Array:
        """Return the velocity error; see `Constraint.gap`."""
        return np.asarray(v @ self.direction)[:, None] - self._target

    def starting_velocities(self, v: Array, time: float, h: float) -> Array:
        """Return the velocities as they are; see `Constraint.starting_velocities`."""
        return v
