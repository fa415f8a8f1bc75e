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
    E, nu, yield_stress, fracture_energy, curve, compression, density, alpha : as of `J2Softening3D`.
    friction, dilatancy, peak, peak_at, linear_until, strains, stresses, potential : as of `J2Softening3D`.

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
