"""Conversion: the same body, in the same motion, as another kind."""

from __future__ import annotations

from typing import Any, TypeVar, overload

import numpy as np

from kratos_lite.bodies.body import BODIES, Body
from kratos_lite.bodies.finite_element import FiniteElementBody
from kratos_lite.bodies.pseudo_rigid import PseudoRigidBody
from kratos_lite.bodies.rigid import Obstacle, RigidBody
from kratos_lite.bodies.rotations import hat, polar
from kratos_lite.errors import InputError, ModelError
from kratos_lite.typing import Array

Kind = TypeVar("Kind", RigidBody, PseudoRigidBody, FiniteElementBody)


@overload
def convert(body: Body, kind: type[Kind], **options: Any) -> Kind: ...
@overload
def convert(body: Body, kind: str, **options: Any) -> Body: ...
def convert(body: Body, kind: Any, **options: Any) -> Any:
    """Return the body as another kind, in the motion that this kind can have.

    A rigid one gets the rotation by polar decomposition, and keeps both momenta; a pseudo-rigid one the
    affine motion that is nearest with respect to mass; a finite-element one the affine motion exactly.
    Loads and constraints do not go along: they are bound to the body that they were added to.

    Parameters
    ----------
    body : a single body with a mesh and a material.
    kind : `RigidBody`, `PseudoRigidBody` or `FiniteElementBody`, or its word such as ``"rigid"``.
    options : further arguments of the kind, such as ``formulation="corotational"``.

    Raises
    ------
    InputError, ModelError
        The kind is unknown, or the body has no mesh.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> rigid = kl.RigidBody(kl.box((0.4, 0.6, 1.0)), kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0))
    >>> rigid.set_velocity(angular=(0.05, 10, 0.05))
    >>> soft = convert(rigid, kl.FiniteElementBody)
    >>> print(f"{rigid.kinetic_energy():.3f} J, {soft.kinetic_energy():.3f} J")
    1160.047 J, 1160.047 J
    """
    if isinstance(kind, str):
        kind = BODIES[kind]
    if kind not in (RigidBody, PseudoRigidBody, FiniteElementBody):
        raise InputError(f"a body becomes a RigidBody, PseudoRigidBody or FiniteElementBody; got {kind!r}")
    if isinstance(body, Obstacle):
        raise ModelError("an obstacle has no mass, so it does not become another kind; make a new body")
    if body.q.ndim > 1 or body.mesh is None or body.material is None:
        raise ModelError(f"only a single body with a mesh and a material changes its kind; got {body!r}")
    F, rate = affine(body)
    center = body.mass_center() + F @ (body.center - _own_center(body))
    velocity = body.linear_momentum() / body.mass
    other = kind(body.mesh, body.material, **options)
    if isinstance(other, FiniteElementBody):
        arms = other.points - body.center
        other.set_configuration(arms @ F.T + center - other.points)
        other.u = (arms @ rate.T + velocity).ravel()
    elif isinstance(other, PseudoRigidBody):
        other.set_configuration(np.concatenate([F.ravel(), center]))
        other.u = np.concatenate([rate.ravel(), velocity])
    else:
        other.set_configuration(np.concatenate([polar(F).T.ravel(), center]))
        spin = other.rotation.T @ body.angular_momentum()
        other.u = np.concatenate([np.linalg.solve(other.mass_properties.inertia, spin), velocity])
    other.time, other.step = body.time, body.step
    return other


def affine(body: Body) -> tuple[Array, Array]:
    """Return F and Ḟ (3, 3) of the affine motion that is nearest to that of a body with respect to mass."""
    if isinstance(body, RigidBody):
        return body.rotation, body.rotation @ hat(body.u[:3])
    if isinstance(body, PseudoRigidBody):
        return body.deformation.copy(), body.u[:9].reshape(3, 3).copy()
    assert isinstance(body, FiniteElementBody)
    arms = body.points - _own_center(body)
    weighted = body.times_mass(arms.ravel()).reshape(-1, 3)
    inverse = np.linalg.inv(weighted.T @ arms)
    moved = body.displacement - body.displacement.mean(axis=0)
    rate = body.u.reshape(-1, 3) - body.u.reshape(-1, 3).mean(axis=0)
    return np.eye(3) + moved.T @ weighted @ inverse, rate.T @ weighted @ inverse


def _own_center(body: Body) -> Array:
    """Return the mass center of the undeformed body as its mass has it: lumped mass may shift it."""
    if isinstance(body, FiniteElementBody):
        return body.reference_center()
    return body.center
