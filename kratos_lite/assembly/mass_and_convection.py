"""Mass and convective matrices of elements, at rest or flowing through their mesh.

    M_ij = ∫ ρ N_i N_j,    G_ij = ∫ ρ N_i c·grad N_j,    H_ij = ∫ ρ (c·grad N_i)(c·grad N_j)

with the velocity c = A X + b: one number for each pair of nodes, alike for x, y and z.  M and G are exact
for every geometry of the cells, H for affine ones; elsewhere it is a rational function.  Compiled, one pass
over the elements makes G and H.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, add_nodal, as_double, by_mass_rule, compiled
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.exact_rules import geometries
from kratos_lite.elements.tables import lumped
from kratos_lite.typing import Array

REST = np.zeros((3, 4))


def inertia_matrices(
    points: Array, groups: Sequence[ElementGroup], pattern: Pattern, names: str, velocity: Array = REST
) -> dict[str, Array]:
    """Return matrices by name, each as data (nnz,) on the pattern: M in kg, G in kg/s, H in kg/s²."""
    data = {name: np.zeros(len(pattern.indices)) for name in names}
    points = as_double(points)
    for number, group in enumerate(groups):
        if module := compiled("inertia"):
            _add_compiled(module, data, points, group, pattern, velocity)
            continue
        for chunk in group.chunks():
            element = group.element(points[group.nodes[chunk]])
            for name, matrices in _computed(element, group.material.density, names, velocity).items():
                pattern.add(data[name], number, chunk, matrices)
    return data


def _add_compiled(
    module: Any, data: dict[str, Array], points: Array, group: ElementGroup, pattern: Pattern, velocity: Array
) -> None:
    """Add the matrices of a group by kernels: M by its rules, G and H in one pass by theirs."""
    for flow, names in ((False, "M"), (True, "GH")):
        wanted = {name: data[name] for name in names if name in data}
        for part in by_mass_rule(points, group, 2, flow) if wanted else ():
            nodes, N, dN, weights = part.tables()
            tables = (N, dN, group.material.density * weights, as_double(velocity))
            module.add(points, nodes, *tables, pattern.indptr, pattern.indices, **wanted)


def _computed(element: KinematicLinear, density: float, names: str, velocity: Array) -> dict[str, Array]:
    """Return the matrices (m, k, k) of elements by name."""
    matrices = {"M": element.scalar_mass(density)} if "M" in names else {}
    if "G" in names or "H" in names:
        geometry, X = geometries(element.shape, element.X), element.X
        G, H = np.zeros((2, *X.shape[:2], X.shape[1]))
        for cells, rule in element.mass_rules(geometry, 2, flow=True):
            some = type(element)(X[cells], rule)
            dV, D = some._gauss
            c = some.gauss_points() @ velocity[:, :3].T + velocity[:, 3]
            along, weights = (c[..., None, :] @ D)[..., 0, :], (density * dV)[..., None, :]
            G[cells] = (some._N(rule).T * weights) @ along
            H[cells] = (np.swapaxes(along, -1, -2) * weights) @ along
        matrices |= {name: matrix for name, matrix in (("G", G), ("H", H)) if name in names}
    return matrices


# ---- lumped mass -----------------------------------------------------------------------------------


def lumped_mass(points: Array, groups: Sequence[ElementGroup]) -> Array:
    """Return the mass of each node, (n,) in kg: `KinematicLinear.lumped_mass` of all elements."""
    total = np.zeros((len(points), 1))
    for group in groups:
        for part in by_mass_rule(points, group, 2):
            for chunk in part.chunks():
                some = replace(part.without_initial, nodes=part.nodes[chunk], rows=part.rows[chunk])
                add_nodal(total, some.nodes, _element_masses(points, some)[..., None])
    return total[:, 0]


def _element_masses(points: Array, group: ElementGroup) -> Array:
    """Return the lumped masses (m, k) in kg of the elements of a group by its rule."""
    density = group.material.density
    module = compiled("gauss")
    if module is None:
        return group.at(points).lumped_mass(density)
    sums, diagonal = module.mass_sums(as_double(points), *group.tables())
    return density * lumped(sums, diagonal, group.element.shape, group.rule)
