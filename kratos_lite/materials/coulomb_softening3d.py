"""CoulombSoftening3D: plasticity of Mohr and Coulomb with two strengths, which softens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kratos_lite.materials.softening import Softening, names_in_kratos


@dataclass(frozen=True)
class CoulombSoftening3D(Softening):
    """J2Softening3D within a pyramid of Mohr and Coulomb, fitted to the strengths of tension and compression.

    It is theirs if compression / tension is tan²(45° + φ/2), and the hexagon of Tresca if they are equal.
    Where sin 3θ passes ±0.95, with Lode's angle θ, surface and flow are cones through the corners, as in
    Kratos.
    The yield stress is that of compression; there the dissipated energy may be (compression / tension)²
    larger.

    Parameters
    ----------
    E, nu, yield_stress, fracture_energy, curve, compression, density, alpha : as of `J2Softening3D`.
    friction, dilatancy, peak, peak_at, linear_until, strains, stresses, potential : as of `J2Softening3D`.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds, or an element has too little fracture energy for a curve.

    Notes
    -----
    Return to the pyramid, and to its apex.  What a strain comes to depends on its steps.  Kratos exchanges
    the shears yz and zx in ∂J₃/∂σ: where both are 0 it does the same.  The potential is round through the
    corners of compression alone, as there: near those of tension, under high pressure, its flow gives energy
    (0.3 % of the work over random paths).  Source: Oller, Nonlinear Dynamics of Structures (2014), and
    ModifiedMohrCoulombYieldSurface of KratosConstitutiveLawsApplication.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> concrete = kl.CoulombSoftening3D(
    ...     30e9, 0.2, 3e6, 1e3, curve=3, compression=30e6, friction=30.0, dilatancy=30.0
    ... )
    >>> for strain in (1e-2, -1e-2):
    ...     print(f"{kl.material_point(concrete, {'xx': [strain]}).stress[-1, 0] / 1e6:.1f} MPa")
    3.0 MPa
    -30.0 MPa
    """

    surface: ClassVar[str] = "ModifiedMohrCoulomb"
    aliases: ClassVar[tuple[str, ...]] = names_in_kratos(surface)
