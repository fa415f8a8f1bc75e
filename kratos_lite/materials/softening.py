"""Softening: plasticity whose yield stress depends on the energy that the flow dissipates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import MaterialError, SolveError
from kratos_lite.materials.isotropic_law import ELASTIC, IsotropicLaw, check_angles
from kratos_lite.materials.material import GaussState, Material, Response
from kratos_lite.materials.softening_curves import CURVES, EXPONENTIAL, PEAKED, PERFECT, POINTS, POLYNOMIAL
from kratos_lite.materials.yield_surfaces import SURFACES, WITH_ANGLE, Invariants, Surface
from kratos_lite.typing import Array, ArrayLike
from kratos_lite.validation import Axes, short

FLOWING, CLOSE, BAND, MOST_RETURNS = 1e-10, 1e-4, 0.05, 100
"""Excess, in parts of the yield stress, that flows, and that ends the return; how it fades; steps of it."""
MOST = 0.9999
"""Fraction of the fracture energy that is dissipated at most."""
STEP = 1e-30
"""Imaginary strain of derivatives, which are exact for any so small."""
NEARLY_0 = 1e-3
"""Fraction of the last plastic strain of a curve that the first may be, of total strains less σ / E."""
NO_SIZE = 1e-200
"""Radius in m of a point without an element, at which nothing falls, but what hardens does."""


@dataclass(frozen=True)
class Softening(IsotropicLaw, family=True):
    """A yield surface, a potential of the flow, and a curve of the yield stress over dissipated energy."""

    # Sources: Oller, Nonlinear Dynamics of Structures (2014); Nayak & Zienkiewicz, Int. J. Numer. Methods
    # Eng. 5 (1972) 113; GenericConstitutiveLawIntegratorPlasticity of KratosConstitutiveLawsApplication,
    # which takes the same steps.  Derivatives by complex steps: Squire & Trapp, SIAM Rev. 40 (1998) 110.

    E: float
    nu: float
    yield_stress: float
    fracture_energy: float
    curve: float = EXPONENTIAL
    compression: float = 0.0
    density: float = 0.0
    alpha: float = 0.0
    friction: float = 0.0
    dilatancy: float = 0.0
    peak: float = 0.0
    peak_at: float = 0.0
    linear_until: float = 0.0
    strains: ArrayLike = ()
    stresses: ArrayLike = ()
    potential: str = ""

    surface: ClassVar[str] = ""
    positive: ClassVar[Mapping[str, str]] = {"yield_stress": "Pa", "fracture_energy": "J/m²"}
    not_negative: ClassVar[Mapping[str, str]] = {"compression": "Pa"}
    tables: ClassVar[Mapping[str, Axes]] = {
        "strains": ("points",),
        "stresses": ("points",),
    }
    words: ClassVar[Mapping[str, tuple[str, ...]]] = {"potential": ("", *SURFACES)}
    variables: ClassVar[dict[str, str]] = ELASTIC | {
        "yield_stress": "YIELD_STRESS_TENSION",
        "fracture_energy": "FRACTURE_ENERGY",
        "curve": "HARDENING_CURVE",
        "compression": "YIELD_STRESS_COMPRESSION",
        "friction": "FRICTION_ANGLE",
        "dilatancy": "DILATANCY_ANGLE",
        "peak": "MAXIMUM_STRESS",
        "peak_at": "MAXIMUM_STRESS_POSITION",
        "linear_until": "PLASTIC_DISSIPATION_LIMIT_LINEAR_SOFTENING",
        "strains": "PLASTIC_STRAIN_VECTOR_PLASTICITY_POINT_CURVE",
        "stresses": "EQUIVALENT_STRESS_VECTOR_PLASTICITY_POINT_CURVE",
    }
    internal_variables: ClassVar[Mapping[str, int]] = {
        "plastic_strain": 6,
        "plastic_dissipation": 1,
        "element_radius": 1,
    }

    @property
    def keeps_volume(self) -> bool:  # type: ignore[override]
        """Whether the flow does not change the volume."""
        return not {self.surface, self._potential} & WITH_ANGLE

    @property
    def symmetric_tangent(self) -> bool:  # type: ignore[override]
        """Whether the flow is that of a round surface, and what softens it is symmetric, too."""
        surface, flow = self._surfaces
        is_alike = self._is_radial and self.surface == "VonMises"
        return is_alike or (surface.is_round and surface == flow and self.curve == PERFECT)

    @property
    def has_corners(self) -> bool:
        """Whether surface or potential depend on Lode's angle."""
        return not all(surface.is_round for surface in self._surfaces)

    @property
    def strength(self) -> float:
        """The equivalent stress in Pa at which a bar begins to flow."""
        return self.yield_stress * self._surfaces[0].of_tension

    @property
    def _is_radial(self) -> bool:
        """Whether the return only shrinks the deviator."""
        surface, flow = self._surfaces
        return surface.is_round and surface == flow and self.curve != POLYNOMIAL and self._ratio == 1

    @property
    def _potential(self) -> str:
        return self.potential or self.surface

    @property
    def _ratio(self) -> float:
        """Yield stress of compression over that of tension."""
        return (self.compression or self.yield_stress) / self.yield_stress

    @cached_property
    def _surfaces(self) -> tuple[Surface, Surface]:
        """The yield surface and the potential."""
        flow = SURFACES[self._potential](self.dilatancy, self._ratio)
        return SURFACES[self.surface](self.friction, self._ratio), flow

    @classmethod
    def from_variables(cls, values: dict[str, Any]) -> Material:
        """Make the material from the variables of a file; YIELD_STRESS stands for both."""
        given = {}
        if "YIELD_STRESS" in values:
            given = {"YIELD_STRESS_TENSION": values["YIELD_STRESS"], "YIELD_STRESS_COMPRESSION": 0.0}
        for name in ("TANGENCY_REGION2", "TOTAL_OR_PLASTIC_STRAIN_SPACE"):
            if values.get(name):
                raise MaterialError(f"{name} is not supported; leave it out, or solve with Kratos")
        names = cls.variables["strains"], cls.variables["stresses"]
        if values.get("HARDENING_CURVE") == POLYNOMIAL:
            own = ("PLASTIC_STRAIN_INDICATORS", "CURVE_FITTING_PARAMETERS")
            given |= {name: values[old] for name, old in zip(names, own, strict=True) if old in values}
        elif (total := values.get("TOTAL_STRAIN_VECTOR_PLASTICITY_POINT_CURVE")) is not None:
            given[names[0]] = np.subtract(total, np.divide(values[names[1]], values["YOUNG_MODULUS"]))
        law = str(values.get("CONSTITUTIVE_LAW", ""))
        word = law.rpartition(f"Plasticity3D{cls.surface}")[2]
        given |= {"potential": word} if word in SURFACES and word != cls.surface else {}
        return super().from_variables(values | given)

    def check(self) -> None:
        """Check the curve with its constants, and the angles."""
        super().check()
        if self.curve not in CURVES:
            raise MaterialError(f"{self._name('curve')} must be one of {list(CURVES)}; got {self.curve:g}")
        if self.surface in WITH_ANGLE or self._potential in WITH_ANGLE:
            check_angles(self)
        if not 0 <= self.linear_until < 1:
            raise MaterialError(f"{self._name('linear_until')} {self.linear_until:g} must lie in 0 … 1")
        if self.curve == PEAKED and not (self.peak > self.strength and 0 < self.peak_at < 1):
            names = f"{self._name('peak')} > {self.strength:g} Pa and 0 < {self._name('peak_at')} < 1"
            raise MaterialError(f"curve 2 needs {names}; got {self.peak:g} and {self.peak_at:g}")
        rows = np.shape(self.strains), np.shape(self.stresses)
        is_growing = bool((np.diff(self.strains) > 0).all() and (np.asarray(self.stresses)[:1] > 0).all())
        if self.curve == POLYNOMIAL and not (rows[0] == (2,) and rows[1] > (0,) and is_growing):
            raise MaterialError(
                f"curve 4 needs two strains that grow and the terms of a polynomial in Pa; got {rows}"
            )
        if self.curve == POINTS and not (
            rows[0] == rows[1] > (1,)
            and is_growing
            and np.min(self.stresses) > 0
            and abs(np.take(self.strains, 0)) <= NEARLY_0 * np.max(self.strains)
        ):
            got = short([self.strains, self.stresses])
            raise MaterialError(
                f"curve 6 needs strains from 0 that grow, and as many stresses > 0; got {got}"
            )

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return stress and internal variables; SolveError for what would snap back."""
        stress = voigt.times(strain - state["plastic_strain"], self.elastic.C)
        new, variables = {n: state[n].copy() for n in self.internal_variables}, self._variables(state)
        q, limit, *_ = self._yielding(Invariants(stress), *variables)
        flows = q > limit * (1 + FLOWING)
        if flows.any():
            found = self._return(stress[flows], *(values[flows] for values in variables))
            stress[flows], new["plastic_strain"][flows], new["plastic_dissipation"][flows, 0] = found
        return stress, None, new

    def _tangent(self, strain: Array, state: GaussState, dt: float, stress: Array) -> Array:
        """Return the consistent tangent (..., 6, 6), where it is requested."""
        C, variables = self.elastic.C, self._variables(state)
        trial = voigt.times(strain - state["plastic_strain"], C)
        flows = (stress != trial).any(axis=-1)
        D = np.broadcast_to(C, (*strain.shape, 6)).copy()
        at, (lam, G) = Invariants(trial[flows]), self.elastic.lame
        ways = np.stack([at.s + voigt.UNIT - at.s, at.s]) if self._is_radial else C[:, None]
        moved: Any = at.stress + 1j * STEP * ways
        there = self._return(moved, *(values[flows] for values in variables))[0]
        slopes = there.imag / STEP
        if not self._is_radial:
            D[flows] = np.moveaxis(slopes, 0, -1)
            return D
        # σ = β s + (tr σ / 3) 1 with β and tr σ of tr and |s| of the trial: what turns s comes out β times.
        square = np.where(at.some, at.s**2 @ voigt.SHEAR_TWICE, 1.0)[:, None]
        beta = (there[0].real * at.s) @ voigt.SHEAR_TWICE / square[:, 0]
        by_trace, by_size = slopes - beta[:, None] * ways
        normal = (lam + 2 / 3 * G) * by_trace[..., None] * voigt.UNIT
        D[flows] = beta[:, None, None] * C + normal + (2 * G * by_size / square)[..., None] * at.s[:, None]
        return D

    def _variables(self, state: GaussState) -> tuple[Array, Array, Array]:
        """Return plastic strain, κ and the fracture energy in J/m³ of points."""
        radius = state["element_radius"][..., 0]
        radius = np.maximum(radius, NO_SIZE) if self.curve in (POLYNOMIAL, POINTS) else radius
        energy = np.divide(self.fracture_energy, radius, out=np.full_like(radius, np.inf), where=radius > 0)
        return state["plastic_strain"], state["plastic_dissipation"][..., 0], energy

    def _yielding(self, at: Invariants, plastic: Array, kappa: Array, energy: Array) -> tuple[Array, ...]:
        """Return equivalent and yield stress, the slope of that by κ, and both surfaces' normals."""
        surface, flow = self._surfaces
        q, across = at.equivalent(surface)
        along = across if flow == surface and flow.is_round else at.equivalent(flow, own=False)[1]
        p = (at.stress * plastic).sum(axis=-1) / np.where(np.abs(q) > 0, q, 1.0)
        return q, *CURVES[int(self.curve)](self, kappa, energy, p), across, along

    def _stress(self, strain: Array) -> Array:
        """Return C ε, faster of complex numbers than a product."""
        lam, G = self.elastic.lame
        return lam * strain[..., :3].sum(axis=-1)[..., None] * voigt.UNIT + 2 * G * strain * voigt.HALF_SHEAR

    def _damaging(self, at: Invariants, flow: Array, energy: Array) -> Array:
        """Return what a plastic strain adds to κ: that of compression has more energy."""
        tension = at.tension() if self._ratio != 1 else 1.0
        return (tension + (1 - tension) / self._ratio**2) / energy * (at.stress * flow).sum(axis=-1)

    def _return(self, stress: Array, plastic: Array, kappa: Array, energy: Array) -> tuple[Array, ...]:
        """Return what a trial stress (..., 6) comes to, its plastic strain and κ."""
        at, kappa, least = Invariants(stress), kappa + 0 * stress[..., 0], FLOWING / 2
        mean = self._surfaces[0].mean
        for _ in range(MOST_RETURNS):
            q, limit, slope, across, along = self._yielding(at, plastic, kappa, energy)
            over = (q / limit - 1 - least) / (BAND * least)
            if not (over.real > 0).any():
                return at.stress, plastic, kappa
            stiffness = (across * self._stress(along)).sum(axis=-1)
            stiffness = stiffness + slope * self._damaging(at, along, energy)
            if (stiffness.real[over.real > 0] <= 0).any():
                raise SolveError(
                    f"{type(self).__name__}: an element of radius "
                    f"{self.fracture_energy / energy.min():.3g} m would snap back; take a finer mesh, or "
                    "smaller steps"
                )
            part = np.where(over.real <= 0, 0.0, np.where(over.real < 1, over, 1.0))
            flow = (part * (q - limit) / stiffness)[..., None] * along
            after = Invariants(at.stress - self._stress(flow))
            beyond = ((after.s * at.s).real.sum(axis=-1) < 0) & (over.real > 0) & (mean > 0)
            if beyond.any():  # the apex
                apex = (limit / (3 * (mean or 1)))[..., None] * voigt.UNIT
                after = Invariants(np.where(beyond[..., None], apex, after.stress))
                flow = (at.stress - after.stress) @ np.linalg.inv(self.elastic.C)
            kappa = kappa + _between(self._damaging(after, flow, energy))
            kappa = np.where(kappa.real < MOST, kappa, MOST)
            at, plastic, least = after, plastic + flow, CLOSE
        raise SolveError(f"{type(self).__name__}: the return to the yield surface does not end")


def _between(growth: Array) -> Array:
    """Return what κ grows by, nothing where that is no fraction."""
    return np.where((growth.real > 0) & (growth.real <= 1), growth, 0.0)


def names_in_kratos(surface: str) -> tuple[str, ...]:
    """Return the names of laws of Kratos with a surface and any potential, its own first."""
    return tuple(f"SmallStrainIsotropicPlasticity3D{surface}{flow}" for flow in {surface: 0, **SURFACES})
