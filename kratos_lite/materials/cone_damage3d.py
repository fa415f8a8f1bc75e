"""ConeDamage3D: isotropic damage by the cone of Drucker and Prager."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kratos_lite.materials.isotropic_law import check_friction
from kratos_lite.materials.von_mises_damage3d import VonMisesDamage3D


@dataclass(frozen=True)
class ConeDamage3D(VonMisesDamage3D):
    """σ = (1 - d) C ε; damage d grows with 2 sin φ tr σ + √3 (3 - sin φ) √J₂ of C ε.

    Each element dissipates the fracture energy over its radius, from its center to its farthest node.

    Parameters
    ----------
    E, nu, strength, fracture_energy, linear, density, alpha : as of `VonMisesDamage3D`.
    friction : angle φ in degrees, 0 < φ < 90.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds, or a radius is larger than 2 E G_f / strength².

    Notes
    -----
    A bar begins to soften at the strength in tension, and at (3 + sin φ) / (3 - 3 sin φ) of it under a
    thrust.  Source: DruckerPragerYieldSurface of KratosConstitutiveLawsApplication.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> law = kl.ConeDamage3D(E=30e9, nu=0.2, strength=3e6, fracture_energy=100.0, friction=30.0)
    >>> print(f"{kl.material_point(law, {'xx': [-1e-3]}).stress[-1, 0] / 1e6:.1f} MPa")
    -7.0 MPa
    """

    friction: float = 0.0

    surface: ClassVar[str] = "DruckerPrager"
    aliases: ClassVar[tuple[str, ...]] = ("SmallStrainIsotropicDamage3DDruckerPrager",)
    variables: ClassVar[dict[str, str]] = VonMisesDamage3D.variables | {"friction": "FRICTION_ANGLE"}

    def check(self) -> None:
        """Check the angle, too."""
        super().check()
        check_friction(self)
