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
    E, nu : Young's modulus in Pa and Poisson's ratio.
    yield_stress : σ_Y of tension in Pa, > 0.
    fracture_energy : J/m², > 0.
    curve : of the yield stress, 0 to 6: linear softening; exponential; to a peak, then exponential; perfect
        plasticity; a polynomial of the plastic strain; linear, then exponential; through points.
    compression : yield stress of compression in Pa; 0 for that of tension.
    density : kg/m³.
    alpha : thermal expansion in 1/K; see `Temperature`.
    friction, dilatancy : angles in degrees, 0 ≤ ψ ≤ φ < 90, of a cone or pyramid as surface or potential.
    peak, peak_at : of curve 2, stress in Pa and κ, 0 … 1.
    linear_until : of curves 0 and 5, κ from which on softening is exponential; 0 for 0.99 and 0.9.
    strains, stresses : of curve 6, plastic strains from 0 and stresses in Pa; of curve 4, the two strains
        where the polynomial and the constant after it end, and its coefficients in Pa.
    potential : of the flow, ``VonMises``, ``DruckerPrager``, ``Tresca`` or ``ModifiedMohrCoulomb``; that of
        the surface if not given.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds, or an element has too little fracture energy for a curve.

    Notes
    -----
    Return to the pyramid, and to its apex.  What a strain comes to depends on its steps.  Kratos exchanges
    the shears yz and zx in ∂J₃/∂σ: where both are 0 it does the same.  The potential is round through the
    corners of compression alone, as there.  Source: Oller, Nonlinear Dynamics of Structures (2014), and
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
