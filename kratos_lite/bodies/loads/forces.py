"""Forces on points, torques, springs, which pull at points, and functions of the user."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.bodies.free_body import FreeBody
from kratos_lite.bodies.linear_algebra import Entries, block_entries
from kratos_lite.bodies.loads.base import FRAMES, AppliedLoad, BodyLoad, no_potential
from kratos_lite.bodies.validation import fitting, one_point, vector_of
from kratos_lite.errors import InputError, ModelError
from kratos_lite.typing import Array
from kratos_lite.validation import finite


class Force(BodyLoad):
    """A force on a material point.

    Parameters
    ----------
    point : (3,) m, in the undeformed body.
    force : (3,) N.
    frame : ``spatial`` keeps its direction in space, ``follower`` moves with the body (times Λ or F).
    """

    def __init__(self, point: ArrayLike, force: ArrayLike, frame: str = "spatial") -> None:
        self.point, self.force = one_point(point), vector_of(force, "a force")
        self.frame = _checked_frame(frame)

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body; MeshError if the point lies outside."""
        X, f = self.point, fitting(self.force, body.q.shape[:-1], 1, "a force")
        body.locate(X)
        if self.frame == "follower":
            return AppliedLoad(
                lambda q, u, t: body.generalized_force(X, body.push_forward(f, X, q), q),
                follower=body.body_fixed_force(X, f),
                tangent=lambda q, u, t: _follower_tangent(body, X, f, q),
            )
        central = body.jacobian_is_constant or bool((np.abs(X - body.center) == 0).all())
        return AppliedLoad(
            lambda q, u, t: body.generalized_force(X, f, q),
            spatial=body.generalized_force(X, f, body.q) if central else None,
            potential_energy=lambda q: np.asarray(-(f * body.position(X, q)).sum(axis=-1)),
        )


class Torque(BodyLoad):
    """A torque on a rigid body.

    Parameters
    ----------
    torque : (3,) N m.
    frame : ``spatial`` keeps its direction in space, ``follower`` turns with the body.
    """

    def __init__(self, torque: ArrayLike, frame: str = "spatial") -> None:
        self.torque, self.frame = vector_of(torque, "a torque"), _checked_frame(frame)

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body; ModelError unless it is rigid."""
        t = fitting(self.torque, body.q.shape[:-1], 1, "a torque")
        body.generalized_torque(t, body.q)  # an error where bodies of the kind take none
        fixed = np.broadcast_to(np.concatenate([t, np.zeros_like(t)], axis=-1), body.u.shape)
        if self.frame == "follower":
            return AppliedLoad(lambda q, u, time: fixed, follower=fixed)
        return AppliedLoad(lambda q, u, time: body.generalized_torque(t, q), spatial=fixed)


class Spring(BodyLoad):
    """A spring, with a damper if wanted, from a material point to a fixed point in space.

    Parameters
    ----------
    point : (3,) m, in the undeformed body.
    anchor : (3,) m, in space.
    stiffness : N/m, or a function (elongation in m, its rate in m/s) that gives the pull in N.
    damping : N s/m.
    length : natural length in m; that at the start if not given.
    """

    def __init__(
        self,
        point: ArrayLike,
        anchor: ArrayLike,
        stiffness: float | Callable[[float, float], float],
        damping: float = 0.0,
        length: float | None = None,
    ) -> None:
        self.point, self.anchor = one_point(point), one_point(anchor)
        self.stiffness = stiffness if callable(stiffness) else _not_negative(stiffness, "stiffness", "N/m")
        self.damping = _not_negative(damping, "damping", "N s/m")
        self.length = None if length is None else _not_negative(length, "length", "m")

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body; MeshError if the point lies outside."""
        X, anchor = self.point, self.anchor
        body.locate(X)
        L = float(np.linalg.norm(body.position(X) - anchor)) if self.length is None else self.length

        def generalized(q: Array, u: Array, time: float) -> Array:
            if q.ndim > 1:
                raise ModelError("a spring acts on single bodies; integrate them one by one")
            y = body.position(X, q) - anchor
            distance = float(np.linalg.norm(y))
            direction = y / distance if distance > 0 else np.zeros(3)
            dofs, H = body.jacobian(X, q)
            rate = float(direction @ (H @ u[dofs]))
            return body.generalized_force(X, -self._pull(distance - L, rate) * direction, q)

        def tangent(q: Array, u: Array, time: float) -> Entries:
            y = body.position(X, q) - anchor
            distance = float(np.linalg.norm(y))
            dofs, H = body.jacobian(X, q)
            n = y / distance if distance > 0 else np.zeros(3)
            along, across = self._stiffness(distance - L, float(n @ (H @ u[dofs])), distance)
            push = -across * np.eye(3) - (along - across) * np.outer(n, n)
            return block_entries(dofs, dofs, H.T @ push @ H)

        def potential(q: Array) -> Array:
            if callable(self.stiffness):
                return no_potential(q)
            stretch = np.linalg.norm(body.position(X, q) - anchor, axis=-1) - L
            return np.asarray(self.stiffness * stretch**2 / 2)

        damped = callable(self.stiffness) or self.damping > 0
        return AppliedLoad(
            generalized,
            tangent=tangent,
            potential_energy=potential,
            follows_velocity=damped,
            ends=(X, anchor),
        )

    def _stiffness(self, elongation: float, rate: float, distance: float) -> tuple[float, float]:
        """Return the derivative of the pull along the spring, and across it, at rest, in N/m."""
        if callable(self.stiffness):
            h = 1e-6 * max(distance, abs(elongation), 1e-12)
            along = (self._pull(elongation + h, rate) - self._pull(elongation - h, rate)) / (2 * h)
        else:
            along = self.stiffness
        return along, self._pull(elongation, rate) / distance if distance > 0 else along

    def _pull(self, elongation: float, rate: float) -> float:
        if callable(self.stiffness):
            return float(self.stiffness(elongation, rate))
        return self.stiffness * elongation + self.damping * rate


class Callback(BodyLoad):
    """A load of your own.

    Parameters
    ----------
    function : takes configuration q, velocity u and time t in s, and returns the generalized force
        (..., dofs); for a rigid body also nine numbers: spatial force, spatial and referential torque.
    of_velocity : whether it depends on u; then each step is taken twice, with the old velocity and with the
        mean of old and new.

    Raises
    ------
    InputError
        It is not a function.

    Examples
    --------
    >>> import numpy as np
    >>> top = Callback(lambda q, u, t: np.r_[0, 0, 0, -20 * np.cross(q[6:9], [0, 0, 1]), 0, 0, 0])
    """

    def __init__(
        self, function: Callable[[Array, Array, float], ArrayLike], *, of_velocity: bool = True
    ) -> None:
        if not callable(function):
            raise InputError(f"a callback is a function of q, u and t; got {function!r}")
        self.function, self.of_velocity = function, bool(of_velocity)

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body."""

        def generalized(q: Array, u: Array, time: float) -> Array:
            out = finite(self.function(q, u, time), f"what a callback returns at t = {time:g} s")
            if body.takes_torques and out.shape == (*q.shape[:-1], 9):
                total = body.generalized_torque(out[..., 3:6], q)
                total[..., :3] += out[..., 6:]
                total[..., 3:] = out[..., :3]
                return total
            if out.shape != u.shape:
                nine = " (or 9 numbers a body)" if body.takes_torques else ""
                raise InputError(
                    f"a callback must return a generalized force of shape {u.shape}{nine}; got {out.shape}"
                )
            return out

        return AppliedLoad(generalized, follows_velocity=self.of_velocity)


def _follower_tangent(body: FreeBody, X: Array, force: Array, q: Array) -> Entries:
    """Return the derivative of a force that moves with a body, whose F is linear in q."""
    dofs, H = body.jacobian(X, q)
    zero = np.zeros_like(q)
    columns = []
    for dof in dofs:
        one = zero.copy()
        one[dof] = 1.0
        columns.append(body.push_forward(force, X, one) - body.push_forward(force, X, zero))
    return block_entries(dofs, dofs, H.T @ np.transpose(columns))


def _checked_frame(frame: str) -> str:
    if frame not in FRAMES:
        raise InputError(f"frame must be 'spatial' or 'follower'; got {frame!r}")
    return frame


def _not_negative(value: float, what: str, unit: str) -> float:
    number = finite(value, f"the {what} of a spring")
    if number.ndim or number < 0:
        raise InputError(f"the {what} of a spring must be one number ≥ 0 {unit}; got {value}")
    return float(number)
