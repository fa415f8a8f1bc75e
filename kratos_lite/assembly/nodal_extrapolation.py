"""Nodal extrapolation: stresses and strains at Gauss points taken to nodes and averaged there; at points."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias

import numpy as np

from kratos_lite import voigt
from kratos_lite.assembly.element_groups import ElementGroup, add_nodal, as_double, compiled
from kratos_lite.assembly.gauss_point_fields import at_gauss, displaced, value_at, volumes
from kratos_lite.elements import KinematicLinear
from kratos_lite.mesh.locate import Located
from kratos_lite.quadrature import Rule
from kratos_lite.registry import remembered
from kratos_lite.shapes.base import at_points
from kratos_lite.shapes.inverse import cofactors, determinant
from kratos_lite.typing import Array, Ints

Extrapolation: TypeAlias = Callable[[type[KinematicLinear], Rule], Array]
"""A matrix (n, g) from values at the Gauss points of an element to those at its nodes."""


@remembered
def extrapolation(element: type[KinematicLinear], rule: Rule) -> Array:
    """Return the matrix (n, g) from values at Gauss points to values at nodes."""
    # The values are fitted by least squares with the functions of the corner cell (trilinear in a
    # hexahedron), where stresses of displacement elements are most accurate, and read off at the nodes.
    corner = element.shape.linear()
    if corner is None:
        return np.full((len(element.nodes), len(rule)), 1 / len(rule))
    at_gauss_points = at_points(corner.N, rule.points)
    at_nodes = at_points(corner.N, element.nodes)
    mean = np.full((len(rule), len(rule)), 1 / len(rule))  # apart, so that few points still give constants
    return at_nodes @ np.linalg.pinv(at_gauss_points) @ (np.eye(len(rule)) - mean) + mean[:1]


def extrapolated(points: Array, group: ElementGroup, u: Array, *, stress: bool = True) -> Array:
    """Return stresses, or strains, extrapolated to the nodes of each element, (m, k, 6)."""
    return extrapolation(group.element, group.rule) @ at_gauss(points, group, u, stress=stress)


def averages(
    points: Array,
    groups: Sequence[ElementGroup],
    u: Array,
    n_elements: int,
    stress: bool,
    rule: Extrapolation,
) -> tuple[Array, Array]:
    """Return stresses, or strains: means over the volume of each element (m, 6) and nodal (n, 6)."""
    total, count = np.zeros((len(points), 6)), np.zeros(len(points))
    means = np.zeros((n_elements, 6))
    for group in groups:
        nodal, mean = _averages(points, group, u, stress, rule)
        total += nodal
        means[group.rows] = mean
        count += np.bincount(group.nodes.ravel(), minlength=len(total))
    return means, total / np.maximum(count, 1)[:, None]


def _averages(
    points: Array, group: ElementGroup, u: Array, stress: bool, rule: Extrapolation
) -> tuple[Array, Array]:
    """Return the sums of the nodal values (n, 6) of a group and the means of its elements (m, 6)."""
    to_nodes = as_double(rule(group.element, group.rule))
    if not (group.is_linear and group.is_evenly_heated):
        value, volume = at_gauss(points, group, u, stress=stress), volumes(points, group)
        means = np.einsum("mg,mgc->mc", volume / volume.sum(axis=1, keepdims=True), value)
        return _sums(group, value, len(points), rule), means
    if module := compiled("gauss", group.element):
        nodal, mean = module.averages(*displaced(points, group, u, stress), to_nodes)
        return nodal, mean
    total, means = np.zeros((len(points), 6)), np.zeros((len(group), 6))
    for chunk in group.chunks():
        element = group.at(points, chunk)
        value, volume = value_at(element, group, u, chunk, stress), element.dV[..., None]
        means[chunk] = (value * (volume / volume.sum(axis=1, keepdims=True))).sum(axis=1)
        add_nodal(total, group.nodes[chunk], to_nodes @ value)
    return total, means


def averaged(
    groups: Sequence[ElementGroup], values: Sequence[Array], n: int, rule: Extrapolation = extrapolation
) -> Array:
    """Return values (m, g, c) at Gauss points, extrapolated to nodes and averaged there, (n, c)."""
    total = sum(_sums(group, value, n, rule) for group, value in zip(groups, values, strict=True))
    count = np.bincount(np.concatenate([group.nodes.ravel() for group in groups]), minlength=n)
    return np.asarray(total / np.maximum(count[:, None], 1))


def _sums(group: ElementGroup, value: Array, n: int, rule: Extrapolation = extrapolation) -> Array:
    """Return the sums at nodes (n, c) of values (m, g, c) extrapolated to the nodes of each element."""
    total = np.zeros((n, value.shape[-1]))
    add_nodal(total, group.nodes, rule(group.element, group.rule) @ value)
    return total


# ---- at points ------------------------------------------------------------------------------------


def at_located(groups: Sequence[ElementGroup], located: Located, u: Array, *, stress: bool = True) -> Array:
    """Return stresses in Pa with prestress, or strains, (..., 6) of displacements u (n, 3) in m at points."""
    xi, points = located.xi.reshape(-1, 3), located.mesh.points
    out = np.zeros((len(xi), 6))
    for group, at, cells in _groups_at(groups, located):
        if not group.is_linear:
            value = _extrapolated(group, cells, xi[at], lambda g: at_gauss(points, g, u, stress=stress))
        else:
            value = strain_of(group, points[group.nodes[cells]], xi[at], u[group.nodes[cells]])
            if stress:
                value = group.elastic(value, cells)
                value = value if group.prestress is None else value + group.prestress[cells]
                if group.heating is not None:
                    heating = _extrapolated(group, cells, xi[at], lambda g: g.thermal_strain())
                    value = value - group.elastic(heating, cells)
        out[at] = value
    return out.reshape(*located.rows.shape, 6)


def extrapolated_at(
    groups: Sequence[ElementGroup], located: Located, values: Callable[[ElementGroup], Array]
) -> Array:
    """Return values (m, g, c) at the Gauss points of groups at points (k,), (k, c)."""
    xi, parts = located.xi.reshape(-1, 3), []
    for group, at, cells in _groups_at(groups, located):
        parts.append((at, _extrapolated(group, cells, xi[at], values)))
    out = np.zeros((len(xi), parts[0][1].shape[1]))
    for at, value in parts:
        out[at] = value
    return out


def _groups_at(groups: Sequence[ElementGroup], located: Located) -> Iterator[tuple[ElementGroup, Ints, Ints]]:
    """Yield the groups in which points lie, the numbers of these, and the element of the group of each."""
    rows = located.rows.ravel()
    for group in groups:
        number = np.full(sum(map(len, located.mesh.blocks)), -1)
        number[group.rows] = np.arange(len(group))
        at = np.flatnonzero((rows >= 0) & (number[rows] >= 0))
        if len(at):
            yield group, at, number[rows[at]]


def _extrapolated(
    group: ElementGroup, cells: Ints, xi: Array, values: Callable[[ElementGroup], Array]
) -> Array:
    """Return values at the Gauss points of elements, extrapolated within each to its own xi (k, 3)."""
    chosen, places = np.unique(cells, return_inverse=True)
    some = group.take(np.isin(np.arange(len(group)), chosen))
    raw = (extrapolation(group.element, group.rule) @ values(some))[places]
    return np.einsum("ck,ckj->cj", group.element.N(xi), raw)


def strain_of(group: ElementGroup, X: Array, xi: Array, u: Array) -> Array:
    """Return the strain (k, 6) of elements X (k, n, 3) under u (k, n, 3), each at its own xi (k, 3)."""
    element = group.element
    if element.has_standard_strain():
        dN = element.dN(xi)
        J = np.swapaxes(X, -1, -2) @ dN
        D = dN @ (cofactors(J) / determinant(J)[..., None, None])
        return voigt.symmetric_gradient(np.swapaxes(u, -1, -2) @ D)
    C = group.material.C
    return np.array([element(x, group.rule).strain_at(t, v, C) for x, t, v in zip(X, xi, u, strict=True)])
