"""What laws share that begin as Isotropic3D, and the radial return of those that flow as von Mises' do."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import MaterialError
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.materials.material import GaussState, Material
from kratos_lite.typing import Array

ELASTIC = Isotropic3D.variables
"""Variables of the constants of Isotropic3D, which other laws have, too."""


def check_friction(law: Any) -> None:
    """Check the angle of friction of a law."""
    if not 0 < law.friction < 90:
        raise MaterialError(f"{law._name('friction')} {law.friction:g} must lie in 0° … 90°")


def check_angles(law: Any) -> None:
    """Check the angles of friction and dilatancy of a law."""
    check_friction(law)
    if not 0 <= law.dilatancy <= law.friction:
        text = f"must lie in 0° … {law.friction:g}°, the friction"
        raise MaterialError(f"{law._name('dilatancy')} {law.dilatancy:g} {text}")


class IsotropicLaw(Material, family=True):
    """A law that is Isotropic3D for small steps from rest."""

    E: float
    nu: float

    isotropic: ClassVar[bool] = True

    @cached_property
    def elastic(self) -> Isotropic3D:
        """The law of small steps from rest."""
        return Isotropic3D(self.E, self.nu)

    def check(self) -> None:
        """Check E and nu."""
        self.elastic.check()


class VonMises(IsotropicLaw, family=True):
    """Plastic flow along the deviator s of the elastic trial stress, seen from a center."""

    # Source: Simo & Hughes, Computational Inelasticity (1998), section 3.3.

    keeps_volume: ClassVar[bool] = True

    def trial(
        self, strain: Array, state: GaussState, center: Array | float = 0.0
    ) -> tuple[Array, Array, Array]:
        """Return the elastic trial stress (..., 6), s/|s| and the equivalent stress √(3/2) |s| (...)."""
        stress = voigt.times(strain - state["plastic_strain"], self.elastic.C)
        s = voigt.deviator(stress) - center
        norm = np.sqrt(s**2 @ voigt.SHEAR_TWICE)
        return stress, s / np.where(norm > 0, norm, 1.0)[..., None], 1.5**0.5 * norm

    def tangent(self, n: Array, q: Array, dp: Array, slope: Array) -> Array:
        """Return ∂σ/∂ε of a return by Δp from the trial q along n, where Δp grows with q by a slope (...)."""
        G = self.elastic.lame[1]
        beta = 6 * G**2 * dp / np.where(q > 0, q, 1.0)
        D = np.einsum("...i,...j->...ij", (beta - 6 * G**2 * slope)[..., None] * n, n)
        D += self.elastic.C
        D -= beta[..., None, None] * voigt.DEVIATOR
        return D
