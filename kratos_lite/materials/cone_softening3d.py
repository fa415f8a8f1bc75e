"""ConeSoftening3D: plasticity of concrete and rock that softens by a fracture energy."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, sin
from typing import ClassVar

from kratos_lite.materials.isotropic_law import check_angles
from kratos_lite.materials.j2_softening3d import J2Softening3D


@dataclass(frozen=True)
class ConeSoftening3D(J2Softening3D):
    """J2Softening3D within the cone of Drucker and Prager: its strength grows with the pressure.

    Elastic while 2 sin φ tr σ + √3 (3 - sin φ) √J₂ ≤ (3 + sin φ) σ_Y f(κ): a bar begins to flow at σ_Y in
    tension, and at σ_Y (3 + sin φ) / (3 - 3 sin φ) in compression.  f(κ) is as for J2Softening3D.

    Parameters
    ----------
    E, nu : Young's modulus in Pa and Poisson's ratio.
    yield_stress : σ_Y of tension in Pa, > 0.
    fracture_energy : J/m², > 0.
    curve : 0 to soften linearly, 1 exponentially, 3 for perfect plasticity.
    compression : the yield stress once more, as files have it; 0 if not given.
    density : kg/m³.
    alpha : thermal expansion in 1/K; see `Temperature`.
    friction : angle φ of internal friction in degrees, 0 < φ < 90.
    dilatancy : angle in degrees, 0 ≤ ψ ≤ φ, of the potential of the flow; associated if it is φ.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds.

    Notes
    -----
    Return to the cone, and to its apex, which softens from step to step.  Source: Oller, Nonlinear Dynamics
    of Structures (2014), and DruckerPragerYieldSurface of KratosConstitutiveLawsApplication.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> rock = kl.ConeSoftening3D(50e9, 0.2, 10e6, 1e4, curve=3, friction=30.0, dilatancy=30.0)
    >>> path = kl.material_point(rock, strain={"xx": [-0.002]})
    >>> print(f"{path.stress[-1, 0] / 1e6:.2f} MPa")
    -23.33 MPa
    """

    friction: float = 0.0
    dilatancy: float = 0.0

    aliases: ClassVar[tuple[str, ...]] = ("SmallStrainIsotropicPlasticity3DDruckerPragerDruckerPrager",)
    variables: ClassVar[dict[str, str]] = J2Softening3D.variables | {
        "friction": "FRICTION_ANGLE",
        "dilatancy": "DILATANCY_ANGLE",
    }
    keeps_volume: ClassVar[bool] = False

    @property
    def symmetric_tangent(self) -> bool:  # type: ignore[override]
        """Whether the flow is associated, and nothing softens."""
        return self.friction == self.dilatancy and self.curve == 3

    @property
    def cones(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Factors of tr σ and √J₂ in the equivalent stress, and in the potential of the flow."""
        sines = (sin(radians(angle)) for angle in (self.friction, self.dilatancy))
        (surface, flow) = ((2 * s / (3 - 3 * s), 3**0.5 * (3 - s) / (3 - 3 * s)) for s in sines)
        return surface, flow

    @property
    def strength(self) -> float:
        """The equivalent stress in Pa at which a bar begins to flow, its strength in compression."""
        s = sin(radians(self.friction))
        return self.yield_stress * (3 + s) / (3 - 3 * s)

    def check(self) -> None:
        """Check the angles, too."""
        super().check()
        check_angles(self)
