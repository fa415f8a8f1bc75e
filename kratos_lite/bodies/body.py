"""Body: what every kind of body has, whatever it may do with its shape.

A body has a configuration q and a velocity u.  Its kind says how these move its material points X:
`position` and `velocity`.  Everything else (loads, constraints, energies, momenta, time integration)
stands on the few methods that a kind defines.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.model.mass_properties import MassProperties
from kratos_lite.registry import Registry
from kratos_lite.typing import Array
from kratos_lite.validation import finite

if TYPE_CHECKING:
    from kratos_lite.bodies.constraints import Constraint
    from kratos_lite.bodies.loads import BodyLoad, Bound
    from kratos_lite.bodies.validation import Material
    from kratos_lite.model.loads import Load
    from kratos_lite.time_series import Factor


_log = logging.getLogger("kratos_lite")
BODIES: Registry[type[Body]] = Registry("kind of body")
"""Every kind of body by its class name and by its `kind`."""


@dataclass
class Clock:
    """Time in s and number of steps; bodies share one while they advance together."""

    time: float = 0.0
    step: int = 0


class Body(ABC):
    """A body in motion.

    Attributes
    ----------
    kind : name of the kind, as in input files.
    q, u : configuration and velocity; their layout is that of the kind.
    time, step : s, and number of steps taken.
    mesh, material : the shape and what it is made of, or None for a body given by its mass_properties.
    mass_properties : mass, volume, mass center, Euler and inertia tensor.
    tolerance : relative size of the last Newton step of an implicit scheme.
    damping : η in s, viscous stress η C Ė (stiffness-proportional damping).
    marched : u as the last march left it, None before; where it is another one, or constraints are new, a
        march starts with an impulse that meets the constraints.
    external_work : work of loads and reactions since the start, J.
    """

    kind: ClassVar[str]
    schemes: ClassVar[tuple[str, ...]] = ()
    jacobian_is_constant: ClassVar[bool] = False
    dofs: int

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "kind" in cls.__dict__:
            BODIES.add(cls.__name__, cls, [cls.kind])

    def __init__(
        self,
        mesh: Mesh | None,
        material: Material | None,
        mass_properties: MassProperties,
        q: Array,
        u: Array,
        scheme: str | None,
        damping: float = 0.0,
    ) -> None:
        self.mesh, self.material, self.mass_properties = mesh, material, mass_properties
        for warning in self.warnings():
            _log.warning("%s", warning)
        self.q, self.u = q, u
        self.clock = Clock()
        self.external_work: Array = np.zeros(q.shape[:-1])
        self.loads: list[Bound] = []
        self.constraints: list[Constraint] = []
        self.integrated_velocity: Array | None = None
        self._constant: tuple[int, tuple[Array, Array, Array]] | None = None
        self.scheme = self.default_scheme() if scheme is None else scheme
        self.damping = damping

    # ---- what a kind defines ---------------------------------------------------------------------

    @abstractmethod
    def default_scheme(self) -> str:
        """Return the scheme that is used if none is named."""

    @abstractmethod
    def position(self, X: ArrayLike, q: Array | None = None) -> Array:
        """Return where material points X (m, 3) or (3,) are, as (..., m, 3) or (..., 3) in m."""

    @abstractmethod
    def velocity(self, X: ArrayLike, q: Array | None = None, u: Array | None = None) -> Array:
        """Return the velocity of material points X, shaped as by `position`, in m/s."""

    @abstractmethod
    def set_configuration(self, q: ArrayLike) -> None:
        """Set the configuration.

        Raises
        ------
        InputError
            If it is none of this body: a wrong shape, no rotation, an inverted shape.
        """

    @abstractmethod
    def rotate(self, rotation: ArrayLike) -> None:
        """Turn the undeformed body about its mass center, which stays where it is.

        Parameters
        ----------
        rotation : Λ (3, 3) or (..., 3, 3); `kratos_lite.bodies.rotations.exp` makes one of a rotation vector.
        """

    @abstractmethod
    def set_velocity(self, linear: ArrayLike = (0, 0, 0), angular: ArrayLike = (0, 0, 0)) -> None:
        """Let the body move as a rigid one: linear velocity of its mass center, and spatial angular velocity.

        Parameters
        ----------
        linear : (3,) or (..., 3) m/s.
        angular : (3,) or (..., 3) rad/s.
        """

    @abstractmethod
    def jacobian(self, X: Array, q: Array) -> tuple[NDArray[np.int64], Array]:
        """Return dofs (k,) and H (3, k) with velocity(X) = H u[dofs], for one point X (3,) of one body.

        Where `jacobian_is_constant` they do not depend on q.
        """

    @abstractmethod
    def generalized_force(self, X: Array, force: Array, q: Array) -> Array:
        """Return the generalized force (..., dofs) of a spatial force (..., 3) in N on the point X (3,)."""

    @abstractmethod
    def generalized_nodal_force(self, forces: Array, q: Array) -> Array:
        """Return the generalized force (..., dofs) of spatial forces (n, 3) in N on the nodes of the mesh."""

    @abstractmethod
    def convected(self, vector: Array, X: Array, q: Array) -> Array:
        """Return what a vector (3,) fixed in the body at X points at in space, (..., 3)."""

    def locate(self, X: Array) -> None:
        """Raise MeshError unless points X (3,) or (m, 3) all lie in the undeformed body."""
        if self.mesh is not None:
            self.mesh.locate(X).require()

    @abstractmethod
    def times_mass(self, v: Array) -> Array:
        """Return the mass matrix times v (..., dofs)."""

    @abstractmethod
    def mass_solver(self) -> Callable[[Array], Array]:
        """Return what solves M x = b of a single body, for columns b (dofs, k)."""

    @abstractmethod
    def mass_center(self) -> Array:
        """Return where the mass center is, (..., 3) in m."""

    @abstractmethod
    def linear_momentum(self) -> Array:
        """Return ∫ρ v dV, (..., 3) in kg m/s."""

    @abstractmethod
    def angular_momentum(self, about: ArrayLike | None = None) -> Array:
        """Return ∫ρ (x - about) × v dV, (..., 3) in kg m²/s, about the mass center if not given."""

    def internal_load(self, q: Array | None = None) -> Array:
        """Return the generalized internal load (..., dofs): what deformation resists with."""
        return np.zeros_like(self.u)

    def internal_energy(self) -> Array | float:
        """Return the strain energy (...) in J."""
        return np.zeros(self.q.shape[:-1])

    def stiffness(self, q: Array | None = None) -> Any:
        """Return the tangent of `internal_load`.

        Raises
        ------
        ModelError
            If bodies of this kind do not deform.
        """
        raise ModelError(f"a {self.kind} body has no stiffness; a pseudo-rigid or finite-element one has")

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

    def warnings(self) -> list[str]:
        """Return what is allowed, but may be a mistake; it is also logged when the body is made."""
        return []

    # ---- mass_properties -------------------------------------------------------------------------

    @property
    def mass(self) -> Array:
        """Mass (...) in kg."""
        return np.asarray(self.mass_properties.mass)

    @property
    def center(self) -> Array:
        """Mass center X̄ (..., 3) of the undeformed body in m."""
        return np.asarray(self.mass_properties.center)

    @property
    def scheme(self) -> str:
        """Name of the time integration scheme, one of `schemes`."""
        return self._scheme

    @scheme.setter
    def scheme(self, name: str) -> None:
        if name not in self.schemes:
            known = ", ".join(self.schemes) or "none"
            raise InputError(f"the schemes of a {self.kind} body are {known}; got {name!r}")
        self._scheme = name

    @property
    def damping(self) -> float:
        """Stiffness-proportional damping η in s, ≥ 0."""
        return self._damping

    @damping.setter
    def damping(self, value: float) -> None:
        damping = finite(value, "a damping")
        if damping.ndim or damping < 0:
            raise InputError(f"a damping must be one number of seconds, ≥ 0; got {value}")
        self._damping = float(damping)

    @property
    def tolerance(self) -> float:
        """Relative size of the last Newton step of an implicit scheme, 0 … 1; 0 stands for round-off."""
        return self._tolerance

    @tolerance.setter
    def tolerance(self, value: float) -> None:
        tolerance = finite(value, "a tolerance")
        if tolerance.ndim or not 0 <= tolerance < 1:
            raise InputError(f"a tolerance must be one number from 0 to less than 1; got {value}")
        self._tolerance = float(tolerance)

    # ---- loads and constraints -------------------------------------------------------------------

    def add(self, load: BodyLoad | Load, amplitude: Factor = 1.0) -> None:
        """Let a load act.

        Parameters
        ----------
        load : a load of bodies (`Force`, `Torque`, …), or one of models (`Gravity`, `Traction`, `Pressure`,
            …), which acts on the nodes as on the undeformed mesh and keeps its direction in space.
        amplitude : number, `TimeSeries`, or function of the time in s, by which it is multiplied.
        """
        from kratos_lite.bodies.constraints import Constraint
        from kratos_lite.bodies.loads import bind

        if isinstance(load, Constraint):
            raise InputError(f"a {type(load).__name__} is a constraint, no load: body.constrain takes it")
        self.loads.append(bind(load, self, amplitude))
        self._constant = None

    def constrain(self, constraint: Constraint) -> None:
        """Hold the body: a fixed point or direction, a prescribed motion, a rigid link.

        Raises
        ------
        MeshError
            If a point lies outside the body.
        InputError
            If it is no constraint.
        """
        from kratos_lite.bodies.constraints import Constraint

        if not isinstance(constraint, Constraint):
            raise InputError(
                f"a constraint such as FixPoint is needed; got {type(constraint).__name__}; "
                "loads are for body.add"
            )
        constraint.bind(self)
        self.constraints.append(constraint)
        self.integrated_velocity = None

    def external_load(
        self, q: Array | None = None, time: float | None = None, u: Array | None = None
    ) -> Array:
        """Return the generalized external load (..., dofs) at a configuration, a time in s and a velocity."""
        q, t = self.q if q is None else q, self.time if time is None else time
        u = self.u if u is None else u
        total = np.zeros_like(self.u)
        for load in self.loads:
            total += load(q, u, t)
        return total

    def constant_loads(self) -> tuple[Array, Array, Array]:
        """Return the constant loads: acceleration (..., 3), forces (..., dofs) in space and in the body."""
        if self._constant is not None and self._constant[0] == len(self.loads):
            return self._constant[1]
        lead = self.q.shape[:-1]
        acceleration, spatial, convected = np.zeros((*lead, 3)), np.zeros_like(self.u), np.zeros_like(self.u)
        for load in self.loads:
            amplitude = load.amplitude(self.time)
            if load.acceleration is not None:
                acceleration += amplitude * load.acceleration
            if load.spatial is not None:
                spatial += amplitude * load.spatial
            if load.convected is not None:
                convected += amplitude * load.convected
        self._constant = len(self.loads), (acceleration, spatial, convected)
        return self._constant[1]

    # ---- energies --------------------------------------------------------------------------------

    def kinetic_energy(self) -> Array | float:
        """Return ½ ∫ρ v·v dV, (...) in J."""
        return np.asarray((self.u * self.times_mass(self.u)).sum(axis=-1) / 2)

    def potential_energy(self) -> Array | float:
        """Return the potential energy (...) in J of gravity and other dead loads of constant size."""
        return np.asarray(sum((load.potential(self.q) for load in self.loads), np.zeros(self.q.shape[:-1])))

    def energy(self) -> Array | float:
        """Return kinetic + internal + potential energy, (...) in J."""
        return self.kinetic_energy() + self.internal_energy() + self.potential_energy()

    def __repr__(self) -> str:
        many = f"{len(self.q)} bodies, " if self.q.ndim > 1 else ""
        return f"{type(self).__name__}({many}{self.dofs} velocities, t = {self.time:g} s, {self.scheme})"
