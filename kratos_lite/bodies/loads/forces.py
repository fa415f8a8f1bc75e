"""Forces on points, torques, and springs, which pull at points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.bodies.free_body import FreeBody
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
    frame : ``spatial`` keeps its direction in space, ``convected`` moves with the body (times Λ or F).
    """

    def __init__(self, point: ArrayLike, force: ArrayLike, frame: str = "spatial") -> None:
        self.point, self.force = one_point(point), vector_of(force, "a force")
        self.frame = _checked_frame(frame)

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body; MeshError if the point lies outside."""
        X, f = self.point, fitting(self.force, body.q.shape[:-1], 1, "a force")
        body.locate(X)
        if self.frame == "convected":
            return AppliedLoad(
                lambda q, u, t: body.generalized_force(X, body.convected(f, X, q), q),
                convected=body.body_fixed_force(X, f),
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
    frame : ``spatial`` keeps its direction in space, ``convected`` turns with the body.
    """

    def __init__(self, torque: ArrayLike, frame: str = "spatial") -> None:
        self.torque, self.frame = vector_of(torque, "a torque"), _checked_frame(frame)

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body; ModelError unless it is rigid."""
        t = fitting(self.torque, body.q.shape[:-1], 1, "a torque")
        body.generalized_torque(t, body.q)  # an error where bodies of the kind take none
        fixed = np.broadcast_to(np.concatenate([t, np.zeros_like(t)], axis=-1), body.u.shape)
        if self.frame == "convected":
            return AppliedLoad(lambda q, u, time: fixed, convected=fixed)
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

        def potential(q: Array) -> Array:
            if callable(self.stiffness):
                return no_potential(q)
            stretch = np.linalg.norm(body.position(X, q) - anchor, axis=-1) - L
            return np.asarray(self.stiffness * stretch**2 / 2)

        damped = callable(self.stiffness) or self.damping > 0
        return AppliedLoad(generalized, potential_energy=potential, follows_velocity=damped)

    def _pull(self, elongation: float, rate: float) -> float:
        if callable(self.stiffness):
            return float(self.stiffness(elongation, rate))
        return self.stiffness * elongation + self.damping * rate


def _checked_frame(frame: str) -> str:
    if frame not in FRAMES:
        raise InputError(f"frame must be 'spatial' or 'convected'; got {frame!r}")
    return frame


def _not_negative(value: float, what: str, unit: str) -> float:
    number = finite(value, f"the {what} of a spring")
    if number.ndim or number < 0:
        raise InputError(f"the {what} of a spring must be one number ≥ 0 {unit}; got {value}")
    return float(number)
