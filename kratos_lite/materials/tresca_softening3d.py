"""TrescaSoftening3D: plasticity by the largest shear stress, which softens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kratos_lite.materials.softening import Softening, names_in_kratos


@dataclass(frozen=True)
class TrescaSoftening3D(Softening):
    """J2Softening3D within the hexagon of Tresca: elastic while σ₁ - σ₃ ≤ σ_Y f(κ).

    Where sin 3θ passes ±0.95, with Lode's angle θ, surface and flow are the circle of von Mises through the
    corners, as in Kratos; there the equivalent stress jumps by 5 %.

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
    What a strain comes to depends on its steps.  Kratos exchanges the shears yz and zx in ∂J₃/∂σ: where
    both are 0 it does the same.  Source: Nayak & Zienkiewicz, J. Struct. Div. ASCE 98 (1972) 949, and
    TrescaYieldSurface of KratosConstitutiveLawsApplication.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> steel = kl.TrescaSoftening3D(200e9, 0.3, 200e6, 4e5, curve=3)
    >>> path = kl.material_point(steel, strain={"xy": [0.004]})
    >>> print(f"{path.stress[-1, 3] / 1e6:.1f} MPa")
    100.0 MPa
    """

    surface: ClassVar[str] = "Tresca"
    aliases: ClassVar[tuple[str, ...]] = names_in_kratos(surface)
