"""Ogden3D: nearly incompressible rubber by powers of the principal stretches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import MaterialError
from kratos_lite.materials.material import GaussState, Material, Response
from kratos_lite.typing import Array

ALIKE = 1e-6
"""Relative difference of squared stretches below which they count as equal."""


@dataclass(frozen=True)
class Ogden3D(Material):
    """Rubber: W = Σ μ_p/α_p (λ̄₁^α_p + λ̄₂^α_p + λ̄₃^α_p - 3) + U(J) of isochoric stretches.

    Parameters
    ----------
    mu1, alpha1, mu2, alpha2, mu3, alpha3 : Pa and exponents of up to three terms; the shear modulus of small
        strains is ½ Σ μ_p α_p > 0.
    bulk : bulk modulus κ in Pa, > 0.
    density : kg/m³ of the undeformed body.
    bulk4, bulk6 : Pa, ≥ 0: U = κ/2 (J - 1)² + bulk4 (J - 1)⁴ + bulk6 (J - 1)⁶.

    Raises
    ------
    MaterialError
        If shear or bulk modulus is not positive.

    Notes
    -----
    S = Σ β_a / λ_a² N_a N_a with β_a = ∂W/∂ln λ_a.  Source: Holzapfel, Nonlinear Solid Mechanics (2000),
    sections 6.5 and 6.6.

    Examples
    --------
    >>> rubber = Ogden3D(mu1=0.63e6, alpha1=1.3, mu2=1.2e3, alpha2=5.0, mu3=-1e4, alpha3=-2.0, bulk=1e9)
    >>> round(float(rubber.C[3, 3]))
    422500
    """

    mu1: float
    alpha1: float
    bulk: float
    mu2: float = 0.0
    alpha2: float = 1.0
    mu3: float = 0.0
    alpha3: float = 1.0
    density: float = 0.0
    bulk4: float = 0.0
    bulk6: float = 0.0

    isotropic: ClassVar[bool] = True
    positive: ClassVar[Mapping[str, str]] = {"bulk": "Pa"}
    not_negative: ClassVar[Mapping[str, str]] = {"bulk4": "Pa", "bulk6": "Pa"}
    strain_measure: ClassVar[str] = "finite"

    def check(self) -> None:
        """Check the shear modulus."""
        shear = sum(mu * alpha for mu, alpha in self.terms) / 2
        if not shear > 0:
            raise MaterialError(f"½ Σ μ α, the shear modulus, must be > 0 Pa; got {shear:g}")

    @property
    def terms(self) -> tuple[tuple[float, float], ...]:
        """μ in Pa and α of each term."""
        return (self.mu1, self.alpha1), (self.mu2, self.alpha2), (self.mu3, self.alpha3)

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return S, ∂S/∂E and no internal variables; see `Material.response`."""
        squares, axes = np.linalg.eigh(np.eye(3) + 2 * voigt.tensor(strain * voigt.HALF_SHEAR))
        J = np.sqrt(squares.prod(axis=-1))[..., None]
        pressure = self.bulk * (J - 1) + 4 * self.bulk4 * (J - 1) ** 3 + 6 * self.bulk6 * (J - 1) ** 5
        second = self.bulk + 12 * self.bulk4 * (J - 1) ** 2 + 30 * self.bulk6 * (J - 1) ** 4
        beta = np.broadcast_to(J * pressure, squares.shape).copy()
        slope = np.broadcast_to((J * pressure + J**2 * second)[..., None], (*squares.shape, 3)).copy()
        for mu, alpha in self.terms:
            power = (squares / J ** (2 / 3)) ** (alpha / 2)
            mean = power.mean(axis=-1, keepdims=True)
            beta += mu * (power - mean)
            slope += mu * alpha * power[..., None] * np.eye(3)
            slope += mu * alpha / 3 * (mean[..., None] - power[..., :, None] - power[..., None, :])
        return *of_stretches(squares, axes, beta, slope), {}

    def energy(self, strain: Array, stress: Array, state: GaussState) -> Array:
        """Return W; see `Material.energy`."""
        squares = np.linalg.eigvalsh(np.eye(3) + 2 * voigt.tensor(strain * voigt.HALF_SHEAR))
        J = np.sqrt(squares.prod(axis=-1))
        isochoric = squares / J[..., None] ** (2 / 3)
        terms = [mu / alpha * ((isochoric ** (alpha / 2)).sum(axis=-1) - 3) for mu, alpha in self.terms]
        volume = self.bulk / 2 * (J - 1) ** 2 + self.bulk4 * (J - 1) ** 4 + self.bulk6 * (J - 1) ** 6
        return np.asarray(sum(terms) + volume)


def of_stretches(squares: Array, axes: Array, beta: Array, slope: Array) -> tuple[Array, Array]:
    """Return S (..., 6) and ∂S/∂E (..., 6, 6) from the derivatives of W by the logarithms of stretches.

    `squares` (..., 3) are λ², `axes` (..., 3, 3) their directions in columns, `beta` (..., 3) the first
    derivatives and `slope` (..., 3, 3) the second ones.
    """
    S = beta / squares
    normal = (slope - 2 * beta[..., None] * np.eye(3)) / (squares[..., :, None] * squares[..., None, :])
    normals = voigt.vector(np.einsum("...ia,...ja->...aij", axes, axes))
    stress = np.einsum("...a,...ac->...c", S, normals)
    D = np.einsum("...ab,...ac,...bd->...cd", normal, normals, normals)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        difference = squares[..., b] - squares[..., a]
        alike = np.abs(difference) <= ALIKE * squares[..., a]
        limit = (normal[..., b, b] + normal[..., a, a] - 2 * normal[..., a, b]) / 4
        shear = np.where(alike, limit, (S[..., b] - S[..., a]) / np.where(alike, 1.0, difference))
        mixed = axes[..., :, None, a] * axes[..., None, :, b]
        G = voigt.vector(mixed + np.swapaxes(mixed, -1, -2))
        D = D + shear[..., None, None] * G[..., :, None] * G[..., None, :]
    return stress, D
