"""Constraints on a single body: fixed points and directions, prescribed motions, rigid links.

A constraint has rows H, along which its reactions push, and a gap, which a step closes.  The gap is taken at
the end of the step: a point that is fixed stays where it is, and a link keeps its length, to round-off.

Source: Solfec-1.0 user manual, constraints; its velocity-level laws are replaced by those of positions.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.bodies.free_body import FreeBody
from kratos_lite.bodies.linear_algebra import Entries
from kratos_lite.bodies.validation import one_point, points_of, vector_of
from kratos_lite.errors import InputError, ModelError
from kratos_lite.time_series import Factor, function_of, integral_of
from kratos_lite.typing import Array

Points: TypeAlias = "str | Callable[[Array], ArrayLike] | ArrayLike"
"""Points (3,) or (m, 3) in m of the undeformed body; or nodes by a part of the mesh or a predicate."""
SHORT = 1e-3
"""Share of a step over which the slope of a displacement is taken."""


class Constraint(ABC):
    """Something that holds material points of a body.

    Attributes
    ----------
    points : (m, 3) m, in the undeformed body.
    positional : whether it is about positions, so that it also holds a body at rest.
    turning : whether its directions change as the body moves.
    reactions : (m, 3) N, mean force on the points over the last step.
    """

    positional = True
    turning = False

    def __init__(self, points: Points) -> None:
        self._where = points if isinstance(points, str) or callable(points) else None
        self._hold(np.zeros((1, 3)) if isinstance(points, str) or callable(points) else points_of(points))
        self._body: FreeBody | None = None
        self._jacobian: Array | None = None

    def _hold(self, points: Array) -> None:
        """Take note of the points."""
        self.points = np.atleast_2d(points)
        if not len(self.points):
            raise InputError(f"a {type(self).__name__} needs one point at least; got none")
        self.reactions = np.zeros_like(self.points)

    def bind(self, body: FreeBody) -> None:
        """Take hold of a body where it is now.

        Parameters
        ----------
        body : a single one.

        Raises
        ------
        MeshError
            A point lies outside the body.
        ModelError
            The body is many bodies, or the constraint holds another one already.
        InputError
            The part has no nodes.
        """
        if body.q.ndim > 1:
            raise ModelError("a constraint holds a single body; march bodies with constraints one by one")
        if self._body is not None and self._body is not body:
            raise ModelError("this constraint holds another body already; make one for each body")
        if self._where is not None:
            if body.mesh is None:
                raise ModelError("nodes are chosen from a mesh, and this body has none; give points (m, 3)")
            self._hold(body.mesh.points[body.mesh.nodes(self._where)])
        body.locate(self.points)
        self._body, self._start = body, body.position(self.points)

    def begin(self, body: FreeBody, h: float) -> None:  # noqa: B027 - most have nothing to prepare
        """Prepare a step from the state of the body.

        Parameters
        ----------
        body : the one that is held.
        h : length of the step in s.
        """

    @abstractmethod
    def directions(self, x: Array) -> Array:
        """Return the directions along which points are held.

        Parameters
        ----------
        x : (m, 3) where the points are, in m.

        Returns
        -------
        (m, r, 3), r for each point.
        """

    @abstractmethod
    def gap(self, x: Array, v: Array, time: float, h: float) -> Array:
        """Return by how much points miss where they should be.

        Lengths are divided by h/2, the time in which the velocity at the end of a step closes them.

        Parameters
        ----------
        x, v : (m, 3) positions in m and velocities in m/s.
        time, h : end and length of the step in s.

        Returns
        -------
        (m, r) in m/s.
        """

    def starting_velocities(self, v: Array, time: float, h: float) -> Array:
        """Return the velocities along the directions with which points start.

        Parameters
        ----------
        v : (m, r) those that they have, in m/s.
        time, h : the start, and the length of the steps, in s.

        Returns
        -------
        (m, r) in m/s.
        """
        return np.zeros_like(v)

    def jacobian_entries(self, body: FreeBody, q: Array) -> Entries:
        """Return the entries of H (m r, dofs): points move along their directions with H u.

        Parameters
        ----------
        body : the one that is held.
        q : its configuration.

        Returns
        -------
        Rows, dofs and values.
        """
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
        """Return H as a full matrix; it is kept where it is always the same.

        Parameters
        ----------
        body : the one that is held.
        q : its configuration.

        Returns
        -------
        (m r, dofs).
        """
        if self._jacobian is not None:
            return self._jacobian
        row, dof, value = self.jacobian_entries(body, q)
        H = np.zeros((self.count, body.dofs))
        H[row, dof] = value
        if body.jacobian_is_constant and not self.turning:
            self._jacobian = H
        return H

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.points)

    def gaps(self, body: FreeBody, q: Array, u: Array, time: float, h: float) -> Array:
        """Return the gaps at the end of a step.

        Parameters
        ----------
        body : the one that is held.
        q, u : its configuration and velocity.
        time, h : end and length of the step in s.

        Returns
        -------
        (m r,) in m/s; see `gap`.
        """
        x, v = body.position(self.points, q), body.velocity(self.points, q, u)
        return self.gap(x, v, time, h).ravel()

    def set_reactions(self, body: FreeBody, q: Array, multipliers: Array) -> None:
        """Note the reactions of a step.

        Parameters
        ----------
        body : the one that is held.
        q : its configuration.
        multipliers : (m r,) in N.
        """
        directions = self.directions(body.position(self.points, q))
        self.reactions = np.einsum("mr,mri->mi", multipliers.reshape(directions.shape[:2]), directions)


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


class Along(Constraint):
    """A constraint along one direction fixed in space.

    Parameters
    ----------
    points : (3,) or (m, 3) m, in the undeformed body; or a part or side of the mesh (``"x-"``), or a
        predicate on its points (n, 3), for the nodes there.
    direction : (3,), of any length but 0.
    """

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
        return np.asarray((x - self._start) @ self.direction)[:, None]


class FixDirection(Along):
    """Points that do not move along a direction, but are free across it."""

    def gap(self, x: Array, v: Array, time: float, h: float) -> Array:
        """Return how far the points have moved; see `Constraint.gap`."""
        return self._moved(x) * (2 / h)


class PrescribedDisplacement(Along):
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


class PrescribedVelocity(Along):
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
        """Return the velocity that is missing; see `Constraint.gap`."""
        return np.asarray(v @ self.direction)[:, None] - self.speed(time)

    def starting_velocities(self, v: Array, time: float, h: float) -> Array:
        """Return the velocity at a time; see `Constraint.starting_velocities`."""
        return np.full_like(v, self.speed(time))


class PrescribedAcceleration(Along):
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
        """Return the velocity that is missing; see `Constraint.gap`."""
        return np.asarray(v @ self.direction)[:, None] - self._target

    def starting_velocities(self, v: Array, time: float, h: float) -> Array:
        """Return the velocities as they are; see `Constraint.starting_velocities`."""
        return v


class RigidLink(Constraint):
    """A rod without mass from a material point to a fixed point in space.

    Parameters
    ----------
    point : (3,) m, in the undeformed body.
    anchor : (3,) m, in space.

    The length is the distance at the time when the constraint is made.
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

    def gap(self, x: Array, v: Array, time: float, h: float) -> Array:
        """Return by how much the link is too long; see `Constraint.gap`."""
        stretch = np.linalg.norm(x - self.anchor, axis=1) - self.length
        return np.asarray(stretch[:, None] * (2 / h))
