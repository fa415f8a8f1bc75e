"""Point fields: strains and stresses anywhere in a mesh, by B of the element that contains the point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite import voigt
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements.tables import cofactors, determinant
from kratos_lite.mesh.locate import Located
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from kratos_lite.assembly.recovery import Recovery


def at_located(groups: Sequence[ElementGroup], located: Located, u: Array, *, stress: bool = True) -> Array:
    """Return stresses in Pa with prestress, or strains, (..., 6) of displacements u (n, 3) in m at points."""
    rows, xi = located.rows.ravel(), located.xi.reshape(-1, 3)
    out = np.zeros((len(rows), 6))
    for group in groups:
        number = np.full(sum(map(len, located.mesh.blocks)), -1)
        number[group.rows] = np.arange(len(group))
        at = np.flatnonzero((rows >= 0) & (number[rows] >= 0))
        if not len(at):
            continue
        cells = number[rows[at]]
        X, displaced = (values[group.nodes[cells]] for values in (located.mesh.points, u))
        value = _strain(group, X, xi[at], displaced)
        if stress:
            value = group.stress(value)
            value = value if group.prestress is None else value + group.prestress[cells]
        out[at] = value
    return out.reshape(*located.rows.shape, 6)


def recovered_at(recovery: Recovery, located: Located, u: Array, *, stress: bool = True) -> Array:
    """Return recovered stresses in Pa, or strains, (..., 6) at points, between nodes of one material."""
    out = np.zeros((*located.rows.shape, 6))
    for region, values in recovery.by_region(u, stress=stress):
        inside = np.isin(located.rows, np.concatenate([group.rows for group in region.groups]))
        if inside.any():
            nodal = np.zeros((len(located.mesh.points), 6))
            nodal[region.nodes] = values
            out[inside] = located[inside].interpolate(nodal)
    return out


def _strain(group: ElementGroup, X: Array, xi: Array, u: Array) -> Array:
    """Return the strain (k, 6) of elements X (k, n, 3) under u (k, n, 3), each at its own xi (k, 3)."""
    element = group.element
    if element.has_standard_strain():
        dN = element.dN(xi)
        J = np.swapaxes(X, -1, -2) @ dN
        D = dN @ (cofactors(J) / determinant(J)[..., None, None])
        return voigt.symmetric_gradient(np.swapaxes(u, -1, -2) @ D)
    C = group.material.C
    return np.array([element(x, group.rule).strain_at(t, v, C) for x, t, v in zip(X, xi, u, strict=True)])
