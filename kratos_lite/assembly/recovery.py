"""Recovered nodal values: stresses or strains of patches of elements, fitted by polynomials.

Source: Zienkiewicz & Zhu, Int. J. Numer. Meth. Eng. 33 (1992) 1331-1364: superconvergent patch recovery.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from weakref import WeakKeyDictionary

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, add_nodal, floats
from kratos_lite.assembly.gauss_point_fields import at_gauss, volumes
from kratos_lite.assembly.nodal_values import extrapolation
from kratos_lite.assembly.patches import Patches, outer_corners, patches
from kratos_lite.assembly.polynomial_fit import Lists, Samples, as_rows, fit, lists
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.geometry import GEOMETRY
from kratos_lite.elements.overridden_steps import STRAIN
from kratos_lite.elements.tables import tabulate
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.blocks import NO_ROWS
from kratos_lite.native import kernels
from kratos_lite.quadrature import Rule, hexahedron, rule_for
from kratos_lite.records import record, replace
from kratos_lite.registry import remembered
from kratos_lite.typing import Array, Ints, Numbers


@record(frozen=True, eq=False)
class Sampling:
    """Where the values of an element are taken, and what is fitted to them.

    Attributes
    ----------
    N : (s, k) shape functions at the samples.
    from_gauss : (s, g) values there from those at the Gauss points; None where they are the Gauss points.
    degree : of the polynomials.
    means : whether means of elements are better than the samples, where there are enough of them.
    far : weight of elements in the patch of a node on the surface that do not contain this node.
    """

    N: Array
    from_gauss: Array | None
    degree: int
    means: bool
    far: float

    @property
    def count(self) -> int:
        """How many samples an element has."""
        return len(self.N)


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
        corner = shape.linear() or shape
        at_gauss, at_samples = (np.array([corner.N(xi) for xi in P]) for P in (rule.points, points))
        weighted = at_gauss.T * rule.weights
        T = at_samples @ np.linalg.solve(weighted @ at_gauss, weighted)
    N = np.array([shape.N(xi) for xi in points])
    degree = shape.degree + (0 if simple or shape.cell == "tetrahedron" else 1)
    far = 1.0 if shape.degree == 1 else 0.05 if shape.cell in ("hexahedron", "tetrahedron") else 0.5
    return Sampling(N, T, min(degree, 3), simple, far)


@record(frozen=True, eq=False)
class Region:
    """Elements of one material, over which stresses are smooth.

    Attributes
    ----------
    groups : its elements.
    nodes : (k,) their nodes, ascending.
    cells : the nodes of each group, numbered 0 … k - 1.
    patches : of these.
    """

    groups: list[ElementGroup]
    nodes: Ints
    cells: list[Ints]
    patches: Patches

    def at_nodes(self, points: Array, values: Sequence[Array]) -> Array:
        """Return values at the nodes (k, 6) from those at the Gauss points of the groups (m, g, 6)."""
        ways = [sampling(group.element, group.rule) for group in self.groups]
        places, sampled = [], []
        for group, way, value in zip(self.groups, ways, values, strict=True):
            T = way.from_gauss
            places.append(_combined(way.N, points, group.nodes).reshape(-1, 3))
            sampled.append((value if T is None else _from_points(T, value)).reshape(-1, 6))
        counts = np.repeat([way.count for way in ways], [len(group) for group in self.groups])
        samples = Samples(_joined(places), _joined(sampled), np.concatenate([[0], counts.cumsum()]))
        degree = self._of_patches([way.degree for way in ways], np.minimum)
        simple = self._of_patches([int(way.means) for way in ways], np.maximum)
        far = self._of_entries([way.far for way in ways])
        around = self.patches
        fitted = fit(samples, around.elements, np.where(around.own, 1.0, far), degree, simple)
        return fitted.at(points[self.nodes], around.of)

    def _of_entries(self, values: Sequence[float]) -> Array:
        """Return a value of each group for all entries of the patches."""
        if len(set(values)) == 1:
            return np.full(len(self.patches.elements.entries), values[0])
        return np.repeat(values, [len(group) for group in self.groups])[self.patches.elements.entries]

    def _of_patches(self, values: Sequence[int], least: np.ufunc) -> Ints:
        """Return the least, or the largest, value of the groups in each patch."""
        elements = self.patches.elements
        if len(set(values)) == 1:
            return np.full(len(elements), values[0])
        return np.asarray(least.reduceat(self._of_entries(values), elements.start[:-1]))

    def averaged(self, values: Sequence[Array]) -> Array:
        """Return the same, extrapolated to the nodes of each element and averaged there."""
        total, count = np.zeros((len(self.nodes), 6)), np.zeros(len(self.nodes))
        for group, cells, value in zip(self.groups, self.cells, values, strict=True):
            total += _sum(_from_points(extrapolation(group.element, group.rule), value), cells, len(total))
            count += np.bincount(cells.ravel(), minlength=len(count))
        return total / count[:, None]


_KNOWN: WeakKeyDictionary[Mesh, tuple[Ints, Ints, list[tuple[Ints, Patches]]]] = WeakKeyDictionary()
"""Material number and place in its region of each element, and nodes and patches of each region, by mesh."""


def _regions(mesh: Mesh, groups: Sequence[ElementGroup]) -> list[Region]:
    """Return the groups by material, with their patches, which a mesh keeps."""
    by_material: dict[int, list[ElementGroup]] = {}
    for group in groups:
        by_material.setdefault(id(group.material), []).append(group)
    parts = list(by_material.values())
    kind, place = np.full(mesh.n_elements, -1), np.zeros(mesh.n_elements, dtype=np.int64)
    for i, mine in enumerate(parts):
        rows = np.concatenate([group.rows for group in mine])
        kind[rows], place[rows] = i, np.arange(len(rows))
    known = _KNOWN.get(mesh)
    if known is None or not (np.array_equal(known[0], kind) and np.array_equal(known[1], place)):
        kinds, outer = outer_corners(mesh, kind)
        made = [_patches(mesh, mine, outer[kinds == i]) for i, mine in enumerate(parts)]
        known = _KNOWN[mesh] = kind, place, made
    return [_region(mesh, mine, *found) for mine, found in zip(parts, known[2], strict=True)]


def _region(mesh: Mesh, groups: list[ElementGroup], nodes: Ints, around: Patches) -> Region:
    number = np.zeros(mesh.n_nodes, dtype=np.int64)
    number[nodes] = np.arange(len(nodes))
    return Region(groups, nodes, [number[group.nodes] for group in groups], around)


def _patches(mesh: Mesh, groups: list[ElementGroup], outer: Ints) -> tuple[Ints, Patches]:
    """Return nodes and patches of groups; `outer` are the corners of the faces on their surface."""
    used, on_surface = np.zeros(mesh.n_nodes, dtype=bool), np.zeros(mesh.n_nodes, dtype=bool)
    for group in groups:
        used[group.nodes] = True
    on_surface[outer] = True
    nodes, number = np.flatnonzero(used), np.cumsum(used) - 1
    blocks = [Block("", number[g.nodes], g.rows, 0 * g.rows, g.element.shape) for g in groups]
    hanging, masters = NO_ROWS, Lists(np.zeros(1, dtype=np.int64), NO_ROWS)
    if mesh.hanging is not None:
        here = used[mesh.hanging.nodes]
        hanging = number[mesh.hanging.nodes[here]]
        every = Lists(mesh.hanging.start, mesh.hanging.masters).take(np.flatnonzero(here))
        kept = used[every.entries]
        masters = lists(every.owner[kept], number[every.entries[kept]], len(hanging))
    return nodes, patches(blocks, on_surface[nodes], hanging, masters)


class Recovery:
    """Recovered stresses and strains of a mesh, for any displacements.

    Parameters
    ----------
    mesh : of n nodes.
    groups : its elements.
    """

    def __init__(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> None:
        self.points, self.groups = mesh.points, list(groups)
        self.regions = _regions(mesh, groups)
        self._last: tuple[Array, list[Array]] | None = None  # displacements, and C ε at nodes

    def nodal(self, u: Array, *, stress: bool = True) -> Array:
        """Return recovered stresses with prestress in Pa, or strains, at nodes (n, 6).

        Nodes of several materials have the mean of these; nodes without elements 0.
        """
        total, count = np.zeros((len(self.points), 6)), np.zeros(len(self.points))
        for region, values in self.by_region(u, stress=stress):
            total[region.nodes] += values
            count[region.nodes] += 1
        return total / np.maximum(count, 1)[:, None]

    def by_region(self, u: Array, *, stress: bool = True) -> Iterator[tuple[Region, Array]]:
        """Yield each region with the values at its nodes (k, 6)."""
        free = stress and all(group.prestress is None for group in self.groups)
        if free and self._last is not None and self._last[0] is u:
            yield from zip(self.regions, self._last[1], strict=True)
            return
        found = []
        for region in self.regions:
            values = [at_gauss(self.points, group, u, stress=stress) for group in region.groups]
            found.append(region.at_nodes(self.points, values))
            yield region, found[-1]
        if free:
            self._last = u, found

    def differences(self, u: Array) -> Iterator[tuple[ElementGroup, Array]]:
        """Yield each group with recovered minus own stresses at its points, (m, g, 6) in Pa.

        The groups have no prestress, which is given and no part of the error, and rules that are good for the
        square of the difference.
        """
        for group, nodes, value, nodal, _ in self._compared(u):
            N, _ = tabulate(group.element.shape, group.rule)
            yield group, N @ nodal[nodes] - value

    def squared_errors(self, u: Array, n_elements: int) -> tuple[Array, Array]:
        """Return ∫ (σ* - σ) : C⁻¹ : (σ* - σ) dV of each element, (m,) in J, of recovered and averaged σ*."""
        found = np.zeros((2, n_elements))
        for group, nodes, value, *nodal in self._compared(u):
            N, _ = tabulate(group.element.shape, group.rule)
            dV, S = volumes(self.points, group), floats(np.linalg.inv(group.material.C))
            for row, values in zip(found, nodal, strict=True):
                row[group.rows] = _products((values, value), (values, value), nodes, N, dV, S)
        return found[0], found[1]

    def _compared(self, u: Array) -> Iterator[tuple[ElementGroup, Ints, Array, Array, Array]]:
        """Yield each group, its nodes in the region, C ε at its points, and this recovered and averaged."""
        known = self._last[1] if self._last is not None and self._last[0] is u else []
        found = []
        for i, region in enumerate(self.regions):
            plain = [replace(group, prestress=None) for group in region.groups]
            values = [at_gauss(self.points, group, u) for group in plain]
            nodal = known[i] if known else region.at_nodes(self.points, values)
            averaged = region.averaged(values)
            found.append(nodal)
            for group, nodes, value in zip(plain, region.cells, values, strict=True):
                fine = _compared_at(group)
                yield fine, nodes, value if fine is group else at_gauss(self.points, fine, u), nodal, averaged
        self._last = u, found


def _compared_at(group: ElementGroup) -> ElementGroup:
    """Return a group with a rule for squared errors, where its stresses are known at any points."""
    shape = group.element.shape
    if group.rule.degree >= 2 * shape.degree or not group.element.inherits(*GEOMETRY, *STRAIN, "stress"):
        return group
    return replace(group, rule=rule_for(shape.cell, 2 * shape.degree))


def _joined(parts: Sequence[Array]) -> Array:
    """Return arrays one after another; a single one is not copied."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _products(
    first: tuple[Array, Array], second: tuple[Array, Array], nodes: Ints, N: Array, dV: Array, S: Array
) -> Array:
    """Return ∫ (N σ* - σ) : S : (N σ*' - σ') dV of each element, (m,), of two pairs of σ* and σ."""
    if module := kernels("recovery"):
        return module.products(*map(floats, (*first, *second)), as_rows(nodes), *map(floats, (N, dV, S)))
    one, other = (N @ nodal[nodes] - raw for nodal, raw in (first, second))
    return (((one @ S) * other).sum(axis=-1) * dV).sum(axis=1)


def _sum(values: Array, nodes: Ints, n: int) -> Array:
    """Return the sums at nodes (n, 6) of values (m, k, 6) of elements."""
    if module := kernels("recovery"):
        return module.summed(floats(values), as_rows(nodes), n)
    total = np.zeros((n, 6))
    add_nodal(total, nodes, values)
    return total


def _combined(table: Array, values: Array, rows: Numbers) -> Array:
    """Return rows (m, k) of values (n, c) combined by a table (s, k), as (m, s, c)."""
    if module := kernels("recovery"):
        return module.combined(floats(table), floats(values), as_rows(rows))
    return table @ values[rows]


def _from_points(table: Array, values: Array) -> Array:
    """Return values (m, g, c) at the points of each element combined by a table (s, g), as (m, s, c)."""
    m, g, c = values.shape
    return _combined(table, values.reshape(-1, c), np.arange(m * g, dtype=np.int32).reshape(m, g))
