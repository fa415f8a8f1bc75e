"""TrescaDamage3D: isotropic damage by the largest shear stress."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kratos_lite.materials.von_mises_damage3d import VonMisesDamage3D


@dataclass(frozen=True)
class TrescaDamage3D(VonMisesDamage3D):
    """σ = (1 - d) C ε; damage d grows with the largest σ₁ - σ₃ of C ε, exponentially or linearly.

    Each element dissipates the fracture energy over its radius, from its center to its farthest node.

    Parameters
    ----------
    E, nu, strength, fracture_energy, linear, density, alpha : as of `VonMisesDamage3D`.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds, or a radius is larger than 2 E G_f / strength².

    Notes
    -----
    Where sin 3θ passes ±0.95, with Lode's angle θ, it is the stress of von Mises, as in Kratos.  Source:
    TrescaYieldSurface of KratosConstitutiveLawsApplication.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> law = kl.TrescaDamage3D(E=30e9, nu=0.2, strength=3e6, fracture_energy=100.0)
    >>> print(f"{kl.material_point(law, {'xy': [1e-3]}).stress[-1, 3] / 1e6:.1f} MPa")
    1.5 MPa
    """

    surface: ClassVar[str] = "Tresca"
    aliases: ClassVar[tuple[str, ...]] = ("SmallStrainIsotropicDamage3DTresca",)
