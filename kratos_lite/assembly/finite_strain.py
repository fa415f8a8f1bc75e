"""Large displacements: internal forces, stiffness, energy and highest frequency of groups of elements.

Total Lagrangian with the Saint Venant–Kirchhoff law S = C:E + S0, where C is that of the material and
S0 the prestress of a group; the formulas are in `elements.total_lagrangian`.  It holds for large
rotations with small strains; under strong compression the law loses its stiffness (a confined bar at a
stretch of 1/√3).

Compiled kernels are taken where the element class leaves its geometry as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup, add_nodal, as_double, compiled
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import add_in_parts
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements import total_lagrangian as lagrange
from kratos_lite.errors import MaterialError, ModelError
from kratos_lite.typing import Array

SAME_SHAPE = 1e-10
"""Elements whose edges differ by less than this fraction of their size have one frequency."""


def check_elements(groups: Sequence[ElementGroup]) -> None:
    """Raise ModelError for elements whose strain or stiffness is not that of their gradients."""
    for group in groups:
        if group.element.custom or not group.element.has_standard_strain():
            raise ModelError(
                f"{group.element.__name__} has a B or local system of small strains.  Large "
                "displacements take Green's strain from the gradients dN/dX alone; use "
                'formulation="corotational" or "modal", or a KinematicLinear element'
            )


def _compiled(group: ElementGroup) -> Any:
    """Return the kernels if they stand for the geometry of an element class and its heating, else None."""
    check_elements([group])
    return compiled("lagrange") if group.is_evenly_heated else None


def _arguments(
    points: Array, group: ElementGroup, q: Array, dq: Array | None, damping: float
) -> tuple[Any, ...]:
    """Return points, nodes, dN, weights, q, dq, damping, C and prestress, as kernels take them."""
    (nodes, _, dN, weights), change = group.tables(), None if dq is None else as_double(dq)
    return as_double(points), nodes, dN, weights, as_double(q), change, damping, *group.kernel_arguments()


def internal_load(
    points: Array, groups: Sequence[ElementGroup], q: Array, dq: Array | None = None, damping: float = 0.0
) -> Array:
    """Return ∫ P grad N dV as nodal forces (n, 3) in N."""
    total = np.zeros_like(points)
    for group in filter(len, groups):
        if module := _compiled(group):
            total += module.internal_load(*_arguments(points, group, q, dq, damping))
            continue
        for chunk in group.chunks():
            element, at = _moved(points, group, chunk, q, dq, damping)
            add_nodal(total, group.nodes[chunk], lagrange.internal_force(element, at))
    return total


def _moved(
    points: Array, group: ElementGroup, chunk: slice, q: Array, dq: Array | None, damping: float
) -> tuple[KinematicLinear, lagrange.Deformation]:
    """Return the placed elements of a chunk and their deformation."""
    nodes, element = group.nodes[chunk], group.at(points, chunk)
    step = None if dq is None else dq[nodes]
    at = lagrange.deformation(element, group.material.C, q[nodes], step, damping, group.initial_stress(chunk))
    return element, at


def stiffness(
    points: Array,
    groups: Sequence[ElementGroup],
    pattern: Pattern,
    q: Array,
    dq: Array | None = None,
    damping: float = 0.0,
) -> BlockMatrix:
    """Return the derivative of `internal_load` as 3x3 blocks, (3n, 3n) in N/m.

    Without dq it is the symmetric tangent by q.  With dq it is the derivative by dq, in general not
    symmetric; for dq → 0 without damping it is half the tangent.
    """
    data = np.zeros((len(pattern.indices), 3, 3))
    for number, group in enumerate(groups):
        if not len(group):
            continue
        if module := _compiled(group):
            arguments = _arguments(points, group, q, dq, damping)
            module.add_stiffness(*arguments, pattern.indptr, pattern.indices, data)
            continue

        def tangent(chunk: slice, group: ElementGroup = group) -> Array:
            element, at = _moved(points, group, chunk, q, dq, damping)
            return lagrange.stiffness_by_axis(element, group.material.C, at)

        for _ in add_in_parts(data, group, pattern, number, tangent):
            pass
    return BlockMatrix(data, pattern.indices, pattern.indptr)


def strain_energy(points: Array, groups: Sequence[ElementGroup], q: Array) -> float:
    """Return ∫ (½ E:C:E + S0:E) dV in J of nodal displacements q (n, 3) in m."""
    energy = 0.0
    for group in groups:
        if module := _compiled(group):
            *at, _, _, C, prestress = _arguments(points, group, q, None, 0.0)
            energy += module.totals(*at, C, prestress)[0]
            continue
        for chunk in group.chunks():
            element, displaced = group.at(points, chunk), q[group.nodes[chunk]]
            initial = group.initial_stress(chunk)
            energy += float(lagrange.strain_energy(element, group.material.C, displaced, initial).sum())
    return energy


def nodal_gradients(points: Array, groups: Sequence[ElementGroup]) -> tuple[Array, float]:
    """Return g_a = ∫ grad N_a dV as (n, 3) in m² and the volume V in m³.

    The mean deformation gradient of displacements q is 1 + Σ q_a g_a^T / V.
    """
    total, volume = np.zeros_like(points), 0.0
    for group in groups:
        for chunk in group.chunks():
            dV, D = group.at(points, chunk)._gauss
            values = np.swapaxes((D * dV[..., None, None]).sum(axis=-3), -1, -2)
            add_nodal(total, group.nodes[chunk], values)
            volume += float(dV.sum())
    return total, volume


# ---- the highest frequency -------------------------------------------------------------------------


def highest_frequency(
    points: Array, groups: Sequence[ElementGroup], q: Array | None = None, lumped: bool = False
) -> float:
    """Return an upper bound of the largest angular frequency in 1/s: the largest of any element alone."""
    # Source: Irons & Treharne, Proc. 3rd Conf. Matrix Methods in Struct. Mech., Wright-Patterson (1971). It
    # takes one dense eigenproblem (3k, 3k) for each element, some 0.1 ms with eight nodes; without q,
    # elements that are translations of each other take one together.
    largest = 0.0
    for group in groups:
        if not group.material.density > 0:
            raise MaterialError("an angular frequency needs a density > 0; give the material its density")
        alike = q is None and not group.element.custom  # a user's B may depend on X
        part = _distinct(points, group) if alike else group
        for chunk in part.chunks():
            largest = max(largest, float(_eigenvalues(points, part, chunk, q, lumped).max()))
    return float(np.sqrt(largest))


def _distinct(points: Array, group: ElementGroup) -> ElementGroup:
    """Return a group of one element of each shape, whatever its place."""
    edges = points[group.nodes] - points[group.nodes[:, :1]]
    size = np.abs(edges).max()
    keys = np.rint(edges.reshape(len(edges), -1) / (SAME_SHAPE * size))
    chosen = np.zeros(len(group), dtype=bool)
    chosen[np.unique(keys, axis=0, return_index=True)[1]] = True
    return group.take(chosen)


def _eigenvalues(points: Array, group: ElementGroup, chunk: slice, q: Array | None, lumped: bool) -> Array:
    """Return the eigenvalues (m, 3k) of K x = λ M x of each element of a chunk."""
    C, density = group.material.C, group.material.density
    if q is None:
        element = group.at(points, chunk)
        K = element.stiffness_by_axis(C)
    else:
        check_elements([group])
        element, at = _moved(points, group, chunk, q, None, 0.0)
        K = lagrange.stiffness_by_axis(element, C, at)
    m, k = len(K), K.shape[2]
    if lumped:
        root = 1 / np.sqrt(element.lumped_mass(density))
        K = root[:, None, :, None, None] * K * root[:, None, None, None, :]
    else:
        inverse = np.linalg.inv(np.linalg.cholesky(element.scalar_mass(density)))
        K = (inverse[:, None] @ K.reshape(m, 3, k, 3 * k)).reshape(m, 3 * k, 3, k)
        K = K @ np.swapaxes(inverse, -1, -2)[:, None]
    return np.asarray(np.linalg.eigvalsh(K.reshape(m, 3 * k, 3 * k)))
