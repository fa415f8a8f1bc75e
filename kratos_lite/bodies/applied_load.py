"""What a load on a body is, and how loads of models become one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from kratos_lite.bodies.free_body import FreeBody
from kratos_lite.bodies.linear_algebra import NO_ENTRIES, Entries
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.model.loads import Load, TimeDependentLoad
from kratos_lite.model.loads.base import InTime
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.surface import Pressure
from kratos_lite.model.loads.temperature import Temperature
from kratos_lite.time_series import Factor, function_of
from kratos_lite.typing import Array

Generalized: TypeAlias = Callable[[Array, Array, float], Array]
"""Gives the generalized force (..., dofs) at a configuration, a velocity and a time."""
Tangent: TypeAlias = Callable[[Array, Array, float], Entries]
"""Gives the derivative of a generalized force with respect to q, in the velocities at rest."""


def no_potential(q: Array) -> Array:
    """Return no energy, for each body."""
    return np.zeros(q.shape[:-1])


@dataclass(eq=False)
class AppliedLoad:
    """A load as it acts on one body, of the generalized force for the amplitude 1."""

    generalized: Generalized
    acceleration: Array | None = None  # (3,) m/s² of gravity
    spatial: Array | None = None  # (..., dofs), if it is fixed in space
    follower: Array | None = None  # (..., dofs), if it is fixed in a rigid body
    tangent: Tangent = lambda q, u, time: NO_ENTRIES  # derivative by q of single deformable bodies
    potential_energy: Callable[[Array], Array] = no_potential  # (...) J
    follows_velocity: bool = False
    amplitude: Callable[[float], float] = lambda time: 1.0  # of the time in s
    steady: bool = True  # the amplitude never changes
    ends: tuple[Array, Array] | None = None  # of a spring, for pictures

    def __call__(self, q: Array, u: Array, time: float) -> Array:
        """Return the generalized force (..., dofs) at a configuration, a velocity and a time."""
        return self.amplitude(time) * self.generalized(q, u, time)

    def derivative(self, q: Array, u: Array, time: float) -> Entries:
        """Return the derivative of the generalized force with respect to q."""
        row, column, value = self.tangent(q, u, time)
        return row, column, self.amplitude(time) * value

    @property
    def is_constant(self) -> bool:
        """Whether compiled steps can take it as it is."""
        return self.steady and any(x is not None for x in (self.acceleration, self.spatial, self.follower))

    def potential(self, q: Array) -> Array:
        """Return the potential energy (...) in J; 0 for loads without one, or whose amplitude changes."""
        return self.amplitude(0.0) * self.potential_energy(q) if self.steady else no_potential(q)


class BodyLoad(ABC):
    """Something that pushes a body."""

    @abstractmethod
    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body in its configuration now; an error if it does not act on such a body."""


def apply_load(load: BodyLoad | Load, body: FreeBody, amplitude: Factor | None) -> AppliedLoad:
    """Return a load as it acts on a body, multiplied by an amplitude that may depend on the time."""
    function = function_of(1.0 if amplitude is None else amplitude, "the amplitude of a load")
    if isinstance(load, BodyLoad):
        applied = load.bind(body)
    elif not isinstance(load, Load):
        raise InputError(f"a load such as Gravity or Force is needed; got {type(load).__name__}")
    elif isinstance(load, Temperature):
        raise ModelError("a Temperature strains models; bodies in motion have none: leave it out")
    elif isinstance(load, Pressure) and load.follower:
        raise ModelError("a Pressure that follows a body in motion is a FollowerPressure; take that")
    elif isinstance(load, Gravity) and load.where is None and np.ndim(load.force) == 1:
        applied = _gravity(load.force, body)
    elif body.mesh is None:
        what = type(load).__name__
        raise ModelError(f"a {what} acts on a mesh; this body has none: use Force or Torque")
    else:
        applied = _on_nodes(load, body.mesh, body)
    applied.amplitude, applied.steady = function, not callable(amplitude)
    return applied


def _gravity(g: Array, body: FreeBody) -> AppliedLoad:
    """Return the weight: no torque about the mass center, whatever the body does."""
    weight = body.times_mass(body.translation(g))

    def potential(q: Array) -> Array:
        return np.asarray(-body.mass * (body.mass_center(q) @ g))

    return AppliedLoad(lambda q, u, t: weight, acceleration=g, potential_energy=potential)


def _on_nodes(load: Load, mesh: Mesh, body: FreeBody) -> AppliedLoad:
    """Return the nodal forces of the undeformed mesh, which keep their direction in space."""
    elements = body.elements()
    if isinstance(load, TimeDependentLoad):
        forces = InTime([load], lambda ones: ones[0].forces(mesh, elements))
        rest = np.zeros_like(mesh.points)
        return AppliedLoad(
            lambda q, u, t: body.generalized_nodal_force(sum((k * f for k, f in forces(t)), rest), q)
        )
    f = load.forces(mesh, elements)
    return AppliedLoad(
        lambda q, u, t: body.generalized_nodal_force(f, q),
        spatial=body.generalized_nodal_force(f, body.q) if body.jacobian_is_constant else None,
        potential_energy=lambda q: np.asarray(-(f * body.position(mesh.points, q)).sum(axis=(-2, -1))),
    )
