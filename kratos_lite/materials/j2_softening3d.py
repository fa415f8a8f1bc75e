"""J2Softening3D: plasticity of von Mises that softens, with an energy that the mesh does not change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kratos_lite.materials.softening import Softening, names_in_kratos


@dataclass(frozen=True)
class J2Softening3D(Softening):
    """Elastic up to the yield stress of von Mises, which depends on the dissipated energy: σ_Y f(κ).

    κ is the work of the stress over plastic strains relative to the fracture energy over the radius of the
    element, from its center to its farthest node; in a bar the stress falls exponentially, f = 1 - κ, or
    linearly, f = √(1 - κ).  At a point without an element nothing softens.

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
    Each step takes the softening at the trial stress, and once more from there while the yield stress is
    missed by 1e-4.  Sources: Oller, Nonlinear Dynamics of Structures (2014); Nayak & Zienkiewicz, J. Struct.
    Div. ASCE 98 (1972) 949; GenericConstitutiveLawIntegratorPlasticity of KratosConstitutiveLawsApplication,
    which does the same.  Derivatives by complex steps: Squire & Trapp, SIAM Rev. 40 (1998) 110.

    Examples
    --------
    >>> import numpy as np
    >>> import kratos_lite as kl
    >>> steel = kl.J2Softening3D(E=200e9, nu=0.3, yield_stress=200e6, fracture_energy=4e5)
    >>> start = steel.initial_state()
    >>> start["element_radius"][:] = 0.05
    >>> stress, _, state = steel.evaluate(np.array([0, 0, 0, 4e-3, 0, 0]), start, 1.0)
    >>> bool(0 < state["plastic_dissipation"][0] < 1) and bool(stress[3] < 200e6 / 3**0.5)
    True
    """

    surface: ClassVar[str] = "VonMises"
    aliases: ClassVar[tuple[str, ...]] = names_in_kratos(surface)
