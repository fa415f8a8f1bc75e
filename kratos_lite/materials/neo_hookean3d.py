"""NeoHookean3D: compressible rubber at any strain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.materials.isotropic_law import IsotropicLaw
from kratos_lite.materials.material import GaussState, Response
from kratos_lite.typing import Array


@dataclass(frozen=True)
class NeoHookean3D(IsotropicLaw):
    """Compressible neo-Hookean elasticity: W = μ/2 (I₁ - 3) - μ ln J + λ/2 (ln J)².

    Parameters
    ----------
    E, nu : Young's modulus in Pa and Poisson's ratio of small strains, which give λ and μ.
    density : kg/m³ of the undeformed body.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds.

    Notes
    -----
    S = μ (1 - C⁻¹) + λ ln J C⁻¹ with the right Cauchy–Green tensor C = 1 + 2 E and J² = det C.
    Source: Bonet & Wood, Nonlinear Continuum Mechanics (2008), section 6.4.3.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> rubber = kl.NeoHookean3D(E=1e6, nu=0.3)
    >>> stretch = 2.0  # along x, the sides held
    >>> stress, _, _ = rubber.evaluate(np.array([(stretch**2 - 1) / 2, 0, 0, 0, 0, 0]), {}, 1.0)
    >>> mu, lam = 1e6 / 2.6, 0.3e6 / 1.3 / 0.4
    >>> bool(abs(stress[0] - (mu * (1 - 1 / 4) + lam * np.log(2) / 4)) < 1e-6)
    True
    """

    E: float
    nu: float
    density: float = 0.0

    aliases: ClassVar[tuple[str, ...]] = ("HyperElastic3DLaw", "HyperElasticNeoHookean3DLaw")
    variables: ClassVar[dict[str, str]] = {"E": "YOUNG_MODULUS", "nu": "POISSON_RATIO", "density": "DENSITY"}
    strain_measure: ClassVar[str] = "finite"

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return S, ∂S/∂E and no internal variables; see `Material.response`."""
        lam, mu = self.elastic.lame
        inverse, log_J = inverse_and_log(strain)
        stress = mu * voigt.UNIT + (lam * log_J - mu)[..., None] * inverse
        return stress, tangent(inverse, lam / 2 * inverse, mu - lam * log_J), {}

    def energy(self, strain: Array, stress: Array, state: GaussState) -> Array:
        """Return W; see `Material.energy`."""
        lam, mu = self.elastic.lame
        log_J = inverse_and_log(strain)[1]
        return np.asarray(mu * (strain[..., :3].sum(axis=-1) - log_J) + lam / 2 * log_J**2)


def inverse_and_log(strain: Array) -> tuple[Array, Array]:
    """Return C⁻¹ (..., 6) and ln J = ½ ln det C (...) of Green's strain (..., 6)."""
    C = voigt.UNIT + 2 * strain * voigt.HALF_SHEAR
    with np.errstate(invalid="ignore"):
        return voigt.inverse(C), np.log(voigt.determinant(C)) / 2


def tangent(inverse: Array, w: Array, b: Array) -> Array:
    """Return w_ij c_kl + c_ij w_kl + b (c_ik c_jl + c_il c_jk) (..., 6, 6) of c = C⁻¹, w and b (...)."""
    c, w = voigt.components(inverse), voigt.components(w)
    tensor, out = [[c[k] for k in row] for row in voigt.PLACES], np.empty((6, 6, *b.shape))
    for row, (i, j) in enumerate(voigt.PAIRS):
        for column, (k, m) in enumerate(voigt.PAIRS[: row + 1]):
            value = b * (tensor[i][k] * tensor[j][m] + tensor[i][m] * tensor[j][k])
            out[row, column] = out[column, row] = value + w[row] * c[column] + c[row] * w[column]
    return np.moveaxis(out, (0, 1), (-2, -1))
