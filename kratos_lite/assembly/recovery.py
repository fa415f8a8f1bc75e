"""Recovered nodal values: stresses or strains of patches of elements, fitted by polynomials.

Source: Zienkiewicz & Zhu, Int. J. Numer. Meth. Eng. 33 (1992) 1331-1364: superconvergent patch recovery.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import at_gauss
from kratos_lite.assembly.patches import Hanging, Patches, patches
from kratos_lite.assembly.polynomial_fit import Samples, fit
from kratos_lite.elements import KinematicLinear
from kratos_lite.mesh import Block
from kratos_lite.quadrature import Rule, hexahedron
from kratos_lite.registry import remembered
from kratos_lite.typing import Array, Ints


@dataclass(frozen=True, eq=False)
class Sampling:
    """Where the values of an element are taken, and what is fitted to them.

    Attributes
    ----------
    N : (s, k) shape functions at the samples.
    from_gauss : (s, g) values there from those at the Gauss points; None where they are the Gauss points.
    degree : of the polynomials.
    means : whether means of elements are better than the samples, where there are enough of them.
    """

    N: Array
    from_gauss: Array | None
    degree: int
    means: bool


@remembered
def sampling(element: type[KinematicLinear], rule: Rule) -> Sampling:
    """Return how the values of an element class are sampled.

    Hexahedra of degree 2 have their most accurate stresses at 2 x 2 x 2 points (Barlow, Int. J. Numer. Meth.
    Eng. 10 (1976) 243-251): trilinear functions are fitted to those at more Gauss points.  In linear
    hexahedra and wedges without further modes they lie at the center.  One degree above that of the element
    is fitted, but in tetrahedra, which have no such points.
    """
    shape, T = element.shape, None
    simple = element.formulation != "enhanced" and shape.degree == 1 and shape.cell in ("hexahedron", "wedge")
    points = rule.points
    if shape.cell == "hexahedron" and shape.degree > 1 and len(rule) > 8:
        points = hexahedron(degree=3).points
        corner = shape.linear()
        at_gauss, at_samples = (np.array([corner.N(xi) for xi in P]) for P in (rule.points, points))
        weighted = at_gauss.T * rule.weights
        T = at_samples @ np.linalg.solve(weighted @ at_gauss, weighted)
    N = np.array([shape.N(xi) for xi in points])
    degree = shape.degree + (0 if simple or shape.cell == "tetrahedron" else 1)
    return Sampling(N, T, min(degree, 3), simple)


@dataclass(eq=False)
class Region:
    """Elements of one material, whose values are smooth.

    Attributes
    ----------
    groups : its elements.
    patches : see `Patches`.
    nodes : its nodes.
    """

    groups: list[ElementGroup]
    patches: Patches
    nodes: Ints


def regions(
    points: Array, groups: Sequence[ElementGroup], hanging: Hanging | None = None
) -> list[Region]:
    """Return the groups by material, with their patches."""
    by_material: dict[int, list[ElementGroup]] = {}
    for group in groups:
        by_material.setdefault(id(group.material), []).append(group)
    found = []
    for mine in by_material.values():
        blocks = [Block("", g.nodes, g.rows, 0 * g.rows, g.element.shape) for g in mine]
        around = patches(points, blocks, hanging)
        found.append(Region(mine, around, np.flatnonzero(around.of.lengths)))
    return found


def recovered(points: Array, region: Region, values: Sequence[Array]) -> Array:
    """Return values at the nodes of a region (k, 6) from those at the Gauss points of its groups (m, g, 6)."""
    ways = [sampling(group.element, group.rule) for group in region.groups]
    places, sampled, counts, degrees, means = [], [], [], [], []
    for group, way, value in zip(region.groups, ways, values, strict=True):
        places.append((way.N @ points[group.nodes]).reshape(-1, 3))
        sampled.append((value if way.from_gauss is None else way.from_gauss @ value).reshape(-1, 6))
        counts.append(np.full(len(group), len(way.N)))
        degrees.append(np.full(len(group), way.degree))
        means.append(np.full(len(group), int(way.means)))
    offset = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    samples = Samples(np.concatenate(places), np.concatenate(sampled), offset)
    elements = region.patches.elements
    first = elements.start[:-1]
    degree = np.minimum.reduceat(np.concatenate(degrees)[elements.entries], first)
    simple = np.maximum.reduceat(np.concatenate(means)[elements.entries], first)
    fitted = fit(samples, elements, region.patches.weights, degree, simple)
    return fitted.at(points[region.nodes], region.patches.of.take(region.nodes))


def elastic(groups: Sequence[ElementGroup]) -> list[ElementGroup]:
    """Return groups without their prestress."""
    return [replace(group, prestress=None) for group in groups]


def recovered_nodal(
    points: Array, found: Sequence[Region], u: Array, *, stress: bool = True
) -> tuple[Array, list[Array]]:
    """Return stresses, or strains, at nodes (n, 6), and those of each region.

    At nodes of several regions, the mean of these.
    """
    total, count = np.zeros((len(points), 6)), np.zeros(len(points))
    parts = []
    for region in found:
        values = [at_gauss(points, group, u, stress=stress) for group in region.groups]
        parts.append(recovered(points, region, values))
        total[region.nodes] += parts[-1]
        count[region.nodes] += 1
    return total / np.maximum(count, 1)[:, None], parts
