"""RankineDamage3D: isotropic damage by the largest tension, as of concrete."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.materials.von_mises_damage3d import VonMisesDamage3D
from kratos_lite.typing import Array


@dataclass(frozen=True)
class RankineDamage3D(VonMisesDamage3D):
    """σ = (1 - d) C ε; damage d grows with the largest principal stress of C ε: compression does no harm.

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
    Source: Oller, Nonlinear Dynamics of Structures (2014), and RankineYieldSurface of
    KratosConstitutiveLawsApplication.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> concrete = kl.RankineDamage3D(E=30e9, nu=0.2, strength=3e6, fracture_energy=100.0)
    >>> for strain in (1e-3, -1e-3):  # tension ends at the strength, compression is elastic
    ...     print(f"{kl.material_point(concrete, {'xx': [strain]}).stress[-1, 0] / 1e6:.1f} MPa")
    3.0 MPa
    -30.0 MPa
    """

    aliases: ClassVar[tuple[str, ...]] = ("SmallStrainIsotropicDamage3DRankine",)

    def _equivalent(self, strain: Array, effective: Array) -> tuple[Array, Array, float]:
        values, directions = np.linalg.eigh(voigt.tensor(effective))
        n = directions[..., 2]
        along = voigt.vector(n[..., :, None] * n[..., None, :]) * voigt.SHEAR_TWICE
        return values[..., 2], voigt.times(along, self.elastic.C), self.strength
