"""FiniteJ2Plasticity3D: plasticity of von Mises at large strains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import MaterialError, SolveError
from kratos_lite.materials.j2_plasticity3d import J2Plasticity3D
from kratos_lite.materials.material import GaussState, Response
from kratos_lite.typing import Array


@dataclass(frozen=True)
class FiniteJ2Plasticity3D(J2Plasticity3D):
    """Plasticity of von Mises at large strains, with isotropic hardening.

    F = F_e F_p; the energy is K/2 (½ (J² - 1) - ln J) + μ/2 (tr b̄_e - 3) with b̄_e = J^(-⅔) F_e F_e^T, the
    equivalent stress of Cauchy's stress is at most σ_Y(p), and plastic flow keeps the volume.

    Parameters
    ----------
    E, nu, yield_stress, hardening, saturation_stress, exponent, density, alpha, curve : as of
        `J2Plasticity3D`; p is the logarithmic plastic strain of a bar, stresses are true ones.
    kinematic : 0.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds.

    Notes
    -----
    Radial return with J σ_Y for Kirchhoff's stress, and a tangent by differences.  A step that strains a bar
    by δ misses its plastic strain by δ/2 of it: 1 % in steps of 2 %.  The internal variable
    ``plastic_metric`` is C_p⁻¹ - 1 of C_p = F_p^T F_p.  Source: Simo & Hughes, Computational Inelasticity
    (1998), box 9.1.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> steel = kl.FiniteJ2Plasticity3D(E=200e9, nu=0.3, yield_stress=250e6)
    >>> block = kl.Model(kl.box(element="TotalLagrangianElement3D8N"), steel)
    >>> for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
    ...     block.fix(side, axis)
    >>> block.fix("z+", "z", lambda t: 0.5 * t)
    >>> analysis = block.quasi_static()
    >>> for _ in kl.integrate(analysis, dt=0.1, steps=10):
    ...     pass
    >>> print(f"{analysis.result().stress()[0, 0, 2] / 1e6:.0f} MPa")
    250 MPa
    """

    strain_measure: ClassVar[str] = "finite"
    symmetric_tangent: ClassVar[bool] = False
    internal_variables: ClassVar[Mapping[str, int]] = {
        "plastic_metric": 6,
        "accumulated_plastic_strain": 1,
    }

    def check(self) -> None:
        """Check that nothing hardens kinematically."""
        super().check()
        if self.kinematic:
            raise MaterialError("only J2Plasticity3D hardens kinematically; take isotropic hardening")

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return S and internal variables; see `Material.response`."""
        lam, mu = self.elastic.lame
        C = voigt.UNIT + 2 * strain * voigt.HALF_SHEAR
        inverse, square = voigt.inverse(C), voigt.determinant(C)[..., None]
        if not (square > 0).all():
            raise SolveError("the volume is not positive; take smaller steps")
        # Tensors a of the deformed body are F a F^T of those here.
        b = square ** (-1 / 3) * (voigt.UNIT + state["plastic_metric"])
        mean = (b * C) @ voigt.SHEAR_TWICE / 3
        s = mu * (b - mean[..., None] * inverse)
        mixed = voigt.tensor(s) @ voigt.tensor(C)
        q = np.sqrt(1.5 * np.einsum("...ij,...ji->...", mixed, mixed).clip(min=0))
        p = state["accumulated_plastic_strain"][..., 0]
        J = square[..., 0] ** 0.5
        dp = self._increment(q / J, p, mu * mean / J)[0]
        s *= (1 - 3 * mu * mean * dp / np.where(q > 0, q, 1.0))[..., None]
        flown = square ** (1 / 3) * (s / mu + mean[..., None] * inverse) - voigt.UNIT
        metric = np.where(dp[..., None] > 0, flown, state["plastic_metric"])
        new = {"plastic_metric": metric, "accumulated_plastic_strain": (p + dp)[..., None]}
        return s + (lam + 2 / 3 * mu) / 2 * (square - 1) * inverse, None, new

    def energy(self, strain: Array, stress: Array, state: GaussState) -> Array:
        """Return the elastic part; see `Material.energy`."""
        lam, mu = self.elastic.lame
        C = voigt.UNIT + 2 * strain * voigt.HALF_SHEAR
        square, metric = voigt.determinant(C), voigt.UNIT + state["plastic_metric"]
        # The return keeps the trace of b̄_e, not the volume of F_p: without it, energy would grow.
        trace = (metric * C) @ voigt.SHEAR_TWICE * voigt.determinant(metric) ** (-1 / 3)
        volume = (lam + 2 / 3 * mu) / 4 * (square - 1 - np.log(square))
        return np.asarray(volume + mu / 2 * (square ** (-1 / 3) * trace - 3))
