"""J2Softening3D: plasticity of von Mises that softens, with an energy that the mesh does not change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import MaterialError, SolveError
from kratos_lite.materials.isotropic_law import ELASTIC, VonMises
from kratos_lite.materials.material import GaussState, Material, Response
from kratos_lite.typing import Array

LINEAR, EXPONENTIAL, PERFECT = 0, 1, 3
"""HARDENING_CURVE of Kratos."""
MOST = 0.9999
"""Fraction of the fracture energy that is dissipated at most."""


@dataclass(frozen=True)
class J2Softening3D(VonMises):
    """Elastic up to the yield stress of von Mises, which falls with the dissipated energy: σ_Y (1 - κ).

    κ is the work of the stress over plastic strains relative to the fracture energy over the radius of the
    element, from its center to its farthest node; in a bar the stress falls exponentially, or linearly, with
    σ_Y √(1 - κ).

    Parameters
    ----------
    E, nu : Young's modulus in Pa and Poisson's ratio.
    yield_stress : σ_Y in Pa, > 0.
    fracture_energy : J/m², > 0.
    curve : 0 to soften linearly, 1 exponentially, 3 for perfect plasticity.
    compression : yield stress of compression in Pa, the same; 0 if not given.
    density : kg/m³.
    alpha : thermal expansion in 1/K; see `Temperature`.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds.

    Notes
    -----
    The plastic strain of a step of exponential softening is Δp = (q - σ_Y (1 - κ)) / (3 G - σ_Y q / g) with
    the equivalent stress q of the elastic trial and g, fracture energy over radius: it takes the softening at
    the trial stress, and meets the yield condition to the second order in Δp.  Source: Oller, Nonlinear
    Dynamics of Structures (2014), and GenericConstitutiveLawIntegratorPlasticity of
    KratosConstitutiveLawsApplication, which does the same.

    Examples
    --------
    >>> steel = J2Softening3D(E=200e9, nu=0.3, yield_stress=200e6, fracture_energy=4e5)
    >>> start = steel.initial_state()
    >>> start["element_radius"][:] = 0.05
    >>> stress, _, state = steel.evaluate(np.array([0, 0, 0, 4e-3, 0, 0]), start, 1.0)
    >>> bool(0 < state["plastic_dissipation"][0] < 1) and bool(stress[3] < 200e6 / 3**0.5)
    True
    """

    E: float
    nu: float
    yield_stress: float
    fracture_energy: float
    curve: float = EXPONENTIAL
    compression: float = 0.0
    density: float = 0.0
    alpha: float = 0.0

    positive: ClassVar[Mapping[str, str]] = {"yield_stress": "Pa", "fracture_energy": "J/m²"}
    aliases: ClassVar[tuple[str, ...]] = ("SmallStrainIsotropicPlasticity3DVonMisesVonMises",)
    variables: ClassVar[dict[str, str]] = ELASTIC | {
        "yield_stress": "YIELD_STRESS_TENSION",
        "fracture_energy": "FRACTURE_ENERGY",
        "curve": "HARDENING_CURVE",
        "compression": "YIELD_STRESS_COMPRESSION",
    }
    internal_variables: ClassVar[Mapping[str, int]] = {
        "plastic_strain": 6,
        "plastic_dissipation": 1,
        "element_radius": 1,
    }

    @property
    def cones(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Factors of tr σ and √J₂ in the equivalent stress, and in the potential of the flow."""
        return (0.0, 3**0.5), (0.0, 3**0.5)

    @property
    def strength(self) -> float:
        """The equivalent stress in Pa at which a bar begins to flow."""
        return self.yield_stress

    @classmethod
    def from_variables(cls, values: dict[str, Any]) -> Material:
        """Make the material from the variables of a file; YIELD_STRESS stands for that of tension."""
        given = {"YIELD_STRESS_TENSION": values["YIELD_STRESS"]} if "YIELD_STRESS" in values else {}
        return super().from_variables(given | values)

    def check(self) -> None:
        """Check the curve, and that compression is like tension."""
        super().check()
        if self.curve not in (LINEAR, EXPONENTIAL, PERFECT):
            raise MaterialError(
                f"{self._name('curve')} must be 0, linear softening, 1, exponential softening, or 3, perfect "
                f"plasticity; got {self.curve:g}"
            )
        if self.compression not in (0, self.yield_stress):
            raise MaterialError(
                f"{self._name('compression')} {self.compression:g} must be that of tension, "
                f"{self.yield_stress:g} Pa: one fracture energy stands for both"
            )

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return stress, consistent tangent and internal variables; SolveError for what would snap back."""
        lam, G = self.elastic.lame
        K, (mean, root), (mean_flow, root_flow) = lam + 2 * G / 3, *self.cones
        stress, n, q = self.trial(strain, state)
        volume, root_J2 = stress[..., :3].sum(axis=-1), q / 3**0.5
        q, work = mean * volume + root * root_J2, mean_flow * volume + root_flow * root_J2
        kappa = state["plastic_dissipation"][..., 0]
        per_energy = state["element_radius"][..., 0] / self.fracture_energy  # 1/g
        power = {LINEAR: 0.5, EXPONENTIAL: 1.0, PERFECT: 0.0}[int(self.curve)]
        limit = self.strength * (1 - kappa) ** power
        soft = power * limit / (1 - kappa) * per_energy
        plastic = q > limit * (1 + 1e-10)
        slope = 9 * K * mean * mean_flow + G * root * root_flow - soft * work
        if (plastic & (slope <= 0)).any():
            raise SolveError(
                f"{type(self).__name__}: an element of radius {float(state['element_radius'].max()):.3g} m "
                "would snap back; take a finer mesh, or smaller steps"
            )
        dp = np.where(plastic, (q - limit) / slope, 0.0)
        loss = G * root_flow * dp / np.where(plastic, root_J2, 1.0)  # fraction of the deviator that goes
        apex = (loss > 1) & (mean > 0)
        beta = np.where(apex, 1.0, loss)
        volumetric = np.where(apex, (volume - limit / (mean or 1.0)) / (9 * K), mean_flow * dp)
        work = (volume - 9 * K * volumetric) * volumetric + (1 - beta) * beta * root_J2**2 / G
        deviatoric = (beta * root_J2 / 2**0.5 / G)[..., None] * n
        flow = volumetric[..., None] * voigt.UNIT + deviatoric * voigt.SHEAR_TWICE
        new = {
            "plastic_strain": state["plastic_strain"] + flow,
            "plastic_dissipation": np.clip(kappa + work * per_energy, 0, MOST)[..., None],
            "element_radius": state["element_radius"].copy(),
        }
        of_cones = (3 * K * a * voigt.UNIT + 2**0.5 * G * b * n for a, b in self.cones)
        across, along = of_cones
        growth = np.where(plastic, 1 / slope, 0.0)[..., None] * (across + (soft * dp)[..., None] * along)
        D = np.einsum("...i,...j->...ij", 2 * G * beta[..., None] * n, n)
        D -= np.einsum("...i,...j->...ij", along, growth)
        D += self.elastic.C - 2 * G * beta[..., None, None] * voigt.DEVIATOR
        D[apex] = 0.0
        return stress - voigt.times(flow, self.elastic.C), D, new
