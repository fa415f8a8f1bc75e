"""PseudoRigidBody: one deformation gradient for the whole body.

Source: Solfec-1.0 theory, pseudo-rigid bodies; Cohen & Muncaster, The Theory of Pseudo-Rigid Bodies (1988).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.bodies.affine import AffineBody
from kratos_lite.bodies.body import Deformable
from kratos_lite.bodies.linear_algebra import Entries, Solve, apply, block_entries, transposed
from kratos_lite.bodies.rotations import axial, hat
from kratos_lite.bodies.validation import Material, mass_properties_of
from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh
from kratos_lite.model.checks import checked_linear_material
from kratos_lite.model.mass_properties import MassProperties
from kratos_lite.typing import Array, Ints
from kratos_lite.voigt import PAIRS, tensor


class PseudoRigidBody(AffineBody, Deformable):
    """A body that deforms homogeneously, or many independent ones.

    q (..., 12): deformation gradient F row by row (F11 F12 F13 F21 …), then the mass center x̄ in m.
    u (..., 12): Ḟ row by row in 1/s, then the velocity of the mass center in m/s.
    x = F (X - X̄) + x̄; the material is Saint Venant–Kirchhoff, S = C : E.

    Parameters
    ----------
    mesh : the shape; may be omitted where mass_properties are given.
    material : one material (a body of several has no single C).
    mass_properties : mass, volume, center and Euler tensor in place of those of mesh and material.
    integrator : one of `Deformable.integrators`; ``energy_momentum`` if not given.
    damping : η in s.
    tolerance : relative size of the last Newton step of an implicit integrator.

    Raises
    ------
    MeshError, ModelError, InputError
        If the mesh is inverted, there is no mass, or no body has such an Euler tensor.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = PseudoRigidBody(kl.box((0.4, 0.6, 1.0)), kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0))
    >>> print(f"{body.critical_step():.4e} s")
    5.8400e-03 s
    """

    kind = "pseudo-rigid"
    dofs = 12

    def __init__(
        self,
        mesh: Mesh | None = None,
        material: Material | None = None,
        *,
        mass_properties: MassProperties | None = None,
        integrator: str | None = None,
        damping: float = 0.0,
        tolerance: float = 1e-12,
    ) -> None:
        if isinstance(material, Mapping):
            if len(material) != 1:
                raise InputError("a pseudo-rigid body is of one material; FiniteElementBody takes several")
            (material,) = material.values()
        material = checked_linear_material(material)
        self.mass_is_given = mass_properties is not None
        if mass_properties is None:
            if mesh is None:
                raise InputError("a pseudo-rigid body needs a mesh, or its mass_properties")
            mass_properties = mass_properties_of(mesh, material)
        mass_properties.check_deformable()
        self.C = material.C
        super().__init__(mesh, material, mass_properties, integrator, tolerance, damping)

    # ---- motion ----------------------------------------------------------------------------------

    @property
    def deformation(self) -> Array:
        """Deformation gradient F (..., 3, 3), a copy."""
        return self._matrix_of(self.q).copy()

    @staticmethod
    def _matrix_of(q: Array) -> Array:
        """Return F (..., 3, 3) of configurations (..., 12), or Ḟ of velocities; see `AffineBody`."""
        return q[..., :9].reshape(*q.shape[:-1], 3, 3)

    @staticmethod
    def _rate_of(q: Array, u: Array) -> Array:
        """Return Ḟ; see `AffineBody._rate_of`."""
        return PseudoRigidBody._matrix_of(u)

    @staticmethod
    def _check_matrix(A: Array) -> None:
        """Raise InputError unless det F > 0."""
        lowest = float(np.linalg.det(A).min())
        if lowest <= 0:
            raise InputError(
                f"a deformation gradient needs det F > 0; got {lowest:g}: it turns the body over"
            )

    def set_velocity(self, linear: ArrayLike = (0, 0, 0), angular: ArrayLike = (0, 0, 0)) -> None:
        """Set the velocity of the mass center in m/s and the spatial angular velocity in rad/s."""
        w = self._rigid_velocity(linear, angular)
        self.u[..., :9] = (hat(w) @ self.deformation).reshape(self.u[..., :9].shape)

    def set_affine_motion(self, F: Array, rate: Array, center: Array, velocity: Array) -> None:
        """Take the affine motion; see `Body.set_affine_motion`."""
        self.set_configuration(np.concatenate([F.ravel(), center]))
        self.u[...] = np.concatenate([rate.ravel(), velocity])

    # ---- forces ----------------------------------------------------------------------------------

    def jacobian(self, X: Array, q: Array) -> tuple[Ints, Array]:
        """Return dofs and H = [(X - X̄)^T in three rows, 1]; see `Body.jacobian`."""
        A = X - self.center
        rows = np.einsum("ij,...k->...ijk", np.eye(3), A).reshape(*A.shape[:-1], 3, 9)
        return np.arange(12), np.concatenate(
            [rows, np.broadcast_to(np.eye(3), (*A.shape[:-1], 3, 3))], axis=-1
        )

    def generalized_nodal_force(self, forces: Array, q: Array) -> Array:
        """Return Σ f_i A_j row by row and Σ f of nodal forces; see `Body.generalized_nodal_force`."""
        assert self.mesh is not None
        moment = forces.T @ (self.mesh.points - self.center[..., None, :])
        resultant = np.broadcast_to(forces.sum(axis=0), (*q.shape[:-1], 3))
        return np.concatenate([moment.reshape(*moment.shape[:-2], 9), resultant], axis=-1)

    def generalized_nodal_tangent(self, entries: Entries) -> Entries:
        """Return G^T A G as a full matrix, x = G q + const; see `FreeBody.generalized_nodal_tangent`."""
        assert self.mesh is not None
        row, column, value = entries
        dofs, H = self.jacobian(self.mesh.points, self.q)
        G = H.reshape(-1, 12)
        return block_entries(dofs, dofs, G[row].T @ (value[:, None] * G[column]))

    def times_mass(self, v: Array) -> Array:
        """Return V̇ E0 row by row and m v̄; see `Body.times_mass`."""
        rows = (self._matrix_of(v) @ self.mass_properties.euler).reshape(*v.shape[:-1], 9)
        return np.concatenate([rows, self.mass[..., None] * v[..., 9:]], axis=-1)

    # ---- deformation ----------------------------------------------------------------------------

    def internal_force(self, q: Array | None = None) -> Array:
        """Return V P(F) row by row, and no force on the mass center, (..., 12)."""
        F = (self.q if q is None else q)[..., :9]
        out = np.zeros((*F.shape[:-1], 12))
        V = np.asarray(self.mass_properties.volume)[..., None]
        out[..., :9] = V * transposed(strain_operator(F), apply(self.C, green_strain(F)))
        return out

    def internal_energy(self) -> Array | float:
        """Return V ½ E : C : E, (...) in J."""
        E = green_strain(self.q[..., :9])
        return np.asarray(self.mass_properties.volume * (E * apply(self.C, E)).sum(axis=-1) / 2)

    def stiffness(self, q: Array | None = None) -> Array:
        """Return V dP/dF (..., 9, 9), rows and columns as F in q."""
        F = (self.q if q is None else q)[..., :9]
        B, V = strain_operator(F), np.asarray(self.mass_properties.volume)[..., None, None]
        stress = by_rows(tensor(apply(self.C, green_strain(F))))
        return np.asarray(V * (stress + np.swapaxes(B, -1, -2) @ self.C @ B))

    def mass_matrix(self) -> Array:
        """Return the mass (..., 9, 9) in kg m² of Ḟ, diag(E0, E0, E0)."""
        return by_rows(self.mass_properties.euler)

    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c K(q)) x = b of one body, for columns b (12, k)."""
        A = self.mass_matrix() + c * self.stiffness(q)
        return lambda b: np.concatenate([np.linalg.solve(A, b[:9]), b[9:] / self.mass])

    def mass_solver(self) -> Solve:
        """Return what solves M x = b; see `Body`."""
        return self.solver(self.q, 0.0)

    def step_constants(self) -> tuple[Array, Array, Array, Array, float]:
        """Return what steps take: Euler tensor, mass, volume, C and damping."""
        c = self.mass_properties
        return c.euler, c.mass, c.volume, self.C, self.damping

    def frequencies(self) -> Array:
        """Return the angular frequencies (..., 9) in rad/s at the configuration, ascending; 0 if ω² < 0."""
        L = np.linalg.inv(np.linalg.cholesky(self.mass_matrix()))
        K = self.stiffness()
        squares = np.linalg.eigvalsh(L @ K @ np.swapaxes(L, -1, -2))
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))

    def extent(self) -> float:
        """Return 1, the size of F."""
        return 1.0

    def highest_frequency(self) -> float:
        """Return the highest angular frequency of all bodies in rad/s."""
        return float(self.frequencies().max())

    def spin(self) -> Array:
        """Return the axial vector of Ḟ E0 F^T - F E0 Ḟ^T, (..., 3) in kg m²/s."""
        H = self._matrix_of(self.u) @ self.mass_properties.euler @ np.swapaxes(self.deformation, -1, -2)
        return 2 * axial(H)


# ---- strain of one deformation gradient, as nine numbers row by row -------------------------------


def strain_operator(F: Array) -> Array:
    """Return B (..., 6, 9) of F (..., 9): B X is the strain sym(F^T X), with engineering shear."""
    B = np.zeros((*F.shape[:-1], 6, 3, 3))
    columns = F.reshape(*F.shape[:-1], 3, 3)
    for a, (i, j) in enumerate(PAIRS):
        B[..., a, :, j] = columns[..., :, i]
        B[..., a, :, i] = columns[..., :, j]
    return B.reshape(*F.shape[:-1], 6, 9)


def green_strain(F: Array) -> Array:
    """Return the strain (F^T F - 1)/2 (..., 6) of F (..., 9)."""
    return np.asarray((apply(strain_operator(F), F) - np.array([1.0, 1, 1, 0, 0, 0])) / 2)


def by_rows(A: Array) -> Array:
    """Return the matrix (..., 9, 9) that applies A (..., 3, 3) to each row of a matrix (9)."""
    return np.asarray(np.einsum("ik,...jl->...ijkl", np.eye(3), A).reshape(*A.shape[:-2], 9, 9))
