"""CoulombDamage3D: isotropic damage by a pyramid of Mohr and Coulomb with two strengths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from kratos_lite.materials.isotropic_law import check_friction
from kratos_lite.materials.von_mises_damage3d import VonMisesDamage3D


@dataclass(frozen=True)
class CoulombDamage3D(VonMisesDamage3D):
    """σ = (1 - d) C ε; damage d grows with the stress of Mohr and Coulomb, fitted to two strengths, of C ε.

    Each element dissipates the fracture energy over its radius, from its center to its farthest node.

    Parameters
    ----------
    E, nu, strength, fracture_energy, linear, density, alpha : as of `VonMisesDamage3D`.
    friction : angle φ in degrees, 0 < φ < 90.
    compression : strength of compression in Pa; 0 for that of tension.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds, or a radius is larger than 2 E G_f / strength².

    Notes
    -----
    Where sin 3θ passes ±0.95, with Lode's angle θ, the pyramid is a cone through its corners, as in Kratos.
    Source: ModifiedMohrCoulombYieldSurface of KratosConstitutiveLawsApplication.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> law = kl.CoulombDamage3D(30e9, 0.2, 3e6, 100.0, friction=30.0, compression=30e6)
    >>> print(f"{kl.material_point(law, {'xx': [-2e-3]}).stress[-1, 0] / 1e6:.1f} MPa")
    -30.0 MPa
    """

    friction: float = 0.0
    compression: float = 0.0

    surface: ClassVar[str] = "ModifiedMohrCoulomb"
    aliases: ClassVar[tuple[str, ...]] = ("SmallStrainIsotropicDamage3DModifiedMohrCoulomb",)
    not_negative: ClassVar[Mapping[str, str]] = {"compression": "Pa"}
    variables: ClassVar[dict[str, str]] = VonMisesDamage3D.variables | {
        "friction": "FRICTION_ANGLE",
        "compression": "YIELD_STRESS_COMPRESSION",
    }

    def check(self) -> None:
        """Check the angle, too."""
        super().check()
        check_friction(self)
