"""Conversion: the same body, in the same motion, as another kind."""

from __future__ import annotations

import logging
from inspect import signature
from typing import Any, TypeVar, overload

import numpy as np

from kratos_lite.bodies.body import BODIES, Body, Deformable
from kratos_lite.bodies.rigid import FixedBody
from kratos_lite.bodies.rotations import polar
from kratos_lite.bodies.validation import mass_properties_of
from kratos_lite.errors import InputError, ModelError
from kratos_lite.typing import Array
from kratos_lite.validation import instance

_log = logging.getLogger("kratos_lite")
ROUND_OFF = 1e-12
"""Fraction of the angular momentum that is not worth a correction."""
SAME_SHAPE = 1e-9
"""Fraction of the size of a body by which nodes of the same shape may differ."""

Kind = TypeVar("Kind", bound=Body)


@overload
def convert(body: Body, kind: type[Kind], **options: Any) -> Kind: ...
@overload
def convert(body: Body, kind: str, **options: Any) -> Body: ...
def convert(body: Body, kind: Any, **options: Any) -> Any:
    """Return the body as another kind, in the motion that this kind can have.

    A rigid one gets the rotation by polar decomposition; a pseudo-rigid one the affine motion that is nearest
    with respect to mass; a finite-element one the affine motion.  Linear and angular momentum stay as they
    are: where mass is distributed otherwise, a rotation is added to the velocity.

    Mass properties that were given, damping, integrator, tolerance and further arguments of the body go along
    where the kind takes them; `options` replace them.  Loads and constraints do not: they are bound to the
    body that they were added to.  What does not go along is logged as a warning.

    Parameters
    ----------
    body : a single body with a mesh and a material.
    kind : `RigidBody`, `PseudoRigidBody` or `FiniteElementBody`, or its word such as ``"rigid"``.
    options : further arguments of the kind, such as ``formulation="corotational"``.

    Returns
    -------
    A new body.

    Raises
    ------
    InputError, ModelError
        What is given is no body, the kind is unknown, the body has no mesh, or its mass properties were given
        and are not those of the mesh that a finite-element body takes them from.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> rigid = kl.RigidBody(kl.box((0.4, 0.6, 1.0)), kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0))
    >>> rigid.set_velocity(angular=(0.05, 10, 0.05))
    >>> soft = convert(rigid, kl.FiniteElementBody)
    >>> print(f"{rigid.kinetic_energy():.3f} J, {soft.kinetic_energy():.3f} J")
    1160.047 J, 1160.047 J
    """
    instance(body, "what is converted", Body, "kl.RigidBody(mesh, material)")
    if isinstance(kind, str):
        kind = BODIES[kind]
    if not (isinstance(kind, type) and issubclass(kind, Body)) or issubclass(kind, FixedBody):
        raise InputError(f"a body becomes a RigidBody, PseudoRigidBody or FiniteElementBody; got {kind!r}")
    if isinstance(body, FixedBody):
        raise ModelError("a fixed body has no mass, so it does not become another kind; make a new body")
    if body.q.ndim > 1 or body.mesh is None or body.material is None:
        raise ModelError(f"only a single body with a mesh and a material changes its kind; got {body!r}")
    other = _made(body, kind, options)
    F, rate, center = body.affine_motion()
    other.set_affine_motion(F, rate, center, body.linear_momentum() / body.mass)
    _turn(other, body.angular_momentum())
    other.time, other.step = body.time, body.step
    other.external_work = np.array(body.external_work)
    if isinstance(other, Deformable):  # that a rigid body has no deformation goes without saying
        _warn_of_lost_shape(body, other, F, center)
    for what, items in (("loads", body.loads), ("constraints", body.constraints)):
        if items:
            _log.warning("%d %s of the %s body do not go along; add them anew", len(items), what, body.kind)
    return other


def _made(body: Body, kind: type[Body], options: dict[str, Any]) -> Body:
    """Return a new body at rest with the settings of another."""
    settings, takes = body.settings(), signature(kind).parameters
    integrator = settings.pop("integrator")
    if settings["mass_properties"] is not None and "mass_properties" not in takes:
        _check_mass(body, kind)
    if settings["damping"] and "damping" not in takes:
        _log.warning("a %s body takes no damping: %g s is omitted", kind.kind, settings["damping"])
    if "formulation" in options:
        settings.pop("modes", None)
    if type(body) is not kind:  # its default is that of the kind
        settings.pop("tolerance")
    settings = {name: value for name, value in settings.items() if name in takes}
    other = kind(body.mesh, body.material, **{**settings, **options})
    if "integrator" not in options:
        if integrator in other.integrators:
            other.integrator = integrator
        elif integrator != next(iter(body.integrators)):
            _log.warning(
                "a %s body has no integrator %s: it takes %s", kind.kind, integrator, other.integrator
            )
    return other


def _warn_of_lost_shape(body: Body, other: Body, F: Array, center: Array) -> None:
    """Log which fraction of the displacement that deforms a body does not go along."""
    assert body.mesh is not None
    X = body.mesh.points
    x = body.position(X)
    lost = np.linalg.norm(x - other.position(X), axis=1)
    if lost.max() <= SAME_SHAPE * float(np.ptp(X, axis=0).max()):
        return
    rigid = center + (X - body.center) @ polar(F).T
    _log.warning(
        "%.2g %% of the displacement that deforms the %s body, up to %.3g m, does not go along: "
        "a %s body takes the affine part alone",
        100 * np.linalg.norm(lost) / np.linalg.norm(x - rigid),
        body.kind,
        lost.max(),
        other.kind,
    )


def _check_mass(body: Body, kind: type[Body]) -> None:
    """Refuse mass properties that a body takes from its mesh, but that are others."""
    assert body.mesh is not None
    assert body.material is not None
    own, given = mass_properties_of(body.mesh, body.material), body.mass_properties
    size = float(np.ptp(body.mesh.points, axis=0).max())
    for name, scale in (("mass", 1.0), ("center", size), ("euler", size**2)):
        pair = getattr(given, name), getattr(own, name)
        if not np.allclose(*pair, rtol=0, atol=1e-9 * own.mass * scale):
            raise ModelError(
                f"the mass of a {kind.kind} body follows from its mesh ({own.mass:g} kg), and the mass "
                f"properties that were given to this {body.kind} body are others ({given.mass:g} kg); "
                "make one of a mesh and a density that have them"
            )


def _turn(body: Body, angular_momentum: Any) -> None:
    """Add the rotation to a velocity that gives the angular momentum about the mass center."""
    missing = angular_momentum - body.angular_momentum()
    if np.abs(missing).max() <= ROUND_OFF * np.abs(angular_momentum).max():
        return
    u, turns, momenta = body.u.copy(), [], []
    for axis in np.eye(3):
        body.set_velocity(angular=axis)
        turns.append(body.u.copy())
        momenta.append(body.angular_momentum())
    body.u[...] = u + np.linalg.solve(np.transpose(momenta), missing) @ np.array(turns)
