"""SaintVenantKirchhoff3D: linear elasticity of Green's strain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kratos_lite.materials.isotropic3d import Isotropic3D


@dataclass(frozen=True)
class SaintVenantKirchhoff3D(Isotropic3D):
    """S = C:E, for large rotations with small strains.

    Under strong compression it loses its stiffness (a confined bar at a stretch of 1/√3): take
    `NeoHookean3D` there.

    Parameters
    ----------
    E, nu, density, alpha : as of `Isotropic3D`; temperatures strain small strains alone.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds.

    Notes
    -----
    Source: Bonet & Wood, Nonlinear Continuum Mechanics (2008), section 6.3.

    Examples
    --------
    >>> SaintVenantKirchhoff3D(E=1e6, nu=0.0).strain_measure
    'finite'
    """

    isotropic: ClassVar[bool] = True
    aliases: ClassVar[tuple[str, ...]] = ("KirchhoffSaintVenant3DLaw", "KirchhoffSaintVenant3D")
    strain_measure: ClassVar[str] = "finite"
