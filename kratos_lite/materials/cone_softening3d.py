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
    E, nu, yield_stress, fracture_energy, curve, compression, density, alpha : as of `J2Softening3D`.
    friction, dilatancy, peak, peak_at, linear_until, strains, stresses, potential : as of `J2Softening3D`.

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
