"""What a load on a body is, and how loads of models become one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from kratos_lite.bodies.body import Body
from kratos_lite.bodies.finite_element import FiniteElementBody
from kratos_lite.bodies.rigid import RigidBody
from kratos_lite.bodies.validation import elements_of
from kratos_lite.errors import InputError, ModelError
from kratos_lite.materials import Isotropic3D
from kratos_lite.model.loads import Gravity, Load
from kratos_lite.time_series import Factor, function_of
from kratos_lite.typing import Array

Generalized: TypeAlias = Callable[[Array, Array, float], Array]
"""Gives the generalized force (..., dofs) at a configuration, a velocity and a time."""
FRAMES = ("spatial", "convected")


def no_potential(q: Array) -> Array:
    """Return no energy, for each body."""
    return np.zeros(q.shape[:-1])


@dataclass(eq=False)
class Bound:
    """A load on a body.

    Attributes
    ----------
    generalized : the generalized force for the amplitude 1.
    amplitude : function of the time in s.
    steady : whether the amplitude never changes.
    acceleration : (3,) m/s² if the load is gravity, alike everywhere.
    spatial, convected : generalized force (..., dofs) fixed in space, or in a rigid body, if that is all.
    potential_energy : of a conservative load for the amplitude 1, (...) in J.
    follows_velocity : whether it may depend on the velocity.
    """

    generalized: Generalized
    amplitude: Callable[[float], float]
    steady: bool
    acceleration: Array | None = None
    spatial: Array | None = None
    convected: Array | None = None
    potential_energy: Callable[[Array], Array] = no_potential
    follows_velocity: bool = False

    @classmethod
    def constant(cls, mass: Array, acceleration: Array, spatial: Array, convected: Array) -> Bound:
        """Return constant loads on many bodies, for compiled steps alone."""

        def generalized(q: Array, u: Array, time: float) -> Array:
            raise ModelError("loads of many bodies are known only to steps that take them all at once")

        def potential(q: Array) -> Array:
            return np.asarray(-(mass * (acceleration * q[..., 9:]).sum(axis=-1)))

        return cls(generalized, lambda t: 1.0, True, acceleration, spatial, convected, potential)

    def __call__(self, q: Array, u: Array, time: float) -> Array:
        """Return the generalized force (..., dofs) at a configuration, a velocity and a time."""
        return self.amplitude(time) * self.generalized(q, u, time)

    @property
    def is_constant(self) -> bool:
        """Whether compiled steps can take it as it is."""
        return self.steady and any(x is not None for x in (self.acceleration, self.spatial, self.convected))

    def potential(self, q: Array) -> Array:
        """Return the potential energy (...) in J; 0 for loads without one, or whose amplitude changes."""
        return self.amplitude(0.0) * self.potential_energy(q) if self.steady else no_potential(q)


class BodyLoad(ABC):
    """Something that pushes a body."""

    @abstractmethod
    def bind(self, body: Body, amplitude: Callable[[float], float], steady: bool) -> Bound:
        """Return the load on a body."""


def bind(load: BodyLoad | Load, body: Body, amplitude: Factor) -> Bound:
    """Return a load on a body, multiplied by an amplitude that may depend on the time."""
    function = function_of(amplitude, "the amplitude of a load")
    steady = not callable(amplitude)
    if isinstance(load, BodyLoad):
        return load.bind(body, function, steady)
    if not isinstance(load, Load):
        raise InputError(f"a load such as Gravity or Force is needed; got {type(load).__name__}")
    if isinstance(load, Gravity) and load.where is None and load.force.ndim == 1:
        return _gravity(load.force, body, function, steady)
    return _dead(load, body, function, steady)


def _gravity(g: Array, body: Body, amplitude: Callable[[float], float], steady: bool) -> Bound:
    """Return the weight: no torque about the mass center, whatever the body does."""
    pull = body.times_mass(uniform(body, g))
    mass = body.mass

    def potential(q: Array) -> Array:
        if isinstance(body, FiniteElementBody):
            return np.asarray(-(pull @ q) - mass * (g @ body.center))
        return np.asarray(-mass * (q[..., 9:] @ g))

    return Bound(lambda q, u, t: pull, amplitude, steady, acceleration=g, potential_energy=potential)


def uniform(body: Body, v: Array) -> Array:
    """Return the velocity (..., dofs) with which a body moves without turning."""
    if isinstance(body, FiniteElementBody):
        return np.tile(v, len(body.points))
    out = np.zeros_like(body.u)
    out[..., -3:] = v
    return out


def _dead(load: Load, body: Body, amplitude: Callable[[float], float], steady: bool) -> Bound:
    """Return the nodal forces of the undeformed mesh, which keep their direction in space."""
    if body.mesh is None:
        raise ModelError(f"a {type(load).__name__} acts on a mesh; this body has none: use Force or Torque")
    groups = (
        body.groups
        if isinstance(body, FiniteElementBody)
        else elements_of(
            body.mesh, getattr(body, "material", None) or Isotropic3D(1.0, 0.0, float(body.mass))
        )
    )
    f = load.forces(body.mesh, groups)

    def potential(q: Array) -> Array:
        assert body.mesh is not None
        return np.asarray(-(f * body.position(body.mesh.points, q)).sum(axis=(-2, -1)))

    spatial = None if isinstance(body, RigidBody) else body.generalized_nodal_force(f, body.q)
    return Bound(
        lambda q, u, t: body.generalized_nodal_force(f, q),
        amplitude,
        steady,
        spatial=spatial,
        potential_energy=potential,
    )


def upright(body: Body) -> Array:
    """Return configurations without rotation."""
    q = np.zeros_like(body.q)
    q[..., [0, 4, 8]] = 1.0
    return q


def checked_frame(frame: str) -> str:
    """Return the name of a frame; InputError if it is none."""
    if frame not in FRAMES:
        raise InputError(f"frame must be 'spatial' or 'convected'; got {frame!r}")
    return frame
