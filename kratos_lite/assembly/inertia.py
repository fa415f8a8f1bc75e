"""Inertia: the matrices of the mass of elements, at rest or flowing through their mesh.

    M_ij = ∫ ρ N_i N_j,    G_ij = ∫ ρ N_i c·grad N_j,    H_ij = ∫ ρ (c·grad N_i)(c·grad N_j)

with the velocity c = A X + b: one number for each pair of nodes, alike for x, y and z.  Compiled, one pass
over the elements makes all that are asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, add_nodal, compiled, floats
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.geometry import GEOMETRY
from kratos_lite.elements.tables import lumped
from kratos_lite.quadrature import Rule
from kratos_lite.typing import Array

STEPS = (*GEOMETRY, "gauss_points", "scalar_mass")
"""What an element class may redefine so that its matrices are not those of its tables."""
REST = np.zeros((3, 4))


def inertia_matrices(
    points: Array,
    groups: Sequence[ElementGroup],
    pattern: Pattern,
    names: str,
    rule_of: Callable[[type[KinematicLinear]], Rule],
    velocity: Array = REST,
) -> dict[str, Array]:
    """Return matrices by name, each as data (nnz,) on the pattern: M in kg, G in kg/s, H in kg/s².

    Parameters
    ----------
    points : (n, 3) float, m.
    groups : elements with these points.
    pattern : the sparsity of their nodes, in the order of the groups.
    names : some of ``"MGH"``; the others are not computed.
    rule_of : gives the quadrature rule of an element class.
    velocity : (3, 4), A in 1/s and b in m/s of c = A X + b.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> model = kl.Model(kl.box(cells=(2, 2, 2)), kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0))
    >>> groups = model.element_groups()
    >>> pattern = Pattern(model.mesh.n_nodes, [group.nodes for group in groups])
    >>> made = inertia_matrices(model.mesh.points, groups, pattern, "M", lambda element: element.mass_rule)
    >>> round(float(made["M"].sum()), 8)
    7620.0
    """
    data = {name: np.zeros(len(pattern.indices)) for name in names}
    points = floats(points)
    for number, group in enumerate(groups):
        rule = rule_of(group.element)
        if module := compiled("inertia", group.element, *STEPS):
            nodes, N, dN, weights = group.tables(rule)
            tables = (N, dN, group.material.density * weights, floats(velocity))
            module.add(points, nodes, *tables, pattern.indptr, pattern.indices, **data)
        else:
            _add_computed(data, points, group, pattern, number, rule, velocity)
    return data


def _add_computed(
    data: dict[str, Array],
    points: Array,
    group: ElementGroup,
    pattern: Pattern,
    number: int,
    rule: Rule,
    velocity: Array,
) -> None:
    """Add the matrices of a group in NumPy, in parts."""
    for chunk in group.chunks():
        element = group.element(points[group.nodes[chunk]], rule)
        element.mass_rule = rule
        for name, matrices in _computed(element, group.material.density, data, velocity).items():
            pattern.add(data[name], number, chunk, matrices)


def _computed(element: KinematicLinear, density: float, names: Any, velocity: Array) -> dict[str, Array]:
    """Return the matrices (m, k, k) of elements by name."""
    found = {"M": element.scalar_mass(density)} if "M" in names else {}
    if "G" in names or "H" in names:
        dV, D = element._gauss
        c = element.gauss_points() @ velocity[:, :3].T + velocity[:, 3]
        along = (c[..., None, :] @ D)[..., 0, :]
        weights = (density * dV)[..., None, :]
        if "G" in names:
            found["G"] = (element._N(element.rule).T * weights) @ along
        if "H" in names:
            found["H"] = (np.swapaxes(along, -1, -2) * weights) @ along
    return found


# ---- lumped mass -----------------------------------------------------------------------------------


def lumped_mass(points: Array, groups: Sequence[ElementGroup]) -> Array:
    """Return the mass of each node, (n,) in kg: `KinematicLinear.lumped_mass` of all elements."""
    total = np.zeros((len(points), 1))
    for group in groups:
        for chunk in group.chunks():
            part = replace(group, nodes=group.nodes[chunk], rows=group.rows[chunk], prestress=None)
            add_nodal(total, part.nodes, _element_masses(points, part)[..., None])
    return total[:, 0]


def _element_masses(points: Array, group: ElementGroup) -> Array:
    """Return the lumped masses (m, k) of the elements of a group in kg."""
    density, rule = group.material.density, group.element.mass_rule
    module = compiled("gauss", group.element, *GEOMETRY, "scalar_mass", "lumped_mass")
    if module is None:
        return group.at(points).lumped_mass(density)
    sums, diagonal = module.mass_sums(floats(points), *group.tables(rule))
    return density * lumped(sums, diagonal, group.element.shape, rule)
