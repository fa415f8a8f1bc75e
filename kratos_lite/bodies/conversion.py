"""Conversion: the same body, in the same motion, as another kind."""

from __future__ import annotations

from typing import Any, TypeVar, overload

from kratos_lite.bodies.body import BODIES, Body
from kratos_lite.errors import InputError, ModelError

Kind = TypeVar("Kind", bound=Body)


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

    Returns
    -------
    A new body.

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
    if not (isinstance(kind, type) and issubclass(kind, Body) and kind.convertible):
        raise InputError(f"a body becomes a RigidBody, PseudoRigidBody or FiniteElementBody; got {kind!r}")
    if not body.convertible:
        raise ModelError(f"an {body.kind} has no mass, so it does not become another kind; make a new body")
    if body.q.ndim > 1 or body.mesh is None or body.material is None:
        raise ModelError(f"only a single body with a mesh and a material changes its kind; got {body!r}")
    F, rate = body.affine_motion()
    center = body.mass_center() + F @ (body.center - body.reference_center())
    other = kind(body.mesh, body.material, **options)
    velocity = body.linear_momentum() / body.mass
    other.set_affine_motion(F, rate, center, velocity, body.angular_momentum())
    other.time, other.step = body.time, body.step
    return other
