"""One routine for the error of a solution, from nodal displacements alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kratos_lite import voigt
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements.tables import tabulate
from kratos_lite.quadrature import Rule, rule_for
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
    return l2_norm(field, points, groups, u, fine), energy_norm(field, points, groups, u, fine)


def l2_norm(
    field: fields.Field, points: Array, groups: Sequence[ElementGroup], u: Array, fine: int = FINE
) -> float:
    """Return the relative error of nodal displacements u (n, 3) in the L2 norm."""
    integrals = np.zeros(2)
    for group, rule, chunk in _chunks(groups, fine):
        nodes, (N, _) = group.nodes[chunk], tabulate(group.element.shape, rule)
        dV = group.element(points[nodes], rule)._volumes(rule)
        exact = field(N @ points[nodes])
        integrals += [((value**2).sum(axis=-1) * dV).sum() for value in (N @ u[nodes] - exact, exact)]
    return float(np.sqrt(integrals[0] / integrals[1]))


def energy_norm(
    field: fields.Field, points: Array, groups: Sequence[ElementGroup], u: Array, fine: int = FINE
) -> float:
    """Return the relative error of nodal displacements u (n, 3) in the energy norm."""
    integrals = np.zeros(2)
    for group, rule, chunk in _chunks(groups, fine):
        nodes, (N, _), C = group.nodes[chunk], tabulate(group.element.shape, rule), group.material.C
        placed = group.element(points[nodes], rule)
        exact = voigt.symmetric_gradient(fields.gradient(field, N @ points[nodes]))
        if group.element.has_standard_strain():
            strain = placed.strain(u[nodes])
        else:  # the modes of an element are those of its own rule
            strain = group.at(points, chunk).strain_at(rule.points, u[nodes], C)
        integrals += [(((e @ C) * e).sum(axis=-1) * placed.dV).sum() for e in (strain - exact, exact)]
    return float(np.sqrt(integrals[0] / integrals[1]))


def _chunks(groups: Sequence[ElementGroup], fine: int) -> Iterator[tuple[ElementGroup, Rule, slice]]:
    """Yield some elements of a group at a time, and the rule for the integrals over them."""
    for group in groups:
        shape = group.element.shape
        is_fine = len(group) >= fine and len(shape.nodes) == shape.corners
        rule = rule_for(shape.cell, FINE_DEGREE if is_fine else DEGREE)
        for start in range(0, len(group), CHUNK):
            yield group, rule, slice(start, start + CHUNK)
