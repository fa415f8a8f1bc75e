"""J2Plasticity3D: plasticity of von Mises with isotropic and kinematic hardening."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import MaterialError
from kratos_lite.materials.isotropic_law import ELASTIC, IsotropicLaw
from kratos_lite.materials.material import GaussState, Response
from kratos_lite.typing import Array, ArrayLike
from kratos_lite.validation import Axes

CONVERGED = 1e-13
"""Fraction of the yield stress that the return may miss."""
MOST_ITERATIONS = 50


@dataclass(frozen=True)
class J2Plasticity3D(IsotropicLaw):
    """Elastic up to the yield stress of von Mises, then plastic flow without change of volume.

    The yield stress grows with the accumulated plastic strain p, and its center, the back stress, with the
    plastic strain:

        σ_Y(p) = yield_stress + c(p) + hardening p + v(p),
        v(p) = (saturation_stress - yield_stress) (1 - exp(-exponent p)),
        dα = ⅔ kinematic dε_p.

    Parameters
    ----------
    E, nu : Young's modulus in Pa and Poisson's ratio.
    yield_stress : Pa, > 0.
    hardening : linear isotropic hardening modulus in Pa, ≥ 0.
    kinematic : kinematic hardening modulus in Pa, ≥ 0.
    saturation_stress : Pa, ≥ yield_stress, to which the yield stress grows (Voce); 0 for none.
    exponent : rate of that growth, ≥ 0.
    density : kg/m³.
    alpha : thermal expansion in 1/K; see `Temperature`.
    curve : measured rows of p > 0 and yield_stress + c(p) in Pa, which never fall; c is linear between them,
        from 0 at p = 0, and constant after the last.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds.

    Notes
    -----
    Radial return with the consistent tangent.  Source: Simo & Hughes, Computational Inelasticity (1998),
    boxes 3.1 and 3.2.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> steel = kl.J2Plasticity3D(E=200e9, nu=0.3, yield_stress=250e6)
    >>> shear = np.array([0, 0, 0, 0.01, 0, 0])
    >>> stress, _, state = steel.evaluate(shear, steel.initial_state(), 1.0)
    >>> print(f"{stress[3] / 1e6:.2f} MPa")  # σ_Y / √3
    144.34 MPa

    With a measured curve, in which a plastic strain of 2 % belongs to 310 MPa:

    >>> steel = kl.J2Plasticity3D(200e9, 0.3, 250e6, curve=[(0.01, 300e6), (0.05, 340e6)])
    >>> path = kl.material_point(steel, {"xx": [0.0, 310e6 / 200e9 + 0.02]})
    >>> print(f"{path.stress[-1, 0] / 1e6:.1f} MPa")
    310.0 MPa
    """

    E: float
    nu: float
    yield_stress: float
    hardening: float = 0.0
    kinematic: float = 0.0
    saturation_stress: float = 0.0
    exponent: float = 0.0
    density: float = 0.0
    alpha: float = 0.0
    curve: ArrayLike = ()

    keeps_volume: ClassVar[bool] = True
    positive: ClassVar[Mapping[str, str]] = {"yield_stress": "Pa"}
    not_negative: ClassVar[Mapping[str, str]] = {
        "hardening": "Pa; for softening take J2Softening3D",
        "kinematic": "Pa",
        "exponent": "",
    }
    tables: ClassVar[Mapping[str, Axes]] = {"curve": ("rows", 2)}
    aliases: ClassVar[tuple[str, ...]] = (
        "SmallStrainJ2Plasticity3DLaw",
        "SmallStrainJ2Plasticity3D",
        "PlasticityIsotropicKinematicJ2Law",
    )
    variables: ClassVar[dict[str, str]] = ELASTIC | {
        "yield_stress": "YIELD_STRESS",
        "hardening": "ISOTROPIC_HARDENING_MODULUS",
        "saturation_stress": "EXPONENTIAL_SATURATION_YIELD_STRESS",
        "exponent": "HARDENING_EXPONENT",
    }
    internal_variables: ClassVar[Mapping[str, int]] = {
        "plastic_strain": 6,
        "accumulated_plastic_strain": 1,
        "back_stress": 6,
    }

    def check(self) -> None:
        """Check that the yield stress does not fall."""
        super().check()
        p, stress, _ = self._curve
        if not ((np.diff(p) > 0).all() and (np.diff(stress) >= 0).all()):
            raise MaterialError(
                "the plastic strains of a curve grow from 0, and its stresses do not fall from yield_stress "
                f"{self.yield_stress:g} Pa at 0, which is no row of it; got {self.curve}"
            )
        if self.saturation_stress and self.saturation_stress < self.yield_stress:
            raise MaterialError(
                f"{self._name('saturation_stress')} {self.saturation_stress:g} must be ≥ the yield stress "
                f"{self.yield_stress:g} Pa, or 0 for none"
            )

    @cached_property
    def _curve(self) -> tuple[Array, Array, Array]:
        """Plastic strains (k,) from 0 of the curve, its stresses in Pa, and its slopes after them."""
        p, stress = np.vstack([(0.0, self.yield_stress), np.reshape(self.curve, (-1, 2))]).T
        with np.errstate(all="ignore"):  # checked later
            return p, stress, np.append(np.diff(stress) / np.diff(p), 0.0)

    def _yield_stress(self, p: Array) -> tuple[Array, Array]:
        """Return the yield stress in Pa and its slope at accumulated plastic strains p (...)."""
        rise = max(self.saturation_stress - self.yield_stress, 0.0)
        decay = np.exp(-self.exponent * p)
        stress = self.hardening * p + rise * (1 - decay)
        slope = self.hardening + rise * self.exponent * decay
        if not self.curve:
            return self.yield_stress + stress, slope
        knots, stresses, slopes = self._curve
        after = slopes[np.searchsorted(knots, p, side="right") - 1]
        return np.interp(p, knots, stresses) + stress, slope + after

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return stress, consistent tangent and internal variables; see `Material.response`."""
        G = self.elastic.lame[1]
        stress, n, q = self._trial(strain, state)
        p = state["accumulated_plastic_strain"][..., 0]
        dp, slope = self._increment(q, p, G)
        flow = (1.5**0.5 * dp)[..., None] * n
        new = {
            "plastic_strain": state["plastic_strain"] + flow * voigt.SHEAR_TWICE,
            "accumulated_plastic_strain": (p + dp)[..., None],
            "back_stress": state["back_stress"] + 2 / 3 * self.kinematic * flow,
        }
        if not dp.any():
            return stress, self.elastic.C, new
        growth = np.where(dp > 0, 1 / (3 * G + self.kinematic + slope), 0.0)
        return stress - 2 * G * flow, self._consistent(n, q, dp, growth), new

    def _trial(self, strain: Array, state: GaussState) -> tuple[Array, Array, Array]:
        """Return the elastic trial stress (..., 6), s/|s| and √(3/2) |s| (...), s from its center."""
        center = state["back_stress"]
        stress = voigt.times(strain - state["plastic_strain"], self.elastic.C)
        s = voigt.deviator(stress) - center
        norm = np.sqrt(s**2 @ voigt.SHEAR_TWICE)
        return stress, s / np.where(norm > 0, norm, 1.0)[..., None], 1.5**0.5 * norm

    def _consistent(self, n: Array, q: Array, dp: Array, slope: Array) -> Array:
        """Return ∂σ/∂ε of a return by Δp from the trial q along n, where Δp grows with q by a slope (...)."""
        G = self.elastic.lame[1]
        beta = 6 * G**2 * dp / np.where(q > 0, q, 1.0)
        D = np.einsum("...i,...j->...ij", (beta - 6 * G**2 * slope)[..., None] * n, n)
        D += self.elastic.C
        D -= beta[..., None, None] * voigt.DEVIATOR
        return D

    def _increment(self, q: Array, p: Array, G: float) -> tuple[Array, Array]:
        """Return the increment of p at which q - (3G + kinematic) Δp = σ_Y(p + Δp), and the slope of σ_Y."""
        dp = np.zeros_like(q)
        for knot in self._curve[0][1:]:  # begin at the last below the end
            at = np.maximum(knot - p, 0.0)
            is_below = q - (3 * G + self.kinematic) * at > self._yield_stress(p + at)[0]
            dp = np.where(is_below, at, dp)
        stress, slope = self._yield_stress(p + dp)
        plastic = q - (3 * G + self.kinematic) * dp > stress
        for _ in range(MOST_ITERATIONS):  # a convex function between knots: Newton comes from below
            excess = np.where(plastic, q - (3 * G + self.kinematic) * dp - stress, 0.0)
            if (np.abs(excess) <= CONVERGED * np.maximum(q, self.yield_stress)).all():
                break
            dp = dp + excess / (3 * G + self.kinematic + slope)
            stress, slope = self._yield_stress(p + dp)
        return dp, slope
