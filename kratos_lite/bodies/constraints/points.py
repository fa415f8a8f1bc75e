"""Constraints of points: fixed, moved along a direction as prescribed, or linked to a point in space."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.bodies.constraints.base import Constraint, Points
from kratos_lite.bodies.free_body import FreeBody
from kratos_lite.bodies.validation import one_point, vector_of
from kratos_lite.errors import InputError
from kratos_lite.time_series import Factor, function_of, integral_of
from kratos_lite.typing import Array

SHORT = 1e-3
"""Fraction of a step over which the slope of a displacement is taken."""


class FixPoint(Constraint):
    """Points that stay where they are.

    Parameters
    ----------
    points : (3,) or (m, 3) m, in the undeformed body; or a part or side of the mesh (``"x-"``), or a
        predicate on its points (n, 3), for the nodes there.
    """

    @property
    def count(self) -> int:
        """Number of rows: three for each point."""
        return 3 * len(self.points)

    def directions(self, x: Array) -> Array:
        """Return x, y and z."""
        return np.broadcast_to(np.eye(3), (len(self.points), 3, 3))

    def gap(self, x: Array, v: Array, time: float, h: float) -> Array:
        """Return how far the points have moved; see `Constraint.gap`."""
        return np.asarray((x - self._start) * (2 / h))


class AlongDirection(Constraint):
    """A constraint along one direction (3,) fixed in space, of any length but 0; points as for `FixPoint`."""

    def __init__(self, points: Points, direction: ArrayLike) -> None:
        super().__init__(points)
        n = vector_of(direction, "a direction")
        length = float(np.linalg.norm(n))
        if n.shape != (3,) or length == 0:
            raise InputError(f"a direction needs three components, not all 0; got {direction!r}")
        self.direction = n / length

    def directions(self, x: Array) -> Array:
        """Return the direction, for each point."""
        return np.broadcast_to(self.direction, (len(self.points), 1, 3))

    def _moved(self, x: Array) -> Array:
        """Return how far points at x (m, 3) have moved along the direction, (m, 1) in m."""
        return np.asarray((x - self._start) @ self.direction)[:, None]


class FixDirection(AlongDirection):
    """Points that do not move along a direction, but are free across it."""

    def gap(self, x: Array, v: Array, time: float, h: float) -> Array:
        """Return how far the points have moved; see `Constraint.gap`."""
        return self._moved(x) * (2 / h)


class RigidLink(Constraint):
    """A rod without mass from a material point to a fixed point in space.

    The length is the distance at the time when the constraint is made.

    Parameters
    ----------
    point : (3,) m, in the undeformed body.
    anchor : (3,) m, in space.
    """

    turning = True

    def __init__(self, point: ArrayLike, anchor: ArrayLike) -> None:
        super().__init__(one_point(point))
        self.anchor = one_point(anchor)

    def bind(self, body: FreeBody) -> None:
        """Take hold of a body where it is now.

        Raises
        ------
        InputError
            Point and anchor coincide.
        """
        super().bind(body)
        self.length = float(np.linalg.norm(self._start[0] - self.anchor))
        if self.length == 0:
            raise InputError("a rigid link needs a length: point and anchor coincide; use FixPoint")

    def directions(self, x: Array) -> Array:
        """Return the direction from the anchor to the point."""
        y = x - self.anchor
        return np.asarray(y / np.linalg.norm(y))[:, None]

    def turning_stiffness(self, x: Array, multipliers: Array) -> Array:
        """Return the reaction over the length, across the link; see `Constraint.turning_stiffness`."""
        n = self.directions(x)[:, 0]
        distance = np.linalg.norm(x - self.anchor, axis=1)
        across = np.eye(3) - n[:, :, None] * n[:, None, :]
        return np.asarray((multipliers[:, 0] / distance)[:, None, None] * across)

    def gap(self, x: Array, v: Array, time: float, h: float) -> Array:
        """Return by how much the link is too long; see `Constraint.gap`."""
        stretch = np.linalg.norm(x - self.anchor, axis=1) - self.length
        return np.asarray(stretch[:, None] * (2 / h))


# ---- prescribed --------------------------------------------------------------------------------------


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
