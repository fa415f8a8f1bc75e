"""Constraints on a single body: fixed points and directions, prescribed motions, rigid links.

A constraint has a Jacobian H, along whose rows its reactions push, and a violation, which a step closes.  It
is taken at the end of the step: a point that is fixed stays where it is, and a link keeps its length, to
round-off.

Source: Solfec-1.0 user manual, constraints; its velocity-level laws are replaced by those of positions.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.bodies.free_body import FreeBody
from kratos_lite.bodies.linear_algebra import NO_ENTRIES, Entries, block_entries
from kratos_lite.bodies.validation import one_point, points_of
from kratos_lite.errors import InputError, ModelError
from kratos_lite.time_series import Factor, function_of, integral_of
from kratos_lite.typing import Array
from kratos_lite.validation import finite

Points: TypeAlias = "str | Callable[[Array], ArrayLike] | ArrayLike"
"""Points (3,) or (m, 3) in m of the undeformed body; or nodes by a part of the mesh or a predicate."""
SHORT = 1e-3
"""Fraction of a step over which the slope of a displacement is taken."""


class Constraint(ABC):
    """Something that constrains material points of a body, along r directions at each point.

    Parameters
    ----------
    points : (3,) or (m, 3) m, in the undeformed body; or a part or side of the mesh (``"x-"``), or a
        predicate on its points (n, 3), for the nodes there.

    Attributes
    ----------
    points : (m, 3) m, in the undeformed body.
    reactions : (m, 3) N, mean force on the points over the last step.

    Raises
    ------
    InputError
        There is no point, or points have not three finite coordinates.
    """

    positional: ClassVar[bool] = True
    """Whether it is about positions, so that it also constrains a body at rest."""
    turning: ClassVar[bool] = False
    """Whether its directions change as the body moves."""
    directions_of_point: ClassVar[int] = 1

    def __init__(self, points: Points) -> None:
        self._where = None
        if isinstance(points, str) or callable(points):
            self._where, points = points, np.zeros(3)  # those of the mesh when it is bound
        self._set_points(points_of(points))
        self._body: FreeBody | None = None
        self._jacobian: Array | None = None

    def _set_points(self, points: Array) -> None:
        self.points = np.atleast_2d(points)
        if not len(self.points):
            raise InputError(f"a {type(self).__name__} needs one point at least; got none")
        self.reactions = np.zeros_like(self.points)

    # ---- what a type of constraint defines -------------------------------------------------------

    @abstractmethod
    def directions(self, x: Array) -> Array:
        """Return the directions (m, r, 3) along which points at x (m, 3) are constrained."""

    @abstractmethod
    def violation(self, x: Array, v: Array, time: float) -> Array:
        """Return by how much points x (m, 3) with velocities v violate it, (m, r) in m, or in m/s."""

    def starting_velocities(self, v: Array, time: float, h: float) -> Array:
        """Return the velocities (m, r) in m/s along the directions with which the points start, v now."""
        return np.zeros_like(v)

    def begin(self, body: FreeBody, h: float) -> None:  # noqa: B027 - most have nothing to prepare
        """Prepare a step of h s of a body in its state before it."""

    def tangent_entries(self, body: FreeBody, q: Array, multipliers: Array) -> Entries:
        """Return the derivative of the reactions by q, whose directions may turn."""
        return NO_ENTRIES

    # ---- what is the same for all ----------------------------------------------------------------

    def bind(self, body: FreeBody) -> None:
        """Constrain a single body where it is now; ModelError for a batch, or if bound to another body."""
        if body.q.ndim > 1:
            raise ModelError("a constraint holds a single body; integrate bodies with constraints one by one")
        if self._body is not None and self._body is not body:
            raise ModelError("this constraint holds another body already; make one for each body")
        if self._where is not None:
            if body.mesh is None:
                raise ModelError("nodes are chosen from a mesh, and this body has none; give points (m, 3)")
            self._set_points(body.mesh.points[body.mesh.nodes(self._where)])
        body.locate(self.points)
        self._body, self._start = body, body.position(self.points)

    @property
    def count(self) -> int:
        """Number of rows m r."""
        return self.directions_of_point * len(self.points)

    def jacobian_entries(self, body: FreeBody, q: Array) -> Entries:
        """Return rows, dofs and values (k,) of H (m r, dofs): points move along their directions with H u."""
        directions = self.directions(body.position(self.points, q))
        row, dof, value = [], [], []
        for i, X in enumerate(self.points):
            dofs, matrix = body.jacobian(X, q)
            block = directions[i] @ matrix
            r, k = np.nonzero(np.abs(block) > 1e-14 * np.abs(matrix).max())
            row.append(r + i * len(block))
            dof.append(dofs[k])
            value.append(block[r, k])
        return np.concatenate(row), np.concatenate(dof), np.concatenate(value)

    def jacobian(self, body: FreeBody, q: Array) -> Array:
        """Return H (m r, dofs) as a full matrix; it is kept where it is always the same."""
        if self._jacobian is not None:
            return self._jacobian
        row, dof, value = self.jacobian_entries(body, q)
        H = np.zeros((self.count, body.dofs))
        H[row, dof] = value
        if body.jacobian_is_constant and not self.turning:
            self._jacobian = H
        return H

    def gaps(self, body: FreeBody, q: Array, u: Array, time: float, h: float) -> Array:
        """Return the violation (m r,) as the velocity in m/s that closes it in half a step of h s."""
        x, v = body.position(self.points, q), body.velocity(self.points, q, u)
        return self.violation(x, v, time).ravel() * (2 / h if self.positional else 1.0)

    def set_reactions(self, body: FreeBody, q: Array, multipliers: Array) -> None:
        """Set the reactions of multipliers (m r,) in N along the directions."""
        directions = self.directions(body.position(self.points, q))
        self.reactions = np.einsum("mr,mri->mi", multipliers.reshape(directions.shape[:2]), directions)


def with_slices(constraints: Iterable[Constraint]) -> Iterator[tuple[Constraint, slice]]:
    """Yield each constraint with the slice of its multipliers among those of all."""
    start = 0
    for constraint in constraints:
        yield constraint, slice(start, start := start + constraint.count)


# ---- fixed, linked -----------------------------------------------------------------------------------


class FixPoint(Constraint):
    """Points that stay where they are.

    Parameters
    ----------
    points : (3,) or (m, 3) m, in the undeformed body; or a part or side of the mesh (``"x-"``), or a
        predicate on its points (n, 3), for the nodes there.
    """

    directions_of_point = 3

    def directions(self, x: Array) -> Array:
        """Return x, y and z."""
        return np.broadcast_to(np.eye(3), (len(self.points), 3, 3))

    def violation(self, x: Array, v: Array, time: float) -> Array:
        """Return how far the points have moved; see `Constraint.violation`."""
        return x - self._start


class AlongDirection(Constraint):
    """A constraint along one direction (3,) fixed in space, of any length but 0; points as for `FixPoint`."""

    def __init__(self, points: Points, direction: ArrayLike) -> None:
        super().__init__(points)
        n = finite(direction, "a direction", (3,))
        if not n.any():
            raise InputError(f"a direction needs three components, not all 0; got {direction!r}")
        n = n / np.abs(n).max()  # the square of a tiny one would be 0
        self.direction = n / float(np.linalg.norm(n))

    def directions(self, x: Array) -> Array:
        """Return the direction, for each point."""
        return np.broadcast_to(self.direction, (len(self.points), 1, 3))

    def _along(self, vectors: Array) -> Array:
        """Return the components (m, 1) of vectors (m, 3) along the direction."""
        return np.asarray(vectors @ self.direction)[:, None]


class FixDirection(AlongDirection):
    """Points that do not move along a direction, but are free across it."""

    def violation(self, x: Array, v: Array, time: float) -> Array:
        """Return how far the points have moved; see `Constraint.violation`."""
        return self._along(x - self._start)


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
        """Constrain a body where it is now.

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

    def violation(self, x: Array, v: Array, time: float) -> Array:
        """Return by how much the link is too long; see `Constraint.violation`."""
        stretch = np.linalg.norm(x - self.anchor, axis=1) - self.length
        return stretch[:, None]

    def tangent_entries(self, body: FreeBody, q: Array, multipliers: Array) -> Entries:
        """Return the reaction over the length, across the link; see `Constraint.tangent_entries`."""
        x, (dofs, H) = body.position(self.points, q), body.jacobian(self.points[0], q)
        n = self.directions(x)[0, 0]
        change = multipliers[0] / np.linalg.norm(x - self.anchor) * (np.eye(3) - np.outer(n, n))
        return block_entries(dofs, dofs, H.T @ change @ H)


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

    def violation(self, x: Array, v: Array, time: float) -> Array:
        """Return by how much the points are off; see `Constraint.violation`."""
        return self._along(x - self._start) - self.displacement(time)

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

    def violation(self, x: Array, v: Array, time: float) -> Array:
        """Return the velocity error; see `Constraint.violation`."""
        return self._along(v) - self.speed(time)

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
        self._target = self._along(body.velocity(self.points)) + gained

    def violation(self, x: Array, v: Array, time: float) -> Array:
        """Return the velocity error; see `Constraint.violation`."""
        return self._along(v) - self._target

    def starting_velocities(self, v: Array, time: float, h: float) -> Array:
        """Return the velocities as they are; see `Constraint.starting_velocities`."""
        return v
