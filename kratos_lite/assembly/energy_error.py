"""Energy norm of the difference between nodal stresses, interpolated, and the stresses of the elements."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import at_gauss, volumes
from kratos_lite.elements.tables import tabulate
from kratos_lite.typing import Array


def squared_differences(
    points: Array, groups: Sequence[ElementGroup], u: Array, nodal: Array, n_elements: int
) -> Array:
    """Return ∫ (σ* - σ) : C⁻¹ : (σ* - σ) dV of each element, (m,) in J.

    σ* interpolates nodal stresses (n, 6) in Pa with the functions of the element; σ are the stresses of
    displacements u (n, 3) in m at the Gauss points.
    """
    found = np.zeros(n_elements)
    for group in groups:
        N, _ = tabulate(group.element.shape, group.rule)
        off = N @ nodal[group.nodes] - at_gauss(points, group, u)
        density = ((off @ np.linalg.inv(group.material.C)) * off).sum(axis=-1)
        found[group.rows] = (density * volumes(points, group)).sum(axis=1)
    return found
