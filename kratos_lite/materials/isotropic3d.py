"""Isotropic3D: linear elasticity with Young's modulus and Poisson's ratio."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kratos_lite.errors import MaterialError
from kratos_lite.materials.linear_material import LinearMaterial
from kratos_lite.typing import Array


@dataclass(frozen=True)
class Isotropic3D(LinearMaterial):
    """Isotropic linear elasticity in three dimensions.

    Parameters
    ----------
    E : Young's modulus in Pa, > 0.
    nu : Poisson's ratio, -1 < nu < 0.5.
    density : kg/m³, ≥ 0.
    alpha : thermal expansion in 1/K; see `Temperature`.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds.

    Examples
    --------
    >>> soil = Isotropic3D(E=210e6, nu=0.3, density=7620.0)
    >>> round(float(soil.C[0, 0]))          # confined modulus in Pa
    282692308
    """

    E: float
    nu: float
    density: float = 0.0
    alpha: float = 0.0

    aliases: ClassVar[tuple[str, ...]] = (
        "LinearElastic3DLaw",
        "LinearElasticIsotropic3D",
        "LinearElasticIsotropic3DLaw",
        "KratosMultiphysics.StructuralMechanicsApplication.LinearElastic3DLaw",
        "ElasticIsotropic3D",
        "ThermalElasticIsotropic3D",
    )
    variables: ClassVar[dict[str, str]] = {
        "E": "YOUNG_MODULUS",
        "nu": "POISSON_RATIO",
        "density": "DENSITY",
        "alpha": "THERMAL_EXPANSION_COEFFICIENT",
    }

    def check(self) -> None:
        """Check that E > 0 and -1 < nu < 0.5.

        Raises
        ------
        MaterialError
            If they are not.
        """
        if not self.E > 0:
            raise MaterialError(
                f"{self._name('E')} {self.E:g} must be > 0 Pa: a body without stiffness cannot carry load"
            )
        if not self.nu < 0.5:
            cure = "for nearly incompressible bodies use 0.499 and quadratic elements"
            if self.nu > 1:
                cure = "is it in percent?" if self.nu < 50 else "are two of E, nu and density swapped?"
            raise MaterialError(
                f"{self._name('nu')} {self.nu:g} must be < 0.5: the bulk modulus is infinite at 0.5; {cure}"
            )
        if not self.nu > -1:
            raise MaterialError(
                f"{self._name('nu')} {self.nu:g} must be > -1: the shear modulus is infinite at -1"
            )

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's constants (λ, μ) in Pa."""
        mu = self.E / (2 * (1 + self.nu))
        return 2 * mu * self.nu / (1 - 2 * self.nu), mu

    def elasticity(self) -> Array:
        """Return C (6, 6) in Pa: λ 1 1^T + 2 μ I (normal), μ I (shear)."""
        lam, mu = self.lame
        C = np.diag([2 * mu] * 3 + [mu] * 3)
        C[:3, :3] += lam
        return C
