"""DruckerPrager3D: plasticity of soils, whose strength grows with the pressure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, radians, sin
from typing import ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.materials.isotropic_law import ELASTIC, IsotropicLaw, check_angles
from kratos_lite.materials.material import GaussState, Response
from kratos_lite.typing import Array


@dataclass(frozen=True)
class DruckerPrager3D(IsotropicLaw):
    """Elastic within the cone √J₂ + η p ≤ ξ c that meets Mohr and Coulomb's in triaxial compression.

    Parameters
    ----------
    E, nu : Young's modulus in Pa and Poisson's ratio.
    cohesion : c in Pa, > 0.
    friction : angle φ of internal friction in degrees, 0 < φ < 90.
    dilatancy : angle in degrees, 0 ≤ ψ ≤ φ; the flow is associated if it is φ.
    hardening : growth of the cohesion in Pa with the accumulated plastic strain, ≥ 0.
    density : kg/m³.
    alpha : thermal expansion in 1/K; see `Temperature`.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds.

    Notes
    -----
    η = 6 sin φ / √3 (3 - sin φ), ξ = 6 cos φ / √3 (3 - sin φ), and η̄ of ψ like η.  Return to the cone, and to
    its apex.  Source: de Souza Neto, Perić & Owen, Computational Methods for Plasticity (2008), section 8.3.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> soil = DruckerPrager3D(E=20e6, nu=0.3, cohesion=10e3, friction=30.0)
    >>> stress, _, _ = soil.evaluate(np.array([0.1, 0.1, 0.1, 0, 0, 0]), soil.initial_state(), 1.0)
    >>> print(f"{stress[0]:.1f} Pa")  # the apex, c cot φ
    17320.5 Pa
    """

    E: float
    nu: float
    cohesion: float
    friction: float
    dilatancy: float = 0.0
    hardening: float = 0.0
    density: float = 0.0
    alpha: float = 0.0

    positive: ClassVar[Mapping[str, str]] = {"cohesion": "Pa"}
    not_negative: ClassVar[Mapping[str, str]] = {"hardening": "Pa"}
    variables: ClassVar[dict[str, str]] = ELASTIC | {
        "cohesion": "COHESION",
        "friction": "FRICTION_ANGLE",
        "dilatancy": "DILATANCY_ANGLE",
        "hardening": "ISOTROPIC_HARDENING_MODULUS",
    }
    internal_variables: ClassVar[Mapping[str, int]] = {"plastic_strain": 6, "accumulated_plastic_strain": 1}

    @property
    def symmetric_tangent(self) -> bool:  # type: ignore[override]
        """Whether the flow is associated."""
        return self.friction == self.dilatancy

    def check(self) -> None:
        """Check the angles."""
        super().check()
        check_angles(self)

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return stress, consistent tangent and internal variables; see `Material.response`."""
        lam, G = self.elastic.lame
        K, H = lam + 2 * G / 3, self.hardening
        (eta, xi), eta_flow = _slopes(self.friction), _slopes(self.dilatancy)[0]
        trial = (strain - state["plastic_strain"]) @ self.elastic.C.T
        s, p = voigt.deviator(trial), trial[..., :3].sum(axis=-1) / 3
        norm = np.sqrt(s**2 @ voigt.SHEAR_TWICE)
        q, n = norm / 2**0.5, s / np.where(norm > 0, norm, 1.0)[..., None]  # q = √J₂
        accumulated = state["accumulated_plastic_strain"][..., 0]
        c = self.cohesion + H * accumulated
        f = q + eta * p - xi * c
        A = 1 / (G + K * eta * eta_flow + xi**2 * H)
        gamma = A * np.maximum(f, 0.0)
        apex = (f > 0) & (G * gamma > q)
        alpha = xi / eta_flow if eta_flow else 0.0
        volume = np.where(apex, (p - xi / eta * c) / (K + alpha * xi / eta * H), 0.0)
        shear = np.where(apex, q, G * gamma)  # what √J₂ loses
        pressure = np.where(apex, K * volume, K * eta_flow * gamma)  # what p loses
        stress = trial - 2**0.5 * shear[..., None] * n - pressure[..., None] * voigt.UNIT
        flow = (shear / G / 2**0.5)[..., None] * n * voigt.SHEAR_TWICE
        new = {
            "plastic_strain": state["plastic_strain"] + flow + (pressure / (3 * K))[..., None] * voigt.UNIT,
            "accumulated_plastic_strain": (accumulated + np.where(apex, alpha * volume, xi * gamma))[
                ..., None
            ],
        }
        cone = (f > 0) & ~apex
        fraction = np.where(apex, 1.0, shear / np.where(q > 0, q, 1.0))
        one, outer = voigt.UNIT, n[..., :, None] * n[..., None, :]
        soft = np.where(cone, A, 0.0)[..., None, None]
        kept = np.where(apex, 1 - K / (K + alpha * xi / eta * H), 1.0)[..., None, None]
        D = 2 * G * (1 - fraction)[..., None, None] * voigt.DEVIATOR
        D = D + np.where(cone, 2 * G * fraction, 0.0)[..., None, None] * outer - 2 * G**2 * soft * outer
        D = D - 2**0.5 * G * K * soft * (
            eta * n[..., :, None] * one + eta_flow * one[:, None] * n[..., None, :]
        )
        D = D + K * (kept - K * eta * eta_flow * soft) * np.outer(one, one)
        return stress, D, new


def _slopes(angle: float) -> tuple[float, float]:
    """Return η and ξ of an angle in degrees."""
    phi = radians(angle)
    return tuple(6 * part / (3**0.5 * (3 - sin(phi))) for part in (sin(phi), cos(phi)))  # type: ignore[return-value]
