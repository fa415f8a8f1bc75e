"""ConeSoftening3D: plasticity of concrete and rock that softens by a fracture energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kratos_lite.materials.softening import Softening, names_in_kratos


@dataclass(frozen=True)
class ConeSoftening3D(Softening):
    """J2Softening3D within the cone of Drucker and Prager: its strength grows with the pressure.

    Elastic while 2 sin φ tr σ + √3 (3 - sin φ) √J₂ ≤ (3 + sin φ) σ_Y f(κ): a bar begins to flow at σ_Y in
    tension, and at σ_Y (3 + sin φ) / (3 - 3 sin φ) in compression.  f(κ) is as for J2Softening3D.

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
    Return to the cone, and to its apex.  Source: Oller, Nonlinear Dynamics of Structures (2014), and
    DruckerPragerYieldSurface of KratosConstitutiveLawsApplication.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> rock = kl.ConeSoftening3D(50e9, 0.2, 10e6, 1e4, curve=3, friction=30.0, dilatancy=30.0)
    >>> path = kl.material_point(rock, strain={"xx": [-0.002]})
    >>> print(f"{path.stress[-1, 0] / 1e6:.2f} MPa")
    -23.33 MPa
    """

    surface: ClassVar[str] = "DruckerPrager"
    aliases: ClassVar[tuple[str, ...]] = names_in_kratos(surface)
