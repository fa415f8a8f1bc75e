"""Orthotropic3D: linear elasticity with three planes of symmetry along x, y and z."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kratos_lite.materials.linear_material import LinearMaterial
from kratos_lite.typing import Array


@dataclass(frozen=True)
class Orthotropic3D(LinearMaterial):
    """Orthotropic linear elasticity; nu_xy is the contraction along y under stress along x.

    Parameters
    ----------
    E_x, E_y, E_z : Young's moduli in Pa.
    nu_xy, nu_yz, nu_xz : Poisson's ratios; nu_yx = nu_xy E_y / E_x and so on.
    G_xy, G_yz, G_xz : shear moduli in Pa.
    density : kg/m³, ≥ 0.
    alpha_x, alpha_y, alpha_z : thermal expansion in 1/K; see `Temperature`.

    Raises
    ------
    MaterialError
        If a modulus is not positive or the strain energy is not.

    Notes
    -----
    Source: Lekhnitskii, Theory of Elasticity of an Anisotropic Body (1963), section 4.

    Examples
    --------
    >>> wood = Orthotropic3D(11e9, 0.9e9, 0.5e9, 0.4, 0.3, 0.4, 0.7e9, 0.05e9, 0.7e9, 450.0)
    >>> strain = np.linalg.solve(wood.C, [11e9, 0, 0, 0, 0, 0])
    >>> strain.round(3).tolist()
    [1.0, -0.4, -0.4, 0.0, 0.0, 0.0]
    """

    E_x: float
    E_y: float
    E_z: float
    nu_xy: float
    nu_yz: float
    nu_xz: float
    G_xy: float
    G_yz: float
    G_xz: float
    density: float = 0.0
    alpha_x: float = 0.0
    alpha_y: float = 0.0
    alpha_z: float = 0.0

    aliases: ClassVar[tuple[str, ...]] = ("LinearElasticOrthotropic3DLaw",)
    positive: ClassVar[dict[str, str]] = dict.fromkeys(("E_x", "E_y", "E_z", "G_xy", "G_yz", "G_xz"), "Pa")
    variables: ClassVar[dict[str, str]] = {
        "E_x": "YOUNG_MODULUS_X",
        "E_y": "YOUNG_MODULUS_Y",
        "E_z": "YOUNG_MODULUS_Z",
        "nu_xy": "POISSON_RATIO_XY",
        "nu_yz": "POISSON_RATIO_YZ",
        "nu_xz": "POISSON_RATIO_XZ",
        "G_xy": "SHEAR_MODULUS_XY",
        "G_yz": "SHEAR_MODULUS_YZ",
        "G_xz": "SHEAR_MODULUS_XZ",
        "density": "DENSITY",
        "alpha_x": "THERMAL_EXPANSION_COEFFICIENT_X",
        "alpha_y": "THERMAL_EXPANSION_COEFFICIENT_Y",
        "alpha_z": "THERMAL_EXPANSION_COEFFICIENT_Z",
    }

    @property
    def expansion(self) -> Array:
        """Thermal strain (6,) in 1/K."""
        return np.array([self.alpha_x, self.alpha_y, self.alpha_z, 0.0, 0.0, 0.0])

    def why_unstable(self) -> str:
        """Name the pair of constants, if one, with nu_ij² ≥ E_i / E_j."""
        for a, b in ("xy", "yz", "xz"):
            nu, ratio = getattr(self, f"nu_{a}{b}"), getattr(self, f"E_{a}") / getattr(self, f"E_{b}")
            if nu * nu >= ratio:
                return f"nu_{a}{b}² = {nu * nu:g} must be < E_{a} / E_{b} = {ratio:g}"
        return "the three Poisson ratios together are too large"

    def compliance(self) -> Array:
        """Return S (6, 6) in 1/Pa."""
        S = np.diag([1 / m for m in (self.E_x, self.E_y, self.E_z, self.G_xy, self.G_yz, self.G_xz)])
        S[0, 1] = S[1, 0] = -self.nu_xy / self.E_x
        S[1, 2] = S[2, 1] = -self.nu_yz / self.E_y
        S[0, 2] = S[2, 0] = -self.nu_xz / self.E_x
        return S

    def elasticity(self) -> Array:
        """Return the inverse (6, 6) in Pa of the compliance, made exactly symmetric."""
        C = super().elasticity()
        return (C + C.T) / 2
