"""Gauss point fields: volumes, strains and stresses of elements, and the loads and energies of them.

Every function takes the compiled kernels, but for element classes with a B or local system of a user, which
are computed by their methods in cache-sized chunks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.assembly.element_groups import (
    ElementGroup,
    add_nodal,
    as_double,
    by_mass_rule,
    compiled,
    geometries_of,
)
from kratos_lite.elements import KinematicLinear, custom, tables
from kratos_lite.elements import total_lagrangian as lagrange
from kratos_lite.elements.exact_rules import CURVED
from kratos_lite.elements.tables import tabulate
from kratos_lite.shapes.inverse import determinant
from kratos_lite.typing import Array, Ints, Mask, Rows

STEP = 2e-5
"""Of differences by coordinates, beside volume over length²: rounding and curvature are 1e-10 of terms."""


def displaced(points: Array, group: ElementGroup, u: Array, stress: bool = True) -> tuple[Any, ...]:
    """Return what kernels take to compute strains, or stresses, of displacements u (n, 3)."""
    nodes, _, dN, weights = group.tables()
    law = group.kernel_arguments() if stress else (np.eye(6), None)  # a strain is the stress of C = 1
    return as_double(points), nodes, dN, weights, as_double(u), *law, group.strain_tables()


# ---- geometry ------------------------------------------------------------------------------------


def clearly_positive(
    points: Array, nodes: Ints | Rows, element: type[KinematicLinear], dN: Array, g: int
) -> Mask:
    """Return a mask (m,) of the elements whose det J is so clearly > 0 that none needs a closer look."""
    # At every point of `dN` (g', k, 3) it is above 1e-9 of its mean at the first `g`, and above a thousand
    # times what rounding of the coordinates makes of it. Without kernels every element needs the closer look.
    module = compiled("gauss")
    if module is None:
        return np.zeros(len(nodes), dtype=bool)
    weights = np.where(np.arange(len(dN)) < g, 1 / g, 0.0)
    cells = np.ascontiguousarray(nodes, dtype=np.int32)
    return module.clearly_positive(as_double(points), cells, as_double(dN), weights) > 0


def volumes(points: Array, group: ElementGroup) -> Array:
    """Return the volume of each Gauss point, γ det J, as (m, g) in m³."""
    if module := compiled("gauss"):
        nodes, _, dN, weights = group.tables()
        return module.volumes(as_double(points), nodes, dN, weights)
    return np.concatenate([group.at(points, chunk).dV for chunk in group.chunks()])


# ---- body forces ------------------------------------------------------------------------------------


def body_force(points: Array, group: ElementGroup, b: Array) -> Array:
    """Return ∫ N b dV of a group as nodal forces (n, 3) in N; b (3,), or nodal (n, 3), in N/m³."""
    nodal, total = b.ndim == 2, np.zeros_like(points)
    module = compiled("gauss")
    for part in by_mass_rule(points, group, 2 if nodal else 1) if module else ():
        tables = as_double(points), *part.tables()
        total += module.body_force(*tables, as_double(b)) if nodal else module.shares(*tables) * b
    for chunk in () if module else group.chunks():
        nodes = group.nodes[chunk]
        add_nodal(total, nodes, group.at(points, chunk).body_force(b[nodes] if nodal else b))
    return total


def body_force_by_function(
    points: Array, group: ElementGroup, b: Callable[[Array], Array], factors: int
) -> Array:
    """Return ∫ N b dV of a group as nodal forces (n, 3) in N; b of places (m, 3) gives (m, 3) in N/m³."""
    total = np.zeros_like(points)
    for part in by_mass_rule(points, group, factors):
        N, _ = tabulate(part.element.shape, part.rule)
        for chunk in part.chunks():
            nodes, dV = part.nodes[chunk], part.at(points, chunk)._volumes(part.rule)
            X = N @ points[nodes]
            add_nodal(total, nodes, N.T @ (b(X.reshape(-1, 3)).reshape(X.shape) * dV[..., None]))
    return total


def body_work(
    points: Array, group: ElementGroup, b: Any, v: Array, curved: bool = False
) -> Iterator[tuple[Ints, Rows, Array, Array]]:
    """Yield elements (m,), their nodes, v·b dV (m, g) in J and grad N (m, g, 3, k) in 1/m, by exact rules.

    v (n, 3) in m; b (3,), (n, 3), or a function of places, in N/m³.  The rules are also exact for cells
    whose nodes move, if `curved`.
    """
    geometry_of = np.full(len(group), CURVED) if curved else geometries_of(points, group)
    for mask, rule in group.element.mass_rules(geometry_of, 4 if callable(b) else b.ndim):
        part, N = replace(group.take(mask), rule=rule), tabulate(group.element.shape, rule)[0]
        for chunk in part.chunks():
            nodes, (dV, D) = part.nodes[chunk], part.at(points, chunk)._gauss
            X = N @ points[nodes]
            force = b(X.reshape(-1, 3)).reshape(X.shape) if callable(b) else N @ b[nodes] if b.ndim > 1 else b
            yield part.rows[chunk], nodes, ((N @ v[nodes]) * force).sum(axis=-1) * dV, D


# ---- strains and stresses --------------------------------------------------------------------------


def at_gauss(points: Array, group: ElementGroup, u: Array, *, stress: bool = True) -> Array:
    """Return stresses in Pa with prestress, or strains, (m, g, 6) of displacements u (n, 3) in m."""
    if not group.is_linear:
        strain, found = of_law(points, group, u)
        return cauchy(points, group, u, found) if stress else strain
    if module := compiled("gauss", group.element):
        found = module.stress(*displaced(points, group, u, stress))
        if not stress or group.is_evenly_heated:
            return found
        return found - group.elastic(group.thermal_strain())
    parts = [value_at(group.at(points, chunk), group, u, chunk, stress) for chunk in group.chunks()]
    return np.concatenate(parts)


def in_order(groups: Sequence[ElementGroup], parts: Sequence[Array]) -> Any:
    """Return values (m_i, g, ...) of groups as (m, g, ...) in the order of the mesh.

    Where groups have different numbers of Gauss points, a list of m arrays (g, ...).
    """
    m = sum(map(len, groups))
    if not parts:
        return np.zeros((0, 0))
    if len(parts) == 1 and (groups[0].rows == np.arange(m)).all():
        return parts[0]
    if len({part.shape[1:] for part in parts}) > 1:
        values: list[Any] = [None] * m
        for group, part in zip(groups, parts, strict=True):
            for row, value in zip(group.rows.tolist(), part, strict=True):
                values[row] = value
        return values
    out = np.zeros((m, *parts[0].shape[1:]))
    for group, part in zip(groups, parts, strict=True):
        out[group.rows] = part
    return out


def value_at(
    element: KinematicLinear, group: ElementGroup, u: Array, chunk: slice, stress: bool = True
) -> Array:
    """Return stresses, or strains, (m, g, 6) of the placed elements of a chunk by their own methods."""
    displacements = u[group.nodes[chunk]]
    if not stress:
        return element.strain(displacements, group.material.C)
    elastic = group.elastic(element.strain(displacements, group.material.C), chunk)
    return elastic + group.initial_stress(chunk)


def internal_load(points: Array, groups: Sequence[ElementGroup], u: Array) -> Array:
    """Return ∫ B^T σ dV of displacements u (n, 3) as nodal forces (n, 3) in N."""
    total = np.zeros_like(points)
    for group in groups:
        module = compiled("gauss", group.element)
        if module and group.is_evenly_heated:
            total += module.internal_load(*displaced(points, group, u))
            continue
        for chunk in group.chunks():
            add_nodal(total, group.nodes[chunk], _internal_forces(group.at(points, chunk), group, u, chunk))
    return total


def virtual_work(X: Array, group: ElementGroup, u: Array, v: Array) -> Array:
    """Return v·∫ B^T σ dV (m,) in J of elements X under u with virtual displacements v, all (m, k, 3)."""
    nodes = np.arange(X[..., 0].size, dtype=np.int32).reshape(X.shape[:2])  # none is shared
    forces = internal_load(X.reshape(-1, 3), [replace(group, nodes=nodes)], u.reshape(-1, 3))
    return np.asarray((forces.reshape(X.shape) * v).sum(axis=(1, 2)))


def work_by_coordinates(points: Array, group: ElementGroup, u: Array, v: Array) -> Array:
    """Return the derivative (n, 3) in N of v·∫ B^T σ dV of a group by the nodes, by central differences."""
    total, nodes = np.zeros_like(points), group.nodes
    X, u, v = (values[nodes] for values in (points, u, v))
    X = X - X.mean(axis=1, keepdims=True)
    step = STEP * volumes(points, group).sum(axis=1) / np.square(np.ptp(X, axis=1)).sum(axis=1)
    change = np.zeros_like(X)
    for a, i in np.ndindex(X.shape[1:]):
        there, back = X.copy(), X.copy()
        there[:, a, i] += step
        back[:, a, i] -= step
        difference = virtual_work(there, group, u, v) - virtual_work(back, group, u, v)
        change[:, a, i] = difference / (there - back)[:, a, i]
    add_nodal(total, nodes, change)
    return total


def _internal_forces(element: KinematicLinear, group: ElementGroup, u: Array, chunk: slice) -> Array:
    """Return the internal forces (m, k, 3) in N of a chunk, with those of the prestress."""
    C, displacements = group.material.C, u[group.nodes[chunk]]
    if "local_system" not in element.custom:
        return element.internal_force(value_at(element, group, u, chunk), C)
    forces = group.scaled(custom.system(element, C, displacements)[1], chunk)
    if group.prestress is None and group.heating is None:
        return forces
    stress = np.broadcast_to(group.initial_stress(chunk), (len(forces), len(group.rule), 6))
    return forces + element.internal_force(stress, C)


def totals(points: Array, groups: Sequence[ElementGroup], u: Array) -> tuple[float, float, int]:
    """Return strain energy in J, largest von Mises stress at a Gauss point in Pa, index of its element."""
    energy, largest, row = 0.0, 0.0, 0
    for group in groups:
        if not group.is_linear or group.heating is not None:
            parts = [totals_of(points, group, u)]
        elif module := compiled("gauss", group.element):
            parts = [module.totals(*displaced(points, group, u))]
        else:
            parts = [_totals(points, group, u, chunk) for chunk in group.chunks()]
        for part, mises, at in parts:
            energy += part
            if mises > largest:
                largest, row = mises, int(group.rows[at])
    return energy, largest, row


def _totals(points: Array, group: ElementGroup, u: Array, chunk: slice) -> tuple[float, float, int]:
    element = group.at(points, chunk)
    C, displacements = group.material.C, u[group.nodes[chunk]]
    strain = element.strain(displacements, C)
    elastic = group.elastic(strain, chunk)
    energy = float(((strain * elastic).sum(axis=-1) * element.dV).sum()) / 2
    if "local_system" in element.custom:
        forces = group.scaled(custom.system(element, C, displacements)[1], chunk)
        energy = float((forces * displacements).sum()) / 2
    mises = voigt.von_mises(elastic + group.initial_stress(chunk)).max(axis=1)
    return energy, float(mises.max()), chunk.start + int(mises.argmax())


# ---- laws and strains that are not linear -----------------------------------------------------------------


def initial_strain(group: ElementGroup) -> Array | float:
    """Return the elastic strain (m, 1 or g, 6) of prestress and temperature, or 0."""
    stress = group.initial_stress(slice(None))
    return stress @ np.linalg.inv(group.material.C) if isinstance(stress, np.ndarray) else 0.0


def of_law(points: Array, group: ElementGroup, u: Array) -> tuple[Array, Array]:
    """Return strains and stresses (m, g, 6) of a law, Green's and S of finite strains, at u (n, 3).

    The stresses of a group with states are these.
    """
    strains, states = np.zeros((len(group), len(group.rule), 6)), group.states
    for chunk in group.chunks():
        element, q, C = group.at(points, chunk), u[group.nodes[chunk]], group.material.C
        if states is not None and states.modes is not None:
            B = tables.strain_rows(element._gauss[1])
            G = element._modes(element.rule.points)  # type: ignore[attr-defined]
            alpha = states.modes[chunk, None, :, None]
            strains[chunk] = (B @ q.reshape(len(q), 1, -1, 1) + G @ alpha)[..., 0]
        else:
            strains[chunk] = lagrange.green_strain(element, q) if element.finite else element.strain(q, C)
    if states is not None:
        return strains, states.stress
    return strains, strains @ group.material.C.T + group.initial_stress(slice(None))


def deformation_gradient(points: Array, group: ElementGroup, u: Array) -> Array:
    """Return F (m, g, 3, 3) at displacements u (n, 3); 1 + ε of small strains."""
    if not group.element.finite:
        return np.eye(3) + voigt.tensor(at_gauss(points, group, u, stress=False) * voigt.HALF_SHEAR)
    chunks = group.chunks()
    H = [lagrange.displacement_gradient(group.at(points, c), u[group.nodes[c]]) for c in chunks]
    return np.eye(3) + np.concatenate(H)


def cauchy(points: Array, group: ElementGroup, u: Array, stress: Array) -> Array:
    """Return Cauchy's stress F S F^T / det F (m, g, 6) of that of a law, which it is at small strains."""
    if not group.element.finite:
        return stress
    F = deformation_gradient(points, group, u)
    J = determinant(F)[..., None, None]
    return voigt.vector(F @ voigt.tensor(stress) @ np.swapaxes(F, -1, -2) / J)


def energy_density(points: Array, group: ElementGroup, u: Array) -> Array:
    """Return the stored energy (m, g) in J/m³ of a law at displacements u (n, 3)."""
    law, states = group.material, group.states
    if group.is_linear:
        strain = at_gauss(points, group, u, stress=False) - group.thermal_strain()
        return np.asarray((group.elastic(strain) * strain).sum(axis=-1) / 2)
    strain, stress = of_law(points, group, u)
    if states is None:
        return law.energy(strain, strain @ law.C.T, {})
    return law.energy(strain + initial_strain(group), stress, states.variables)


def totals_of(points: Array, group: ElementGroup, u: Array) -> tuple[float, float, int]:
    """Return stored energy in J, largest von Mises stress in Pa and its element of a group with states."""
    mises = voigt.von_mises(at_gauss(points, group, u)).max(axis=1)
    energy = float((energy_density(points, group, u) * volumes(points, group)).sum())
    return energy, float(mises.max()), int(mises.argmax())
