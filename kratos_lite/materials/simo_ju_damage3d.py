"""SimoJuDamage3D: isotropic damage by the energy, with the size of Kratos."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from kratos_lite.materials.isotropic_damage3d import IsotropicDamage3D
from kratos_lite.materials.material import Material
from kratos_lite.materials.von_mises_damage3d import VonMisesDamage3D
from kratos_lite.typing import Array


@dataclass(frozen=True)
class SimoJuDamage3D(VonMisesDamage3D):
    """σ = (1 - d) C ε; damage d grows with the largest √(ε:C:ε) so far, as in IsotropicDamage3D.

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
    FRACTURE_ENERGY of files is E times that, as in Kratos, whose softening lacks the factor.  Source: Simo &
    Ju, Int. J. Solids Struct. 23 (1987) 821, and SimoJuYieldSurface of KratosConstitutiveLawsApplication.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> law = kl.SimoJuDamage3D(E=30e9, nu=0.2, strength=3e6, fracture_energy=100.0)
    >>> print(f"{kl.material_point(law, {'xx': [1e-3]}).stress[-1, 0] / 1e6:.1f} MPa")
    3.0 MPa
    """

    aliases: ClassVar[tuple[str, ...]] = ("SmallStrainIsotropicDamage3DSimoJu",)

    @classmethod
    def from_variables(cls, values: dict[str, Any]) -> Material:
        """Make the material from the variables of a file."""
        energy = {}
        if {"FRACTURE_ENERGY", "YOUNG_MODULUS"} <= values.keys():
            energy = {"FRACTURE_ENERGY": values["FRACTURE_ENERGY"] / values["YOUNG_MODULUS"]}
        return super().from_variables(values | energy)

    def _equivalent(self, strain: Array, effective: Array) -> tuple[Array, Array, float]:
        return IsotropicDamage3D._equivalent(self, strain, effective)
