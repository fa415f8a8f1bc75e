"""MooneyRivlin3D: nearly incompressible rubber by two invariants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import MaterialError
from kratos_lite.materials.material import GaussState, Material, Response
from kratos_lite.materials.neo_hookean3d import inverse_and_log, tangent
from kratos_lite.typing import Array


@dataclass(frozen=True)
class MooneyRivlin3D(Material):
    """Rubber: W = c10 (Ī₁ - 3) + c01 (Ī₂ - 3) + κ/2 (J - 1)² of the isochoric invariants.

    Parameters
    ----------
    c10, c01 : Pa; the shear modulus of small strains is 2 (c10 + c01) > 0.
    bulk : bulk modulus κ in Pa, > 0.
    density : kg/m³ of the undeformed body.

    Raises
    ------
    MaterialError
        If shear or bulk modulus is not positive.

    Notes
    -----
    Source: Holzapfel, Nonlinear Solid Mechanics (2000), sections 6.4 and 6.5.

    Examples
    --------
    >>> rubber = MooneyRivlin3D(c10=0.3e6, c01=0.1e6, bulk=1e9)
    >>> round(float(rubber.C[3, 3]))
    800000
    """

    c10: float
    c01: float
    bulk: float
    density: float = 0.0

    isotropic: ClassVar[bool] = True
    positive: ClassVar[Mapping[str, str]] = {"bulk": "Pa"}
    strain_measure: ClassVar[str] = "finite"

    def check(self) -> None:
        """Check the shear modulus."""
        if not self.c10 + self.c01 > 0:
            raise MaterialError(
                f"2 (c10 + c01), the shear modulus, must be > 0 Pa; got {self.c10:g}, {self.c01:g}"
            )

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return S, ∂S/∂E and no internal variables; see `Material.response`."""
        inverse, log_J = inverse_and_log(strain)
        C = voigt.UNIT + 2 * strain * voigt.HALF_SHEAR
        I1, I2, J = *invariants(C), np.exp(log_J)[..., None]
        a = I1 * voigt.UNIT - C  # ∂I₂/∂C
        first, second = 2 * self.c10 * J ** (-2 / 3), 2 * self.c01 * J ** (-4 / 3)
        stress = first * (voigt.UNIT - I1 / 3 * inverse) + second * (a - 2 / 3 * I2 * inverse)
        stress += self.bulk * (J**2 - J) * inverse

        w = first * (I1 / 9 * inverse - 2 / 3 * voigt.UNIT) + second * (4 / 9 * I2 * inverse - 4 / 3 * a)
        w += self.bulk * (J**2 - J / 2) * inverse
        b = first * I1 / 3 + second * 2 / 3 * I2 - self.bulk * (J**2 - J)
        D = tangent(inverse, w, b[..., 0])
        D += 2 * second[..., None] * (np.outer(voigt.UNIT, voigt.UNIT) - np.diag(voigt.HALF_SHEAR))
        return stress, D, {}

    def energy(self, strain: Array, stress: Array, state: GaussState) -> Array:
        """Return W; see `Material.energy`."""
        J = np.exp(inverse_and_log(strain)[1])
        I1, I2 = (v[..., 0] for v in invariants(voigt.UNIT + 2 * strain * voigt.HALF_SHEAR))
        isochoric = self.c10 * (J ** (-2 / 3) * I1 - 3) + self.c01 * (J ** (-4 / 3) * I2 - 3)
        return np.asarray(isochoric + self.bulk / 2 * (J - 1) ** 2)


def invariants(C: Array) -> tuple[Array, Array]:
    """Return I₁ and I₂ (..., 1) of a tensor (..., 6)."""
    I1 = C[..., :3].sum(axis=-1, keepdims=True)
    return I1, (I1**2 - (C**2 @ voigt.SHEAR_TWICE)[..., None]) / 2
