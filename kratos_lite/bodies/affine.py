"""AffineBody: one matrix moves the whole body; what rigid and pseudo-rigid bodies share."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.bodies.body import Body
from kratos_lite.bodies.rotations import check_rotation
from kratos_lite.bodies.validation import Material, fitting, one_point, points_of, vector_of
from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh
from kratos_lite.model.mass_properties import MassProperties
from kratos_lite.typing import Array
from kratos_lite.validation import finite


class AffineBody(Body):
    """A body, or many independent ones, that move as x = A (X - X̄) + x̄ with A (..., 3, 3).

    q (..., 12): A in nine numbers, then the mass center x̄ in m.
    u (..., dofs): the velocity of the mass center in m/s is in the last three.

    Parameters
    ----------
    mesh, material, mass_properties, integrator, damping, tolerance : see `Body`.
    """

    def __init__(
        self,
        mesh: Mesh | None,
        material: Material | None,
        mass_properties: MassProperties,
        integrator: str | None,
        tolerance: float,
        damping: float = 0.0,
    ) -> None:
        lead = np.shape(mass_properties.mass)
        q = np.zeros((*lead, 12))
        q[..., [0, 4, 8]] = 1.0
        q[..., 9:] = mass_properties.center
        self.tolerance = tolerance
        u = np.zeros((*lead, self.dofs))
        super().__init__(mesh, material, mass_properties, q, u, integrator, damping)

    @staticmethod
    @abstractmethod
    def _matrix_of(q: Array) -> Array:
        """Return A (..., 3, 3) of configurations (..., 12), a view."""

    @staticmethod
    @abstractmethod
    def _rate_of(q: Array, u: Array) -> Array:
        """Return the rate of A (..., 3, 3) of configurations and velocities."""

    @staticmethod
    @abstractmethod
    def _check_matrix(A: Array) -> None:
        """Raise InputError unless A (..., 3, 3) is one of this kind of body."""

    def position(self, X: ArrayLike, q: Array | None = None) -> Array:
        """Return x = A (X - X̄) + x̄; see `Body.position`."""
        q = self.q if q is None else q
        return self._moved(X, self._matrix_of(q), q[..., 9:])

    def velocity(self, X: ArrayLike, q: Array | None = None, u: Array | None = None) -> Array:
        """Return v = Ȧ (X - X̄) + v̄, shaped as by `position`, in m/s."""
        q, u = self.q if q is None else q, self.u if u is None else u
        return self._moved(X, self._rate_of(q, u), u[..., -3:])

    def affine_motion(self) -> tuple[Array, Array, Array]:
        """Return A, its rate and x̄, copies; see `Body.affine_motion`."""
        return self._matrix_of(self.q).copy(), self._rate_of(self.q, self.u).copy(), self.mass_center()

    def _moved(self, X: ArrayLike, A: Array, translation: Array) -> Array:
        """Return A (X - X̄) + translation, (..., m, 3) or (..., 3)."""
        points = points_of(X)
        arms = np.atleast_2d(points) - self.center[..., None, :]
        x = arms @ np.swapaxes(A, -1, -2) + translation[..., None, :]
        return np.asarray(x if points.ndim == 2 else x[..., 0, :])

    def set_configuration(self, q: ArrayLike) -> None:
        """Set the configuration (..., 12); see `Body.set_configuration`.

        Raises
        ------
        InputError
            The shape is wrong, or A is invalid for this kind of body.
        """
        q = finite(q, "a configuration")
        if q.shape != self.q.shape:
            raise InputError(f"a configuration of this body has shape {self.q.shape}; got {q.shape}")
        self._check_matrix(self._matrix_of(q))
        self.q[...] = q

    def rotate(self, rotation: ArrayLike) -> None:
        """Set A to a rotation Λ (3, 3) or (..., 3, 3); see `Body.rotate`."""
        self._matrix_of(self.q)[...] = fitting(check_rotation(rotation), self.q.shape[:-1], 2, "a rotation")

    def _rigid_velocity(self, linear: ArrayLike, angular: ArrayLike) -> Array:
        """Set the velocity of the mass center; return the spatial angular velocity, both checked."""
        lead = self.q.shape[:-1]
        w = vector_of(angular, lead, "an angular velocity")
        self.u[..., -3:] = vector_of(linear, lead, "a velocity")
        return w

    def translation(self, v: Array) -> Array:
        """Return v as the velocity of the mass center; see `Body.translation`."""
        out = np.zeros_like(self.u)
        out[..., -3:] = v
        return out

    def push_forward(self, vector: Array, X: Array, q: Array) -> Array:
        """Return A times the vector; see `FreeBody.push_forward`."""
        return np.asarray(self._matrix_of(q) @ vector)

    def mass_center(self, q: Array | None = None) -> Array:
        """Return x̄ (..., 3) in m."""
        return (self.q if q is None else q)[..., 9:].copy()

    def linear_momentum(self) -> Array:
        """Return m v̄ (..., 3) in kg m/s."""
        return np.asarray(self.mass[..., None] * self.u[..., -3:])

    def angular_momentum(self, about: ArrayLike | None = None) -> Array:
        """Return the spin and the moment of the linear momentum, (..., 3) in kg m²/s; see `Body`."""
        spin = self.spin()
        if about is None:
            return spin
        arm = self.q[..., 9:] - one_point(about)
        return np.asarray(spin + np.cross(arm, self.linear_momentum()))

    @abstractmethod
    def spin(self) -> Array:
        """Return the angular momentum (..., 3) in kg m²/s about the mass center."""
