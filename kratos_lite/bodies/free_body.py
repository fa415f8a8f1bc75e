"""FreeBody: configuration, velocity, mass and momenta of a body, before loads and constraints act on it.

A body has a configuration q and a velocity u.  Its kind says how these move its material points X, by
`position` and `velocity`, and what a force on a point does to u.  Loads and constraints stand on this alone.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.bodies.linear_algebra import Entries, Solve, transposed
from kratos_lite.bodies.validation import Material, elements_of, mass_properties_of
from kratos_lite.errors import ModelError
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh import Mesh
from kratos_lite.model.mass_properties import MassProperties
from kratos_lite.typing import Array, Ints


@dataclass
class Clock:
    """Time in s and number of steps; bodies of a batch share one."""

    time: float = 0.0
    step: int = 0


class FreeBody(ABC):
    """What a kind of body defines: how it moves its material points, and what forces on them do."""

    kind: ClassVar[str]
    jacobian_is_constant: ClassVar[bool] = False
    takes_torques: ClassVar[bool] = False
    dofs: int

    def __init__(
        self,
        mesh: Mesh | None,
        material: Material | None,
        mass_properties: MassProperties,
        q: Array,
        u: Array,
    ) -> None:
        self.mesh, self.material, self.mass_properties = mesh, material, mass_properties
        self.q, self.u = q, u
        self.clock = Clock()

    # ---- motion ----------------------------------------------------------------------------------

    @abstractmethod
    def position(self, X: ArrayLike, q: Array | None = None) -> Array:
        """Return where material points are.

        Parameters
        ----------
        X : (3,) or (m, 3) m, points of the undeformed body.
        q : configuration; that of the body if not given.

        Returns
        -------
        (..., 3) or (..., m, 3) float, m.
        """

    @abstractmethod
    def velocity(self, X: ArrayLike, q: Array | None = None, u: Array | None = None) -> Array:
        """Return the velocity of material points.

        Parameters
        ----------
        X : (3,) or (m, 3) m, points of the undeformed body.
        q, u : configuration and velocity; those of the body if not given.

        Returns
        -------
        (..., 3) or (..., m, 3) float, m/s.
        """

    @abstractmethod
    def set_configuration(self, q: ArrayLike) -> None:
        """Set the configuration.

        Parameters
        ----------
        q : the layout depends on the kind of body.

        Raises
        ------
        InputError
            It is invalid: a wrong shape, not a rotation, or an inverted body.
        """

    @abstractmethod
    def rotate(self, rotation: ArrayLike) -> None:
        """Rotate the undeformed body about its mass center, which stays where it is.

        Parameters
        ----------
        rotation : Λ (3, 3) or (..., 3, 3); `kratos_lite.bodies.rotations.exp` makes one of a rotation vector.
        """

    @abstractmethod
    def set_velocity(self, linear: ArrayLike = (0, 0, 0), angular: ArrayLike = (0, 0, 0)) -> None:
        """Let the body move as a rigid one: velocity of its mass center, and spatial angular velocity.

        Parameters
        ----------
        linear : (3,) or (..., 3) m/s.
        angular : (3,) or (..., 3) rad/s.
        """

    @abstractmethod
    def translation(self, v: Array) -> Array:
        """Return the velocity with which all points of the body move alike.

        Parameters
        ----------
        v : (3,) m/s.

        Returns
        -------
        (..., dofs) float.
        """

    def locate(self, X: Array) -> None:
        """Check that points lie in the undeformed body.

        Parameters
        ----------
        X : (3,) or (m, 3) m.
        """
        if self.mesh is not None:
            self.mesh.locate(X).require()

    # ---- forces ----------------------------------------------------------------------------------

    @abstractmethod
    def jacobian(self, X: Array, q: Array) -> tuple[Ints, Array]:
        """Return the derivative of the velocity of a point with respect to u.

        Where `jacobian_is_constant` it does not depend on q.

        Parameters
        ----------
        X : (3,) m, a point of the undeformed body.
        q : configuration.

        Returns
        -------
        dofs (k,) int and H (..., 3, k) float with velocity(X) = H u[dofs].
        """

    def generalized_force(self, X: Array, force: Array, q: Array) -> Array:
        """Return what a force on a point does, H^T f: its power is the product with u.

        Parameters
        ----------
        X : (3,) m, a point of the undeformed body.
        force : (3,) or (..., 3) N, in space.
        q : configuration.

        Returns
        -------
        (..., dofs) float.
        """
        dofs, H = self.jacobian(X, q)
        out = np.zeros((*q.shape[:-1], self.dofs))
        out[..., dofs] = transposed(H, force)
        return out

    @abstractmethod
    def generalized_nodal_force(self, forces: Array, q: Array) -> Array:
        """Return what forces on the nodes of the mesh do; see `generalized_force`.

        Parameters
        ----------
        forces : (n, 3) N, in space.
        q : configuration.

        Returns
        -------
        (..., dofs) float.
        """

    def generalized_nodal_tangent(self, entries: Entries) -> Entries:
        """Return what forces on the nodes that change with their places do; see `generalized_nodal_force`.

        Parameters
        ----------
        entries : of the derivative of the forces (3n,) with respect to the places (3n,), in N/m.

        Returns
        -------
        Entries of the derivative of the generalized force with respect to q.

        Raises
        ------
        ModelError
            Configurations of this kind of body form no linear space.
        """
        raise ModelError(f"loads of a {self.kind} body have no tangent")

    def generalized_torque(self, torque: Array, q: Array) -> Array:
        """Return what a torque does; see `generalized_force`.

        Parameters
        ----------
        torque : (3,) or (..., 3) N m, in space.
        q : configuration.

        Returns
        -------
        (..., dofs) float.

        Raises
        ------
        ModelError
            Bodies of this kind take no torques.
        """
        raise ModelError(
            f"a torque acts on rigid bodies; give a {self.kind} one a pair of forces at two points"
        )

    @abstractmethod
    def push_forward(self, vector: Array, X: Array, q: Array) -> Array:
        """Return where a vector points that is fixed in the body.

        Parameters
        ----------
        vector : (3,), in the undeformed body.
        X : (3,) m, the point where it stands.
        q : configuration.

        Returns
        -------
        (..., 3) float.
        """

    def elements(self) -> list[ElementGroup]:
        """Return the elements of the mesh; where no material is given, with the mean density of the body.

        Returns
        -------
        list of ElementGroup

        Raises
        ------
        ModelError
            There is no mesh, or the body is a batch without a material.
        """
        if self.mesh is None:
            raise ModelError(f"this {self.kind} body has no mesh")
        if self.material is not None:
            return elements_of(self.mesh, self.material)
        if self.q.ndim > 1:
            raise ModelError("a batch of bodies needs a material for loads on its mesh")
        unit = mass_properties_of(self.mesh, Isotropic3D(1.0, 0.0, 1.0))
        return elements_of(self.mesh, Isotropic3D(1.0, 0.0, float(self.mass / unit.mass)))

    # ---- mass and momenta ------------------------------------------------------------------------

    @property
    def mass(self) -> Array:
        """Mass (...) in kg."""
        return np.asarray(self.mass_properties.mass)

    @property
    def center(self) -> Array:
        """Mass center X̄ (..., 3) of the undeformed body in m."""
        return np.asarray(self.mass_properties.center)

    @abstractmethod
    def times_mass(self, v: Array) -> Array:
        """Return the mass matrix times a velocity.

        Parameters
        ----------
        v : (..., dofs).

        Returns
        -------
        (..., dofs) float.
        """

    @abstractmethod
    def mass_solver(self) -> Solve:
        """Return the function that solves M x = b, (dofs,) or columns (dofs, k), of a single body."""

    @abstractmethod
    def mass_center(self, q: Array | None = None) -> Array:
        """Return the place of the mass center.

        Parameters
        ----------
        q : configuration; that of the body if not given.

        Returns
        -------
        (..., 3) float, m.
        """

    @abstractmethod
    def linear_momentum(self) -> Array:
        """Return ∫ρ v dV (..., 3) in kg m/s."""

    @abstractmethod
    def angular_momentum(self, about: ArrayLike | None = None) -> Array:
        """Return ∫ρ (x - about) × v dV.

        Parameters
        ----------
        about : (3,) m, in space; the mass center if not given.

        Returns
        -------
        (..., 3) float, kg m²/s.
        """

    # ---- time ------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time in s."""
        return self.clock.time

    @time.setter
    def time(self, value: float) -> None:
        self.clock = replace(self.clock, time=float(value))

    @property
    def step(self) -> int:
        """Number of steps taken."""
        return self.clock.step

    @step.setter
    def step(self, value: int) -> None:
        self.clock = replace(self.clock, step=int(value))
