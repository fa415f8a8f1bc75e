"""Nodal values: stresses and strains at Gauss points, extrapolated to nodes and averaged there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, add_nodal, as_double
from kratos_lite.assembly.gauss_point_fields import at_gauss, compiled_law, displaced, value_at
from kratos_lite.elements import KinematicLinear
from kratos_lite.quadrature import Rule
from kratos_lite.registry import remembered
from kratos_lite.shapes.base import at_points
from kratos_lite.typing import Array


@remembered
def extrapolation(element: type[KinematicLinear], rule: Rule) -> Array:
    """Return the matrix (n, g) from values at Gauss points to values at nodes.

    The values are fitted by least squares with the functions of the corner cell (trilinear in a
    hexahedron), where stresses of displacement elements are most accurate, and read off at the nodes.
    """
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
    points: Array, groups: Sequence[ElementGroup], u: Array, n_elements: int, *, stress: bool = True
) -> tuple[Array, Array]:
    """Return stresses, or strains: means over the volume of each element (m, 6) and nodal (n, 6).

    Nodal values are extrapolated in each element and averaged over the elements around each node.
    One pass over the elements gives both.
    """
    total, count = np.zeros((len(points), 6)), np.zeros(len(points))
    means = np.zeros((n_elements, 6))
    for group in groups:
        nodal, mean = _averages(points, group, u, stress)
        total += nodal
        means[group.rows] = mean
        count += np.bincount(group.nodes.ravel(), minlength=len(total))
    return means, total / np.maximum(count, 1)[:, None]


def _averages(points: Array, group: ElementGroup, u: Array, stress: bool) -> tuple[Array, Array]:
    """Return the sums of the nodal values (n, 6) of a group and the means of its elements (m, 6)."""
    to_nodes = as_double(extrapolation(group.element, group.rule))
    if module := compiled_law(group, stress=stress):
        nodal, mean = module.averages(*displaced(points, group, u, stress), to_nodes)
        return nodal, mean
    total, means = np.zeros((len(points), 6)), np.zeros((len(group), 6))
    for chunk in group.chunks():
        element = group.at(points, chunk)
        value, volume = value_at(element, group, u, chunk, stress), element.dV[..., None]
        means[chunk] = (value * (volume / volume.sum(axis=1, keepdims=True))).sum(axis=1)
        add_nodal(total, group.nodes[chunk], to_nodes @ value)
    return total, means
