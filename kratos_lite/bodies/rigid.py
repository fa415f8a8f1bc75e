"""RigidBody: a rotation and the place of the mass center; FixedBody: one that nothing moves.

Source: Solfec-1.0 theory, rigid bodies.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.bodies.affine import AffineBody
from kratos_lite.bodies.linear_algebra import Solve, apply, transposed
from kratos_lite.bodies.rotations import axial, check_rotation, hat, polar, rotation_of
from kratos_lite.bodies.validation import Material, mass_properties_of
from kratos_lite.errors import InputError, ModelError
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh import Mesh
from kratos_lite.model.mass_properties import MassProperties
from kratos_lite.typing import Array, Ints


class RigidBody(AffineBody):
    """A body that keeps its shape, or many independent ones.

    q (..., 12): rotation Λ column by column (Λ11 Λ21 Λ31 Λ12 …), then the mass center x̄ in m.
    u (..., 6): referential angular velocity W in rad/s, then the velocity of the mass center in m/s.
    x = Λ (X - X̄) + x̄.

    Parameters
    ----------
    mesh : the shape; may be omitted where mass_properties are given.
    material : its density counts.
    mass_properties : mass, center and inertia in place of those of mesh and material; with leading axes for
        a batch of bodies.
    integrator : ``momentum_conserving`` (explicit, spatial angular momentum exact, energy decays; if not
        given), ``explicit`` (energy grows) or ``implicit`` (momentum exact, symmetric in time); Solfec's
        RIG_NEG, RIG_POS and RIG_IMP are aliases.
    tolerance : relative size of the last Newton step of an implicit integrator.

    Raises
    ------
    MeshError, ModelError, InputError
        If the mesh is inverted or has no volume, or there is no mass.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = RigidBody(kl.box((0.4, 0.6, 1.0)), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    >>> body.set_velocity(angular=(0, 10, 0))
    >>> print(f"{body.mass:.0f} kg, {body.kinetic_energy():.0f} J")
    240 kg, 1160 J
    """

    kind = "rigid"
    dofs = 6
    takes_torques = True
    integrators: ClassVar[Mapping[str, str]] = {
        "momentum_conserving": "RIG_NEG",
        "explicit": "RIG_POS",
        "implicit": "RIG_IMP",
    }

    def __init__(
        self,
        mesh: Mesh | None = None,
        material: Material | None = None,
        *,
        mass_properties: MassProperties | None = None,
        integrator: str | None = None,
        tolerance: float = 1e-14,
    ) -> None:
        self.mass_is_given = mass_properties is not None
        if mass_properties is None:
            if mesh is None or material is None:
                raise InputError(f"a {self.kind} body needs a mesh and a material, or its mass_properties")
            mass_properties = mass_properties_of(mesh, material)
        super().__init__(mesh, material, mass_properties, integrator, tolerance)

    # ---- motion ----------------------------------------------------------------------------------

    @staticmethod
    def _matrix_of(q: Array) -> Array:
        """Return Λ (..., 3, 3) of configurations (..., 12); see `AffineBody._matrix_of`."""
        return rotation_of(q)

    @staticmethod
    def _rate_of(q: Array, u: Array) -> Array:
        """Return Λ hat(W); see `AffineBody._rate_of`."""
        return np.asarray(rotation_of(q) @ hat(u[..., :3]))

    @staticmethod
    def _check_matrix(A: Array) -> None:
        """Raise InputError unless A is a rotation."""
        check_rotation(A, "the rotation of a configuration")

    @property
    def rotation(self) -> Array:
        """Rotation Λ (..., 3, 3), a copy."""
        return rotation_of(self.q).copy()

    def set_velocity(self, linear: ArrayLike = (0, 0, 0), angular: ArrayLike = (0, 0, 0)) -> None:
        """Set the velocity of the mass center in m/s and the spatial angular velocity in rad/s."""
        self.u[..., :3] = transposed(self.rotation, self._rigid_velocity(linear, angular))

    def set_affine_motion(self, F: Array, rate: Array, center: Array, velocity: Array) -> None:
        """Take the nearest rotation and the velocity; see `Body.set_affine_motion`."""
        self.set_configuration(np.concatenate([polar(F).T.ravel(), center]))
        self.set_velocity(velocity)

    # ---- forces ----------------------------------------------------------------------------------

    def jacobian(self, X: Array, q: Array) -> tuple[Ints, Array]:
        """Return dofs and H = [-Λ hat(X - X̄), 1]; see `Body.jacobian`."""
        turned = -rotation_of(q) @ hat(X - self.center)
        return np.arange(6), np.concatenate([turned, np.broadcast_to(np.eye(3), turned.shape)], axis=-1)

    def generalized_nodal_force(self, forces: Array, q: Array) -> Array:
        """Return the resultant torque and force of nodal forces; see `Body.generalized_nodal_force`."""
        assert self.mesh is not None
        A = self.mesh.points - self.center[..., None, :]
        moments = np.swapaxes(A, -1, -2) @ (forces @ rotation_of(q))
        resultant = np.broadcast_to(forces.sum(axis=0), (*q.shape[:-1], 3))
        return np.concatenate([2 * axial(np.swapaxes(moments, -1, -2)), resultant], axis=-1)

    def generalized_torque(self, torque: Array, q: Array) -> Array:
        """Return the referential torque Λ^T t and no force; see `Body.generalized_torque`."""
        referential = transposed(rotation_of(q), np.asarray(torque))
        return np.concatenate([referential, np.zeros_like(referential)], axis=-1)

    def times_mass(self, v: Array) -> Array:
        """Return J W and m v̄; see `Body.times_mass`."""
        spin = apply(self.mass_properties.inertia, v[..., :3])
        return np.concatenate([spin, self.mass[..., None] * v[..., 3:]], axis=-1)

    def step_constants(self) -> tuple[Array, Array, Array]:
        """Return what steps take: inertia, its inverse and mass."""
        return self.mass_properties.inertia, self._inverse, self.mass_properties.mass

    def mass_solver(self) -> Solve:
        """Return what solves M x = b: torques and forces answer apart; see `Body`."""
        return lambda b: np.concatenate([self._inverse @ b[:3], b[3:] / self.mass])

    @cached_property
    def _inverse(self) -> Array:
        return np.asarray(np.linalg.inv(self.mass_properties.inertia), dtype=float)

    def spin(self) -> Array:
        """Return Λ J W (..., 3) in kg m²/s."""
        return apply(self.rotation, self.times_mass(self.u)[..., :3])


class FixedBody(RigidBody):
    """A body that loads do not affect: it is fixed, or moves at the velocity set by `set_velocity`.

    Its vectors are those of a rigid body; it carries neither mass nor energy, and takes no loads.

    Parameters
    ----------
    mesh : the shape.
    material : is not needed.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> floor = FixedBody(kl.box((10.0, 10.0, 0.1)))
    >>> floor.set_velocity(linear=(0.5, 0, 0))
    >>> *_, end = kl.integrate(floor, dt=0.1, steps=20)
    >>> floor.mass_center().round(12).tolist()
    [6.0, 5.0, 0.05]
    """

    kind = "fixed"
    integrators: ClassVar[Mapping[str, str]] = {"uniform": ""}

    def __init__(self, mesh: Mesh, material: Material | None = None) -> None:
        shape = mass_properties_of(mesh, material or Isotropic3D(1.0, 0.0, 1.0))
        super().__init__(mesh, material, mass_properties=shape)

    @property
    def mass(self) -> Array:
        """Return 0: a fixed body carries no mass."""
        return np.zeros_like(self.mass_properties.mass)

    def times_mass(self, v: Array) -> Array:
        """Return zeros."""
        return np.zeros_like(v)

    def add(self, load: object, *, amplitude: object = None) -> None:
        """Refuse a load.

        Raises
        ------
        ModelError
            Always: loads do not affect a fixed body.
        """
        raise ModelError(
            "loads do not affect a fixed body: set its motion with set_velocity, or use a RigidBody"
        )

    def constrain(self, constraint: object) -> None:
        """Refuse a constraint.

        Raises
        ------
        ModelError
            Always: a fixed body needs no support.
        """
        raise ModelError("a fixed body needs no constraint: it is fixed, or moves at the velocity set")
