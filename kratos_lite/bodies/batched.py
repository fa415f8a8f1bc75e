"""Many bodies as one: their vectors stand in common arrays, which advance together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.bodies.body import Body
from kratos_lite.bodies.free_body import Clock
from kratos_lite.bodies.loads import AppliedLoad
from kratos_lite.bodies.pseudo_rigid import PseudoRigidBody
from kratos_lite.bodies.rigid import FixedBody, RigidBody
from kratos_lite.errors import InputError, ModelError
from kratos_lite.model.mass_properties import MassProperties


def batch(bodies: Sequence[Body]) -> Body:
    """Return bodies of one kind as one object; q and u of each become rows of those of the whole."""
    if not isinstance(bodies, Sequence):
        raise InputError(
            f"a body or a sequence of bodies is needed; got {type(bodies).__name__}; of a model: transient()"
        )
    members = list(bodies)
    first = _alike(members)
    mass_properties = MassProperties.stack([body.mass_properties for body in members])
    whole: RigidBody | PseudoRigidBody
    if isinstance(first, PseudoRigidBody):
        whole = PseudoRigidBody(
            material=first.material,
            mass_properties=mass_properties,
            integrator=first.integrator,
            damping=first.damping,
            tolerance=first.tolerance,
        )
        whole.C = np.stack([body.C for body in members if isinstance(body, PseudoRigidBody)])
    else:
        assert isinstance(first, RigidBody)
        kind = FixedBody if isinstance(first, FixedBody) else RigidBody
        whole = kind.__new__(kind)
        RigidBody.__init__(
            whole, mass_properties=mass_properties, integrator=first.integrator, tolerance=first.tolerance
        )
    whole.clock = Clock(first.time, first.step)
    whole.external_work = np.array([body.external_work for body in members])
    for row, body in enumerate(members):
        whole.q[row], whole.u[row] = body.q, body.u
        body.q, body.u, body.clock = whole.q[row], whole.u[row], whole.clock
        body.external_work = whole.external_work[row, ...]
    whole.loads = _loads(members)
    return whole


def _alike(members: Sequence[Body]) -> Body:
    """Return the first body; raise unless all others can advance with it."""
    if not members:
        raise InputError("there is no body to advance")
    first = members[0]
    for row, body in enumerate(members):
        if not isinstance(body, (RigidBody, PseudoRigidBody)) or body.q.ndim != 1:
            raise ModelError(
                f"body {row} is {body!r}: only single rigid and pseudo-rigid bodies advance together"
            )
        for what in ("kind", "integrator", "damping", "time", "step"):
            if getattr(body, what) != getattr(first, what):
                raise InputError(
                    f"bodies that advance together need the same {what}: "
                    f"body 0 has {getattr(first, what)!r}, "
                    f"body {row} {getattr(body, what)!r}"
                )
        if body.constraints or not all(load.is_constant for load in body.loads):
            raise ModelError(
                f"body {row} has constraints or loads that change with the time, or as it turns, as the "
                "moment of a spatial force off the mass center does; only bodies with constant loads advance "
                "together: integrate it alone"
            )
    if len({id(body) for body in members}) < len(members):
        raise InputError("a body occurs twice among those to advance together")
    return first


def _loads(members: Sequence[Body]) -> list[AppliedLoad]:
    """Return the constant loads of all bodies: accelerations, and forces fixed in space and in the bodies."""
    if not any(body.loads for body in members):
        return []
    loads = [body.constant_loads() for body in members]
    acceleration, spatial, follower = (np.array(parts) for parts in zip(*loads, strict=True))
    mass = np.array([body.mass for body in members])
    return [AppliedLoad.constant(mass, acceleration, spatial, follower)]
