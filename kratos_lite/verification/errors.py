"""One routine for the error of a solution, from nodal displacements alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite import voigt
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements.tables import tabulate
from kratos_lite.quadrature import rule_for
from kratos_lite.typing import Array
from kratos_lite.verification import fields
from kratos_lite.verification.scenes import Scene

DEGREE, FINE_DEGREE = 8, 5
"""Of the rule for the integrals of the error; the lower one for linear elements on fine meshes."""
FINE = 20_000
"""Elements from which a mesh of linear elements counts as fine: their error is quadratic in each then."""
FINE_OF_SMOOTH = 500
"""The same where the exact field has no peaks."""
CHUNK = 64
"""Elements at a time: their B at all points, 35 MB of 27-node ones, stays near the processor."""


def errors(scene: Scene, u: Array) -> dict[str, float]:
    """Return the relative errors of nodal displacements u (n, 3) in m, or of the work of the loads."""
    if scene.exact is None:
        if scene.energy is None:
            return {}
        off = abs(float((scene.forces() * u).sum()) / 2 / scene.energy - 1)
        return {"displacement": off, "energy": off**0.5}
    exact = scene.exact(scene.model.mesh.points)
    l2, energy = norms(scene.exact, scene.model.mesh.points, scene.model.element_groups(), u)
    nodal = np.abs(u - exact).max() / np.abs(exact).max()
    return {"displacement": l2, "energy": energy, "nodal": float(nodal)}


def norms(
    field: fields.Field, points: Array, groups: Sequence[ElementGroup], u: Array, fine: int = FINE
) -> tuple[float, float]:
    """Return the relative errors of nodal displacements u (n, 3): L2 norm, and energy norm."""
    integrals = np.zeros(4)
    for group in groups:
        for start in range(0, len(group), CHUNK):
            integrals += _integrals(points, field, group, slice(start, start + CHUNK), u, fine)
    return float(np.sqrt(integrals[0] / integrals[1])), float(np.sqrt(integrals[2] / integrals[3]))


def _integrals(
    points: Array, field: fields.Field, group: ElementGroup, chunk: slice, u: Array, fine: int
) -> Array:
    """Return ∫ |u_h - u|², ∫ |u|², ∫ e:C:e of the error and of the exact strain, over some elements."""
    shape, nodes = group.element.shape, group.nodes[chunk]
    is_fine = len(group) >= fine and len(shape.nodes) == shape.corners
    rule = rule_for(shape.cell, FINE_DEGREE if is_fine else DEGREE)
    N, _ = tabulate(shape, rule)
    placed = group.element(points[nodes], rule)
    X, dV = N @ points[nodes], placed.dV
    exact, C = field(X), group.material.C
    strain = voigt.symmetric_gradient(fields.gradient(field, X))
    if group.element.has_standard_strain():
        off = placed.strain(u[nodes]) - strain
    else:  # the modes of an element are those of its own rule
        off = group.at(points, chunk).strain_at(rule.points, u[nodes], C) - strain
    return np.array(
        [
            (((N @ u[nodes] - exact) ** 2).sum(axis=-1) * dV).sum(),
            ((exact**2).sum(axis=-1) * dV).sum(),
            (((off @ C) * off).sum(axis=-1) * dV).sum(),
            (((strain @ C) * strain).sum(axis=-1) * dV).sum(),
        ]
    )
