"""Integration point values: quantities at Gauss points by the names that Kratos gives them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.fields import FIELDS
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import at_gauss, volumes
from kratos_lite.elements import KinematicLinear
from kratos_lite.typing import Array


@dataclass(eq=False)
class GaussPoints:
    """The g Gauss points of m elements."""

    points: Array  # (n, 3) in m, the nodes of the mesh
    group: ElementGroup  # the elements
    u: Array  # (n, 3) in m, the displacement
    strained: Array  # (n, 3) in m, the displacement without its stress-free part

    @cached_property
    def element(self) -> KinematicLinear:
        """The elements, placed."""
        return self.group.at(self.points)

    @cached_property
    def N(self) -> Array:
        """Shape functions (g, k)."""
        return self.element._N(self.group.rule)

    @property
    def strain(self) -> Array:
        """ε (m, g, 6), engineering shear."""
        return at_gauss(self.points, self.group, self.strained, stress=False)

    @property
    def stress(self) -> Array:
        """σ (m, g, 6) in Pa, with the prestress."""
        return at_gauss(self.points, self.group, self.strained)

    @property
    def elastic(self) -> tuple[Array, Array]:
        """ε and the stress (m, g, 6) in Pa without prestress."""
        strain = self.strain
        return strain, strain @ self.group.material.C.T

    @property
    def displacement(self) -> Array:
        """Displacement (m, g, 3) in m."""
        return self.N @ self.u[self.group.nodes]

    def mean(self, values: Array) -> Array:
        """Return the means over the volume of each element (m, ...) of values (m, g, ...)."""
        volume = volumes(self.points, self.group)
        return np.asarray(np.einsum("mg,mg...->m...", volume / volume.sum(axis=1, keepdims=True), values))

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

    def B(self) -> Array:
        """Return B (m, g, 6, 3k) in 1/m."""
        return self.element._operator(self.group.material.C)


def _stress_tensor(at: GaussPoints) -> Array:
    return voigt.tensor(at.stress)


def _strain_tensor(at: GaussPoints) -> Array:
    return voigt.tensor(at.strain * voigt.HALF_SHEAR)


QUANTITIES: dict[str, Callable[[GaussPoints], Array]] = {
    **{field.kratos: field.at for field in FIELDS.values() if field.kratos and "gauss" in field.where},
    "CAUCHY_STRESS_TENSOR": _stress_tensor,
    "PK2_STRESS_VECTOR": FIELDS["stress"].at,
    "PK2_STRESS_TENSOR": _stress_tensor,
    "STRESSES": FIELDS["stress"].at,
    "GREEN_LAGRANGE_STRAIN_TENSOR": _strain_tensor,
    "STRAIN": FIELDS["strain"].at,
    "CONSTITUTIVE_MATRIX": GaussPoints.elasticity,
    "JACOBIAN": GaussPoints.jacobian,
    "JACOBIAN_0": GaussPoints.jacobian,
    "INTEGRATION_WEIGHT": GaussPoints.weight,
    "INTEGRATION_COORDINATES": GaussPoints.place,
    "INTEGRATION_POINT_GLOBAL": GaussPoints.place,
    "INTEGRATION_POINT_LOCAL": GaussPoints.reference_place,
    "STRAIN_INTERPOLATION_OPERATOR": GaussPoints.B,
}
"""What is known at Gauss points by Kratos's names; strains are small, so that all stress measures agree.

Names are those of KinematicLinear and SmallDisplacementElement.
"""
