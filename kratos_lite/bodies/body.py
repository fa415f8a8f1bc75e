"""Body: a body under loads and constraints, with its energies; Deformable: one that has a stiffness.

What a kind of body defines is in `free_body`.  Everything else (loads, constraints, energies, time
integration) builds on that.
"""

from __future__ import annotations

import logging
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from kratos_lite.bodies.applied_load import AppliedLoad, BodyLoad, apply_load
from kratos_lite.bodies.constraints import Constraint
from kratos_lite.bodies.free_body import FreeBody
from kratos_lite.bodies.linear_algebra import Solve
from kratos_lite.bodies.validation import Material
from kratos_lite.errors import InputError, ModelError, nearest
from kratos_lite.mesh import Mesh
from kratos_lite.model.checks import check_wave_speeds
from kratos_lite.model.loads import Load
from kratos_lite.model.mass_properties import MassProperties
from kratos_lite.registry import Registry
from kratos_lite.time_series import Factor
from kratos_lite.typing import Array
from kratos_lite.validation import number

_log = logging.getLogger("kratos_lite")
BODIES: Registry[type[Body]] = Registry("kind of body")
"""Every kind of body by its class name and by its `kind`."""


class Body(FreeBody):
    """A body in motion.

    Parameters
    ----------
    mesh, material : the shape and what it is made of, or None for a body given by its mass properties.
    mass_properties : mass, volume, mass center, second-moment (Euler) tensor and inertia tensor.
    q, u : configuration and velocity at the start; the layout depends on the kind of body.
    integrator : name of the time integrator, one of `integrators`; the first of them if None.
    damping : η ≥ 0 in s, viscous stress η C Ė (stiffness-proportional damping).

    Attributes
    ----------
    kind : name of the kind, as in input files.
    time, step : s, and number of steps taken.
    tolerance : relative size of the last Newton step of an implicit integrator.
    loads, constraints : what acts on the body.
    external_work : work of loads and reactions since the start, J.
    integrated_velocity : u after the last step, None before the first.  If u differs from it, or constraints
        are new, time integration starts with an impulse that satisfies the constraints.

    Raises
    ------
    InputError
        The integrator is not available for this kind of body, or the damping is invalid.
    """

    integrators: ClassVar[Mapping[str, str]] = {}
    """Names of the time integrators of the kind of body, the default first, and their aliases in Solfec."""
    mass_is_given = False
    """Whether mass properties were given in place of those of mesh and material."""

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
        integrator: str | None,
        damping: float = 0.0,
    ) -> None:
        super().__init__(mesh, material, mass_properties, q, u)
        for warning in self.warnings():
            _log.warning("%s", warning)
        self.external_work: Array = np.zeros(q.shape[:-1])
        self.loads: list[AppliedLoad] = []
        self.constraints: list[Constraint] = []
        self.integrated_velocity: Array | None = None
        self._constant: tuple[int, tuple[Array, Array, Array]] | None = None
        self.integrator = next(iter(self.integrators), "") if integrator is None else integrator
        self.damping = damping

    def warnings(self) -> list[str]:
        """Return what is allowed, but may be a mistake; it is also logged when the body is made."""
        return []

    # ---- deformation -----------------------------------------------------------------------------

    def internal_force(self, q: Array | None = None) -> Array:
        """Return the generalized internal force vector: what deformation resists with.

        Parameters
        ----------
        q : configuration; that of the body if not given.

        Returns
        -------
        (..., dofs) float.
        """
        return np.zeros_like(self.u)

    def internal_energy(self) -> Array | float:
        """Return the strain energy (...) in J."""
        return np.zeros(self.q.shape[:-1])

    def stiffness(self, q: Array | None = None) -> Any:
        """Return the tangent of `internal_force`.

        Parameters
        ----------
        q : configuration; that of the body if not given.

        Returns
        -------
        (..., 9, 9) float of a pseudo-rigid body, `BlockMatrix` (3n, 3n) of a finite-element one.

        Raises
        ------
        ModelError
            Bodies of this kind do not deform.
        """
        raise ModelError(f"a {self.kind} body has no stiffness; a pseudo-rigid or finite-element one has")

    # ---- conversion to another kind --------------------------------------------------------------

    def settings(self) -> dict[str, Any]:
        """Return the arguments besides mesh and material that make another body like this one."""
        return {
            "mass_properties": self.mass_properties if self.mass_is_given else None,
            "integrator": self.integrator,
            "damping": self.damping,
            "tolerance": self.tolerance,
        }

    @abstractmethod
    def affine_motion(self) -> tuple[Array, Array, Array]:
        """Return the affine motion nearest to the body with respect to mass.

        Returns
        -------
        F and Ḟ (3, 3), in 1/s, and the place (3,) of X̄ in m.
        """

    @abstractmethod
    def set_affine_motion(self, F: Array, rate: Array, center: Array, velocity: Array) -> None:
        """Take on the motion that is nearest to an affine one, but for the angular velocity of a rigid body.

        Parameters
        ----------
        F, rate : (3, 3), deformation gradient and its rate in 1/s.
        center, velocity : (3,), place of X̄ in m, and velocity of the mass center in m/s.
        """

    @property
    def integrator(self) -> str:
        """Name of the time integrator, one of `integrators`; Solfec's acronyms are aliases."""
        return self._integrator

    @integrator.setter
    def integrator(self, name: str) -> None:
        names = [word for word, alias in self.integrators.items() if name in (word, alias or word)]
        if not names:
            known = [*self.integrators, *filter(None, self.integrators.values())]
            hint = nearest(name, known, 1) if isinstance(name, str) else ""
            text = f"the integrators of a {self.kind} body are {', '.join(self.integrators)}; got {name!r}"
            raise InputError(f"{text}.{hint}" if hint else text)
        self._integrator = names[0]

    @property
    def damping(self) -> float:
        """Stiffness-proportional damping η in s, ≥ 0."""
        return self._damping

    @damping.setter
    def damping(self, value: float) -> None:
        self._damping = number(value, "a damping", least=0, unit="s")

    @property
    def tolerance(self) -> float:
        """Relative size of the last Newton step of an implicit integrator, 0 … 1; 0 means to round-off."""
        return self._tolerance

    @tolerance.setter
    def tolerance(self, value: float) -> None:
        self._tolerance = number(value, "a tolerance", least=0, below=1)

    # ---- loads and constraints -------------------------------------------------------------------

    def add(self, load: BodyLoad | Load, *, amplitude: Factor | None = None) -> None:
        """Let a load act.

        Parameters
        ----------
        load : a load of bodies (`Force`, `Torque`, …), or one of models (`Gravity`, `Traction`, `Pressure`,
            …), which acts on the nodes as on the undeformed mesh and keeps its direction in space.
        amplitude : number, `TimeSeries`, or function of the time in s that multiplies the load.

        Raises
        ------
        InputError
            `load` is not a load, or the amplitude is invalid.
        ModelError, MeshError
            It does not act on bodies of this kind, or a point lies outside the body.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
        >>> body.add(kl.Force(body.center, (1.0, 0.0, 0.0)), amplitude=lambda t: 3.0 * t)
        >>> body.external_force(time=2.0).tolist()
        [0.0, 0.0, 0.0, 6.0, 0.0, 0.0]
        """
        if isinstance(load, Constraint):
            raise InputError(f"a {type(load).__name__} is a constraint, not a load: use body.constrain")
        self.loads.append(apply_load(load, self, amplitude))
        self._constant = None

    def constrain(self, constraint: Constraint) -> None:
        """Hold the body: a fixed point or direction, a prescribed motion, a rigid link.

        Parameters
        ----------
        constraint : of this body alone; it holds the body where it is now.

        Raises
        ------
        MeshError
            A point lies outside the body.
        ModelError
            The body is a batch of bodies, or the constraint is already bound to another body.
        InputError
            `constraint` is not a constraint.
        """
        if not isinstance(constraint, Constraint):
            raise InputError(
                f"a constraint such as FixPoint is needed; got {type(constraint).__name__}; "
                "loads are for body.add"
            )
        constraint.bind(self)
        self.constraints.append(constraint)
        self.integrated_velocity = None

    def external_force(
        self, q: Array | None = None, time: float | None = None, u: Array | None = None
    ) -> Array:
        """Return the generalized external force vector.

        Parameters
        ----------
        q, time, u : configuration, time in s and velocity; those of the body if not given.

        Returns
        -------
        (..., dofs) float.
        """
        q, u = self.q if q is None else q, self.u if u is None else u
        time = self.time if time is None else time
        return sum((load(q, u, time) for load in self.loads), np.zeros_like(self.u))

    def constant_loads(self) -> tuple[Array, Array, Array]:
        """Return acceleration (..., 3) and forces (..., dofs) fixed in space and body of constant loads."""
        if self._constant is None or self._constant[0] != len(self.loads):
            totals = np.zeros((*self.q.shape[:-1], 3)), np.zeros_like(self.u), np.zeros_like(self.u)
            for load in self.loads:
                for i, part in enumerate((load.acceleration, load.spatial, load.follower)):
                    if part is not None:
                        totals[i][...] += load.amplitude(self.time) * part
            self._constant = len(self.loads), totals
        return self._constant[1]

    # ---- energies --------------------------------------------------------------------------------

    def kinetic_energy(self) -> Array | float:
        """Return ½ ∫ρ v·v dV (...) in J."""
        return np.asarray((self.u * self.times_mass(self.u)).sum(axis=-1) / 2)

    def potential_energy(self) -> Array | float:
        """Return the potential energy (...) in J of gravity, springs and other constant dead loads."""
        return np.asarray(sum((load.potential(self.q) for load in self.loads), np.zeros(self.q.shape[:-1])))

    def energy(self) -> Array | float:
        """Return kinetic + internal + potential energy (...) in J."""
        return self.kinetic_energy() + self.internal_energy() + self.potential_energy()

    def __repr__(self) -> str:
        many = f"{len(self.q)} bodies, " if self.q.ndim > 1 else ""
        return f"{type(self).__name__}({many}{self.dofs} velocities, t = {self.time:g} s, {self.integrator})"


class Deformable(Body):
    """A body whose configurations form a linear space: q + h u is one again.

    Its integrators are ``"explicit"``: momenta exact, energy bounded, steps up to `critical_step`;
    ``"linearly_implicit"``: linear momentum exact, angular momentum to O(h⁴), not safe for stiff spinning
    bodies; ``"energy_momentum"``: implicit, energy and both momenta exact whatever the step.  Solfec's
    DEF_EXP and DEF_LIM, and ENERGY_MOMENTUM, are aliases.
    """

    jacobian_is_constant = True
    integrators: ClassVar[Mapping[str, str]] = {
        "energy_momentum": "ENERGY_MOMENTUM",
        "linearly_implicit": "DEF_LIM",
        "explicit": "DEF_EXP",
    }

    def warnings(self) -> list[str]:
        """Return materials whose waves are so slow or quick that their units may be wrong."""
        given = self.material
        materials = given.values() if isinstance(given, Mapping) else [] if given is None else [given]
        return check_wave_speeds(materials)

    @abstractmethod
    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c K(q)) x = b, with the tangent K of the internal force vector.

        Parameters
        ----------
        q : configuration.
        c : s².

        Returns
        -------
        function of columns b (dofs, k) or (dofs,) that returns x.
        """

    @abstractmethod
    def extent(self) -> float:
        """Return the size of what displacements are added to: coordinates in m, or the 1 of F."""

    @abstractmethod
    def highest_frequency(self) -> float:
        """Return an upper bound of the angular frequencies in rad/s at the configuration."""

    def critical_step(self) -> float:
        """Return the longest stable step in s of the explicit integrator: h²ω²/2 + h η ω² ≤ 2."""
        h = 2.0 / self.highest_frequency()
        return float(h * h / (np.hypot(h, self.damping) + self.damping))
