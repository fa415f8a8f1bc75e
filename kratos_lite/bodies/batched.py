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
from kratos_lite.validation import short


def batch(bodies: Sequence[Body]) -> Body:
    """Return bodies that form one batch as one object; q and u of each become rows of those of the batch."""
    groups, first = groups_of(bodies), bodies[0]
    if len(groups) > 1 or not forms_batch(first):
        raise ModelError(
            f"body {bodies.index(groups[-1][0])} does not form a batch with the others: a batch has rigid or "
            "pseudo-rigid bodies of one kind, integrator, damping and tolerance, without constraints, and "
            "with loads that change neither with the time nor as they turn; kl.integrate takes any list"
        )
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


def groups_of(bodies: Sequence[Body]) -> list[list[Body]]:
    """Return the bodies of a list in groups: those that form a batch together, any other alone."""
    if not isinstance(bodies, Sequence) or isinstance(bodies, str):
        raise InputError(
            f"a body or a sequence of bodies is needed; got {type(bodies).__name__}; of a model: transient() "
            "or quasi_static()"
        )
    if not bodies:
        raise InputError("there is no body to advance")
    groups: dict[object, list[Body]] = {}
    for row, body in enumerate(bodies):
        if not isinstance(body, Body):
            raise InputError(f"a list to advance holds bodies alone; body {row} is {short(body)}")
        if (body.time, body.step) != (bodies[0].time, bodies[0].step):
            raise InputError(
                f"bodies of a list need the same time and number of steps: body 0 is at {bodies[0].time:g} s "
                f"after {bodies[0].step}, body {row} at {body.time:g} s after {body.step}"
            )
        settings = (type(body), body.integrator, body.damping, getattr(body, "tolerance", None))
        groups.setdefault(settings if forms_batch(body) else row, []).append(body)
    if len({id(body) for body in bodies}) < len(bodies):
        raise InputError("a body occurs twice in a list")
    return list(groups.values())


def forms_batch(body: Body) -> bool:
    """Return whether others that are alike can advance with a body on common arrays."""
    return (
        isinstance(body, (RigidBody, PseudoRigidBody))
        and body.q.ndim == 1
        and not body.constraints
        and all(load.is_constant for load in body.loads)
    )


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
