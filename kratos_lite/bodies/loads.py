"""Loads on bodies: forces and torques fixed in space or in the body, following pressure, springs, callbacks.

A load is bound to a body when it is added; what is bound gives the generalised force at any configuration.
Loads of models (gravity, tractions, dead pressure, …) act through their nodal forces, on every kind of body.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.arguments import finite
from kratos_lite.batches import add_nodal
from kratos_lite.bodies.body import Body, elements_of, points_of, vector_of
from kratos_lite.bodies.finite_element import FiniteElementBody
from kratos_lite.bodies.rigid import RigidBody
from kratos_lite.bodies.rigid_step import rotation
from kratos_lite.bodies.series import Factor, function_of
from kratos_lite.elements import surface_pressure
from kratos_lite.errors import InputError, ModelError
from kratos_lite.loads import Gravity, Load, outward
from kratos_lite.materials import Isotropic3D
from kratos_lite.mesh import Where

Array = NDArray[np.float64]
Generalised: TypeAlias = Callable[[Array, Array, float], Array]
"""Gives the generalised force (..., dofs) at a configuration, a velocity and a time."""
FRAMES = ("spatial", "convected")

__all__ = ["Bound", "Callback", "Factor", "FollowerPressure", "Force", "Spring", "Torque", "bind"]


def _no_potential(q: Array) -> Array:
    return np.zeros(q.shape[:-1])


@dataclass(eq=False)
class Bound:
    """A load on a body.

    Attributes
    ----------
    generalised : the generalised force for the factor 1.
    factor : function of the time in s.
    steady : whether the factor never changes.
    acceleration : (3,) m/s² if the load is gravity, alike everywhere.
    spatial, convected : generalised force (..., dofs) fixed in space, or in a rigid body, if that is all.
    potential_energy : of a conservative load for the factor 1, (...) in J.
    """

    generalised: Generalised
    factor: Callable[[float], float]
    steady: bool
    acceleration: Array | None = None
    spatial: Array | None = None
    convected: Array | None = None
    potential_energy: Callable[[Array], Array] = _no_potential

    @classmethod
    def constant(cls, mass: Array, acceleration: Array, spatial: Array, convected: Array) -> Bound:
        """Return constant loads on many bodies, for compiled steps alone."""

        def generalised(q: Array, u: Array, time: float) -> Array:
            raise ModelError("loads of many bodies are known only to steps that take them all at once")

        def potential(q: Array) -> Array:
            return np.asarray(-(mass * (acceleration * q[..., 9:]).sum(axis=-1)))

        return cls(generalised, lambda t: 1.0, True, acceleration, spatial, convected, potential)

    def __call__(self, q: Array, u: Array, time: float) -> Array:
        """Return the generalised force (..., dofs) at a configuration, a velocity and a time."""
        return self.factor(time) * self.generalised(q, u, time)

    @property
    def is_constant(self) -> bool:
        """Whether compiled steps can take it as it is."""
        return self.steady and any(x is not None for x in (self.acceleration, self.spatial, self.convected))

    def potential(self, q: Array) -> Array:
        """Return the potential energy (...) in J; 0 for loads without one, or whose factor changes."""
        return self.factor(0.0) * self.potential_energy(q) if self.steady else _no_potential(q)


class BodyLoad(ABC):
    """Something that pushes a body."""

    @abstractmethod
    def bind(self, body: Body, factor: Callable[[float], float], steady: bool) -> Bound:
        """Return the load on a body."""


def bind(load: BodyLoad | Load, body: Body, factor: Factor) -> Bound:
    """Return a load on a body, multiplied by a factor that may depend on the time."""
    function = function_of(factor, "the factor of a load")
    steady = not callable(factor)
    if isinstance(load, BodyLoad):
        return load.bind(body, function, steady)
    if not isinstance(load, Load):
        raise InputError(f"a load such as Gravity or Force is needed; got {type(load).__name__}")
    if isinstance(load, Gravity) and load.where is None and load.force.ndim == 1:
        return _gravity(load.force, body, function, steady)
    return _dead(load, body, function, steady)


def _gravity(g: Array, body: Body, factor: Callable[[float], float], steady: bool) -> Bound:
    """Return the weight: no torque about the mass centre, whatever the body does."""
    pull = body.times_mass(uniform(body, g))
    mass = body.mass

    def potential(q: Array) -> Array:
        if isinstance(body, FiniteElementBody):
            return np.asarray(-(pull @ q) - mass * (g @ body.center))
        return np.asarray(-mass * (q[..., 9:] @ g))

    return Bound(lambda q, u, t: pull, factor, steady, acceleration=g, potential_energy=potential)


def uniform(body: Body, v: Array) -> Array:
    """Return the velocity (..., dofs) with which a body moves without turning."""
    if isinstance(body, FiniteElementBody):
        return np.tile(v, len(body.points))
    out = np.zeros_like(body.u)
    out[..., -3:] = v
    return out


def _dead(load: Load, body: Body, factor: Callable[[float], float], steady: bool) -> Bound:
    """Return the nodal forces of the undeformed mesh, which keep their direction in space."""
    if body.mesh is None:
        raise ModelError(f"a {type(load).__name__} acts on a mesh; this body has none: use Force or Torque")
    batches = (
        body.batches
        if isinstance(body, FiniteElementBody)
        else elements_of(
            body.mesh, getattr(body, "material", None) or Isotropic3D(1.0, 0.0, float(body.mass))
        )
    )
    f = load.forces(body.mesh, batches)

    def potential(q: Array) -> Array:
        assert body.mesh is not None
        return np.asarray(-(f * body.position(body.mesh.points, q)).sum(axis=(-2, -1)))

    spatial = None if isinstance(body, RigidBody) else body.push_nodes(f, body.q)
    return Bound(
        lambda q, u, t: body.push_nodes(f, q), factor, steady, spatial=spatial, potential_energy=potential
    )


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

    def bind(self, body: Body, factor: Callable[[float], float], steady: bool) -> Bound:
        """Return the load on a body; MeshError if the point lies outside."""
        X, f = self.point, self.force
        body.find(X)
        if self.frame == "convected":
            fixed = body.push(X, f, _upright(body)) if isinstance(body, RigidBody) else None
            return Bound(
                lambda q, u, t: body.push(X, body.convected(f, X, q), q), factor, steady, convected=fixed
            )

        def potential(q: Array) -> Array:
            return np.asarray(-(f * body.position(X, q)).sum(axis=-1))

        central = not isinstance(body, RigidBody) or bool((np.abs(X - body.center) == 0).all())
        fixed = body.push(X, f, body.q) if central else None
        return Bound(
            lambda q, u, t: body.push(X, f, q), factor, steady, spatial=fixed, potential_energy=potential
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

    def bind(self, body: Body, factor: Callable[[float], float], steady: bool) -> Bound:
        """Return the load on a body; ModelError unless it is rigid."""
        if not isinstance(body, RigidBody):
            raise ModelError(
                f"a torque acts on rigid bodies; give a {body.kind} one a pair of forces at two points"
            )
        zero, t = np.zeros(3), self.torque
        fixed = np.broadcast_to(np.concatenate([t, zero]), body.u.shape)
        if self.frame == "convected":
            return Bound(lambda q, u, time: fixed, factor, steady, convected=fixed)

        def generalised(q: Array, u: Array, time: float) -> Array:
            T = (np.swapaxes(rotation(q), -1, -2) @ t[:, None])[..., 0]
            return np.concatenate([T, np.zeros_like(T)], axis=-1)

        return Bound(generalised, factor, steady, spatial=fixed)


class FollowerPressure(BodyLoad):
    """Pressure on faces of the deformed body: it follows their normals and areas.

    A positive pressure pushes into the body.  `kratos_lite.Pressure` is the dead one: normals and areas are
    those of the undeformed body (as in Solfec-1.0, whose sign is the other way round).

    Parameters
    ----------
    where : part; its conditions if it has any, otherwise the boundary faces among its nodes.
    pressure : Pa.
    """

    def __init__(self, where: Where, pressure: float) -> None:
        value = finite(pressure, "a pressure")
        if value.ndim:
            raise InputError(f"a pressure must be one number in Pa; got {pressure}")
        self.where, self.pressure = where, float(value)

    def bind(self, body: Body, factor: Callable[[float], float], steady: bool) -> Bound:
        """Return the load on a body; ModelError if there are no such faces."""
        mesh = body.mesh
        if mesh is None:
            raise ModelError("a pressure acts on the faces of a mesh; this body has none")
        blocks = [(block, self.pressure * outward(mesh, block)) for block in mesh.faces(self.where)]
        if not blocks:
            raise ModelError(f"a pressure finds no face on {self.where!r}")

        def nodal(x: Array) -> Array:
            total = np.zeros_like(x)
            for block, p in blocks:
                assert block.shape is not None
                add_nodal(total, block.nodes, surface_pressure(block.shape, x[block.nodes], p))
            return total

        def generalised(q: Array, u: Array, time: float) -> Array:
            if q.ndim > 1:
                raise ModelError("a following pressure acts on single bodies; march them one by one")
            return body.push_nodes(nodal(body.position(mesh.points, q)), q)

        return Bound(generalised, factor, steady)


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
        self.stiffness, self.damping, self.length = stiffness, damping, length
        if not callable(stiffness) and float(finite(stiffness, "the stiffness of a spring")) < 0:
            raise InputError(f"the stiffness of a spring must be ≥ 0 N/m; got {stiffness}")
        if float(finite(damping, "the damping of a spring")) < 0:
            raise InputError(f"the damping of a spring must be ≥ 0 N s/m; got {damping}")

    def bind(self, body: Body, factor: Callable[[float], float], steady: bool) -> Bound:
        """Return the load on a body; MeshError if the point lies outside."""
        X, anchor = self.point, self.anchor
        body.find(X)
        L = float(np.linalg.norm(body.position(X) - anchor)) if self.length is None else self.length

        def generalised(q: Array, u: Array, time: float) -> Array:
            if q.ndim > 1:
                raise ModelError("a spring acts on single bodies; march them one by one")
            y = body.position(X, q) - anchor
            distance = float(np.linalg.norm(y))
            direction = y / distance if distance > 0 else np.zeros(3)
            dofs, H = body.rows(X, q)
            rate = float(direction @ (H @ u[dofs]))
            return body.push(X, -self._pull(distance - L, rate) * direction, q)

        def potential(q: Array) -> Array:
            if callable(self.stiffness):
                return _no_potential(q)
            stretch = np.linalg.norm(body.position(X, q) - anchor, axis=-1) - L
            return np.asarray(self.stiffness * stretch**2 / 2)

        return Bound(generalised, factor, steady, potential_energy=potential)

    def _pull(self, elongation: float, rate: float) -> float:
        if callable(self.stiffness):
            return float(self.stiffness(elongation, rate))
        return self.stiffness * elongation + self.damping * rate


class Callback(BodyLoad):
    """A load of your own.

    Parameters
    ----------
    function : takes configuration q, velocity u and time t in s, and returns the generalised force
        (..., dofs); for a rigid body also nine numbers: spatial force, spatial and referential torque.

    Examples
    --------
    >>> import numpy as np
    >>> top = Callback(lambda q, u, t: np.r_[0, 0, 0, -20 * np.cross(q[6:9], [0, 0, 1]), 0, 0, 0])
    """

    def __init__(self, function: Callable[[Array, Array, float], ArrayLike]) -> None:
        if not callable(function):
            raise InputError(f"a callback is a function of q, u and t; got {function!r}")
        self.function = function

    def bind(self, body: Body, factor: Callable[[float], float], steady: bool) -> Bound:
        """Return the load on a body."""

        def generalised(q: Array, u: Array, time: float) -> Array:
            out = np.asarray(self.function(q, u, time), dtype=float)
            if isinstance(body, RigidBody) and out.shape == (*q.shape[:-1], 9):
                R = rotation(q)
                T = (np.swapaxes(R, -1, -2) @ out[..., 3:6, None])[..., 0] + out[..., 6:]
                return np.concatenate([T, out[..., :3]], axis=-1)
            if out.shape != u.shape:
                nine = " (or 9 numbers a body)" if isinstance(body, RigidBody) else ""
                raise InputError(
                    f"a callback must return a generalised force of shape {u.shape}{nine}; got {out.shape}"
                )
            if not np.isfinite(out).all():
                raise InputError(f"a callback returned numbers that are not finite at t = {time:g} s")
            return out

        return Bound(generalised, factor, steady)


def one_point(X: ArrayLike) -> Array:
    """Return one point (3,) as floats."""
    point = points_of(X)
    if point.ndim != 1:
        raise InputError(f"one point (3,) is needed; got shape {point.shape}")
    return point


def _upright(body: Body) -> Array:
    """Return configurations without rotation."""
    q = np.zeros_like(body.q)
    q[..., [0, 4, 8]] = 1.0
    return q


def _checked_frame(frame: str) -> str:
    if frame not in FRAMES:
        raise InputError(f"frame must be 'spatial' or 'convected'; got {frame!r}")
    return frame
