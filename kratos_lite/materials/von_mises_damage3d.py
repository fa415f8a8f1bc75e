"""VonMisesDamage3D: isotropic damage by the stress of von Mises."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from kratos_lite import voigt
from kratos_lite.errors import MaterialError
from kratos_lite.materials.isotropic_damage3d import IsotropicDamage3D
from kratos_lite.materials.material import Material
from kratos_lite.materials.yield_surfaces import SURFACES, Invariants
from kratos_lite.typing import Array


@dataclass(frozen=True)
class VonMisesDamage3D(IsotropicDamage3D):
    """σ = (1 - d) C ε; damage d grows with the largest stress of von Mises of C ε, exponentially or linearly.

    Each element dissipates the fracture energy over its radius, from its center to its farthest node.

    Parameters
    ----------
    E, nu : Young's modulus in Pa and Poisson's ratio.
    strength : stress in Pa at which a bar begins to soften, > 0.
    fracture_energy : J/m², > 0.
    linear : 1 for linear softening, 0 for exponential one; SOFTENING_TYPE of files is 0 and 1.
    density : kg/m³.
    alpha : thermal expansion in 1/K; see `Temperature`.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds, or a radius is larger than 2 E G_f / strength².

    Notes
    -----
    Source: Oller, Nonlinear Dynamics of Structures (2014), and GenericConstitutiveLawIntegratorDamage of
    KratosConstitutiveLawsApplication, which does the same.

    Examples
    --------
    >>> import numpy as np
    >>> import kratos_lite as kl
    >>> concrete = kl.VonMisesDamage3D(E=30e9, nu=0.2, strength=3e6, fracture_energy=100.0)
    >>> start = concrete.initial_state()
    >>> start["element_radius"][:] = 0.1
    >>> stress, _, state = concrete.evaluate(np.array([2e-4, 0, 0, 0, 0, 0]), start, 1.0)
    >>> bool(0 < state["damage"][0] < 1)
    True
    """

    surface: ClassVar[str] = "VonMises"
    aliases: ClassVar[tuple[str, ...]] = ("SmallStrainIsotropicDamage3DVonMises",)
    variables: ClassVar[dict[str, str]] = IsotropicDamage3D.variables | {"linear": "SOFTENING_TYPE"}
    internal_variables: ClassVar[Mapping[str, int]] = {"damage": 1, "threshold": 1, "element_radius": 1}
    symmetric_tangent: ClassVar[bool] = False

    @classmethod
    def from_variables(cls, values: dict[str, Any]) -> Material:
        """Make the material from the variables of a file; SOFTENING_TYPE is 0 for linear softening."""
        given = {"YIELD_STRESS": values["YIELD_STRESS_TENSION"]} if "YIELD_STRESS_TENSION" in values else {}
        tension = values.get("YIELD_STRESS", values.get("YIELD_STRESS_TENSION"))
        compression = tension if "YIELD_STRESS" in values else values.get("YIELD_STRESS_COMPRESSION", tension)
        if cls.surface == "VonMises" and tension != compression:  # which softens by that of compression
            raise MaterialError(f"YIELD_STRESS_COMPRESSION of {cls.__name__} must be YIELD_STRESS_TENSION")
        kind = values.get("SOFTENING_TYPE", 1)
        if kind not in (0, 1):
            raise MaterialError(f"SOFTENING_TYPE must be 0, linear, or 1, exponential; got {kind}")
        return super().from_variables(given | values | {"SOFTENING_TYPE": 1 - kind})

    def _equivalent(self, strain: Array, effective: Array) -> tuple[Array, Array, float]:
        surface = SURFACES[self.surface](getattr(self, "friction", 0.0), self._ratio)
        q, normal = Invariants(effective).equivalent(surface)
        return q, voigt.times(normal, self.elastic.C), self.strength * surface.of_tension

    @property
    def _ratio(self) -> float:
        """Strength of compression over that of tension."""
        return (getattr(self, "compression", 0.0) or self.strength) / self.strength
