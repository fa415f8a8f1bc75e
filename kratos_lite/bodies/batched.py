"""A batch: many bodies as one, whose vectors are rows of common arrays."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from kratos_lite.bodies.applied_load import AppliedLoad
from kratos_lite.bodies.body import Body
from kratos_lite.bodies.free_body import Clock
from kratos_lite.bodies.pseudo_rigid import PseudoRigidBody
from kratos_lite.bodies.rigid import RigidBody
from kratos_lite.errors import InputError, ModelError
from kratos_lite.model.mass_properties import MassProperties
from kratos_lite.typing import Array


def batch(bodies: Sequence[Body]) -> Body:
    """Return bodies of one kind as one object; q and u of each become rows of those of the batch."""
    if not isinstance(bodies, Sequence):
        raise InputError(
            f"a body or a sequence of bodies is needed; got {type(bodies).__name__}; of a model: transient()"
        )
    first = _alike(bodies)
    whole = copy(first)
    vars(whole).pop("_inverse", None)  # of the inertia of the first
    whole.mesh, whole.clock = None, Clock(first.time, first.step)
    whole.mass_properties = MassProperties.stack([body.mass_properties for body in bodies])
    if isinstance(whole, PseudoRigidBody):
        whole.C = np.stack([body.C for body in bodies if isinstance(body, PseudoRigidBody)])
    whole.q, whole.u = np.stack([body.q for body in bodies]), np.stack([body.u for body in bodies])
    whole.external_work = np.array([body.external_work for body in bodies])
    whole.loads = _loads(bodies)
    for row, body in enumerate(bodies):
        body.q, body.u, body.clock = whole.q[row], whole.u[row], whole.clock
        body.external_work = whole.external_work[row, ...]
    return whole


def _alike(bodies: Sequence[Body]) -> Body:
    """Return the first body; raise unless all others can advance with it."""
    if not bodies:
        raise InputError("there is no body to advance")
    first = bodies[0]
    for row, body in enumerate(bodies):
        if not isinstance(body, (RigidBody, PseudoRigidBody)) or body.q.ndim != 1:
            raise ModelError(
                f"body {row} is {body!r}: only single rigid and pseudo-rigid bodies form a batch"
            )
        for what in ("kind", "integrator", "damping", "time", "step"):
            if getattr(body, what) != getattr(first, what):
                raise InputError(
                    f"bodies of a batch need the same {what}: body 0 has {getattr(first, what)!r}, "
                    f"body {row} {getattr(body, what)!r}"
                )
        if body.constraints or not all(load.is_constant for load in body.loads):
            raise ModelError(
                f"body {row} has constraints or loads that change with the time, or as it turns, as the "
                "moment of a spatial force off the mass center does; only bodies with constant loads form a "
                "batch: integrate it alone"
            )
    if len({id(body) for body in bodies}) < len(bodies):
        raise InputError("a body occurs twice in a batch")
    return first


def _loads(bodies: Sequence[Body]) -> list[AppliedLoad]:
    """Return the constant loads of all bodies as one, which compiled steps alone take."""
    if not any(body.loads for body in bodies):
        return []
    loads = [body.constant_loads() for body in bodies]
    acceleration, spatial, follower = (np.array(parts) for parts in zip(*loads, strict=True))
    mass = np.array([body.mass for body in bodies])

    def generalized(q: Array, u: Array, time: float) -> Array:
        raise ModelError("loads of a batch are known only to steps that take them all at once")

    def potential(q: Array) -> Array:
        return np.asarray(-(mass * (acceleration * q[..., 9:]).sum(axis=-1)))

    return [AppliedLoad(generalized, acceleration, spatial, follower, potential_energy=potential)]
