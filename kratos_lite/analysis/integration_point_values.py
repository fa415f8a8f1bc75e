"""Integration point values: quantities at Gauss points by the names that Kratos gives them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kratos_lite import voigt
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import at_gauss
from kratos_lite.elements import KinematicLinear
from kratos_lite.typing import Array


@dataclass(eq=False)
class GaussPoints:
    """The g Gauss points of m elements.

    Attributes
    ----------
    points : (n, 3) in m, the nodes of the mesh.
    group : the elements.
    u : (n, 3) in m, the displacement.
    strained : (n, 3) in m, the displacement without its stress-free part.
    """

    points: Array
    group: ElementGroup
    u: Array
    strained: Array

    @cached_property
    def element(self) -> KinematicLinear:
        """The elements, placed."""
        return self.group.at(self.points)

    @cached_property
    def N(self) -> Array:
        """Shape functions (g, k)."""
        return self.element._N(self.group.rule)

    def strain(self) -> Array:
        """Return ε (m, g, 6), engineering shear."""
        return at_gauss(self.points, self.group, self.strained, stress=False)

    def strain_tensor(self) -> Array:
        """Return ε (m, g, 3, 3)."""
        return voigt.tensor(self.strain() * [1, 1, 1, 0.5, 0.5, 0.5])

    def stress(self) -> Array:
        """Return σ (m, g, 6) in Pa, with the prestress."""
        return at_gauss(self.points, self.group, self.strained)

    def stress_tensor(self) -> Array:
        """Return σ (m, g, 3, 3) in Pa."""
        return voigt.tensor(self.stress())

    def von_mises(self) -> Array:
        """Return the von Mises stress (m, g) in Pa."""
        return voigt.von_mises(self.stress())

    def energy_density(self) -> Array:
        """Return ½ ε:C:ε (m, g) in J/m³."""
        strain = self.strain()
        return (strain * self.group.stress(strain)).sum(axis=-1) / 2

    def elasticity(self) -> Array:
        """Return C (m, g, 6, 6) in Pa of the material."""
        return np.tile(self.group.material.C, (len(self.group), len(self.group.rule), 1, 1))

    def jacobian(self) -> Array:
        """Return det J (m, g) in m³."""
        return self.element.dV / self.group.rule.weights

    def weight(self) -> Array:
        """Return γ det J (m, g) in m³."""
        return self.element.dV

    def place(self) -> Array:
        """Return X (m, g, 3) in m."""
        return self.element.gauss_points()

    def reference_place(self) -> Array:
        """Return ξ (m, g, 3)."""
        return np.tile(self.group.rule.points, (len(self.group), 1, 1))

    def displacement(self) -> Array:
        """Return u (m, g, 3) in m."""
        return self.N @ self.u[self.group.nodes]

    def B(self) -> Array:
        """Return B (m, g, 6, 3k) in 1/m."""
        return self.element._operator(self.group.material.C)


QUANTITIES: dict[str, Callable[[GaussPoints], Array]] = {
    "CAUCHY_STRESS_VECTOR": GaussPoints.stress,
    "CAUCHY_STRESS_TENSOR": GaussPoints.stress_tensor,
    "PK2_STRESS_VECTOR": GaussPoints.stress,
    "PK2_STRESS_TENSOR": GaussPoints.stress_tensor,
    "STRESSES": GaussPoints.stress,
    "VON_MISES_STRESS": GaussPoints.von_mises,
    "GREEN_LAGRANGE_STRAIN_VECTOR": GaussPoints.strain,
    "GREEN_LAGRANGE_STRAIN_TENSOR": GaussPoints.strain_tensor,
    "STRAIN": GaussPoints.strain,
    "STRAIN_ENERGY": GaussPoints.energy_density,
    "CONSTITUTIVE_MATRIX": GaussPoints.elasticity,
    "JACOBIAN": GaussPoints.jacobian,
    "JACOBIAN_0": GaussPoints.jacobian,
    "INTEGRATION_WEIGHT": GaussPoints.weight,
    "INTEGRATION_COORDINATES": GaussPoints.place,
    "INTEGRATION_POINT_GLOBAL": GaussPoints.place,
    "INTEGRATION_POINT_LOCAL": GaussPoints.reference_place,
    "DISPLACEMENT": GaussPoints.displacement,
    "STRAIN_INTERPOLATION_OPERATOR": GaussPoints.B,
}
"""What is known at Gauss points by Kratos's names; strains are small, so that all stress measures agree.

Names are those of KinematicLinear and SmallDisplacementElement.
"""
