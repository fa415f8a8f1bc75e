"""Nodal recovery: the nodal stresses and strains of results, polynomials fitted to patches of elements.

Coarse and curved meshes, and nodes on the surface, are where a polynomial cannot follow the samples of the
elements at its node: the mean of what it leaves of them, extrapolated to the node, is added.

Source: Zienkiewicz & Zhu, Int. J. Numer. Meth. Eng. 33 (1992) 1331-1364: superconvergent patch recovery.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, add_nodal, as_double
from kratos_lite.assembly.gauss_point_fields import at_gauss, volumes
from kratos_lite.assembly.nodal_extrapolation import extrapolation
from kratos_lite.assembly.patches import Patches, outer_corners, patches
from kratos_lite.assembly.polynomial_fit import Lists, Polynomials, Samples, as_rows, fit, lists
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.tables import tabulate
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.blocks import NO_ROWS
from kratos_lite.mesh.locate import Located
from kratos_lite.native import kernels
from kratos_lite.quadrature import Rule, hexahedron, rule_for
from kratos_lite.registry import remembered
from kratos_lite.shapes.base import at_points
from kratos_lite.typing import Array, Ints, Numbers


@dataclass(frozen=True, eq=False)
class Sampling:
    """Where the values of an element are taken, and what is fitted to them."""

    N: Array  # (s, k) shape functions at the samples
    from_gauss: Array | None  # (s, g) values there from those at the Gauss points; None where they are these
    to_nodes: Array  # (k, s) fraction of the residuals of the samples at nodes; (k, 1) of their mean
    degree: int  # of the polynomials
    means: bool  # whether means of elements are better than the samples, as far as they tell a polynomial

    @property
    def count(self) -> int:
        """How many samples an element has."""
        return len(self.N)


@remembered
def sampling(element: type[KinematicLinear], rule: Rule) -> Sampling:
    """Return how the values of an element class are sampled."""
    # Hexahedra of degree 2 have their most accurate stresses at 2 x 2 x 2 points (Barlow, Int. J. Numer.
    # Meth. Eng. 10 (1976) 243-251): trilinear functions are fitted to those at more Gauss points. In linear
    # hexahedra and wedges they lie at the center. One degree above that of the element is fitted elsewhere,
    # but not in tetrahedra, which have no such points; in these half of the residual belongs to the nodes,
    # and nothing of it in linear ones and linear pyramids.
    shape, T, points = element.shape, None, rule.points
    corner = shape.linear() or shape
    means = shape.degree == 1 and shape.cell in ("hexahedron", "wedge")
    if shape.cell == "hexahedron" and shape.degree > 1 and len(rule) > 8:
        points = hexahedron(degree=3).points
        at_gauss = at_points(corner.N, rule.points)
        weighted = at_gauss.T * rule.weights
        T = at_points(corner.N, points) @ np.linalg.solve(weighted @ at_gauss, weighted)
    N = at_points(shape.N, points)
    degree = shape.degree + (0 if means or shape.cell == "tetrahedron" else 1)
    at_nodes, at_samples = (at_points(corner.N, P) for P in (shape.nodes, points))
    to_nodes = at_nodes @ np.linalg.pinv(at_samples)
    to_nodes *= 0.0 if shape.degree == 1 else 0.5 if shape.cell == "tetrahedron" else 1.0
    return Sampling(N, T, np.ones((len(at_nodes), 1)) if means else to_nodes, min(degree, 3), means)


@dataclass(frozen=True, eq=False)
class Region:
    """Elements of one material, over which stresses are smooth."""

    groups: list[ElementGroup]  # its elements
    nodes: Ints  # (k,) their nodes, ascending
    cells: list[Ints]  # the nodes of each group, numbered 0 … k - 1
    patches: Patches  # of these

    def at_nodes(self, points: Array, values: Sequence[Array]) -> Array:
        """Return values at the nodes (k, 6) from those at the Gauss points of the groups (m, g, 6)."""
        ways = [sampling(group.element, group.rule) for group in self.groups]
        places, sampled = [], []
        for group, way, value in zip(self.groups, ways, values, strict=True):
            T = way.from_gauss
            places.append(_combined(way.N, points, group.nodes))
            sampled.append(value if T is None else _from_points(T, value))
        fitted = self._fitted(ways, places, sampled)
        residual = np.zeros((len(self.nodes), 6))
        for way, cells, *both in zip(ways, self.cells, places, sampled, strict=True):
            if not way.to_nodes.any():
                continue
            X, value = (_means(v) if way.means else v for v in both)
            at_nodes = fitted.residuals(X, value, way.to_nodes, cells, self.patches.of)
            residual += _sum(at_nodes, cells, len(residual))
        return fitted.at(points[self.nodes], self.patches.of) + residual / self.n_around[:, None]

    def _fitted(self, ways: list[Sampling], places: list[Array], sampled: list[Array]) -> Polynomials:
        """Return the polynomials of the patches, from places (m, s, 3) and values (m, s, 6) of the groups."""
        counts = np.repeat([way.count for way in ways], [len(group) for group in self.groups])
        X, values = _joined([v.reshape(-1, 3) for v in places]), _joined([v.reshape(-1, 6) for v in sampled])
        samples = Samples(X, values, np.concatenate([[0], counts.cumsum()]))
        degree = self._of_patches([way.degree for way in ways], np.minimum) + self.patches.wide
        means = self._of_patches([int(way.means) for way in ways], np.maximum)
        return fit(samples, self.patches.elements, self.patches.weights, degree, means)

    def _of_patches(self, values: Sequence[int], least: np.ufunc) -> Ints:
        """Return the least, or the largest, value of the groups in each patch."""
        elements = self.patches.elements
        if len(set(values)) == 1:
            return np.full(len(elements), values[0])
        every = np.repeat(values, [len(group) for group in self.groups])
        return np.asarray(least.reduceat(every[elements.entries], elements.start[:-1]))

    @cached_property
    def n_around(self) -> Ints:
        """The number of elements around each node."""
        return np.bincount(np.concatenate([c.ravel() for c in self.cells]), minlength=len(self.nodes))

    def averaged(self, values: Sequence[Array]) -> Array:
        """Return the same, extrapolated to the nodes of each element and averaged there."""
        total = np.zeros((len(self.nodes), 6))
        for group, cells, value in zip(self.groups, self.cells, values, strict=True):
            total += _sum(_from_points(extrapolation(group.element, group.rule), value), cells, len(total))
        return total / self.n_around[:, None]


_KNOWN: WeakKeyDictionary[Mesh, tuple[Ints, Ints, list[tuple[Ints, Patches]]]] = WeakKeyDictionary()
"""Material number and place in its region of each element, and nodes and patches of each region, by mesh."""


def _regions(mesh: Mesh, groups: Sequence[ElementGroup]) -> list[Region]:
    """Return the groups by material, with their patches, which a mesh keeps."""
    by_material: dict[int, list[ElementGroup]] = {}
    for group in groups:
        by_material.setdefault(id(group.material), []).append(group)
    parts = list(by_material.values())
    material, place = np.full(mesh.n_elements, -1), np.zeros(mesh.n_elements, dtype=np.int64)
    for i, part in enumerate(parts):
        rows = np.concatenate([group.rows for group in part])
        material[rows], place[rows] = i, np.arange(len(rows))
    known = _KNOWN.get(mesh)
    if known is None or not (np.array_equal(known[0], material) and np.array_equal(known[1], place)):
        outside, outer = outer_corners(mesh, material)
        patches_of = [_patches(mesh, part, outer[outside == i]) for i, part in enumerate(parts)]
        known = _KNOWN[mesh] = material, place, patches_of
    regions, number = [], np.zeros(mesh.n_nodes, dtype=np.int64)
    for part, (nodes, around) in zip(parts, known[2], strict=True):
        number[nodes] = np.arange(len(nodes))
        regions.append(Region(part, nodes, [number[group.nodes] for group in part], around))
    return regions


def _patches(mesh: Mesh, groups: list[ElementGroup], outer: Ints) -> tuple[Ints, Patches]:
    """Return nodes and patches of groups; `outer` are the corners of the faces on their surface."""
    used, on_surface = np.zeros(mesh.n_nodes, dtype=bool), np.zeros(mesh.n_nodes, dtype=bool)
    for group in groups:
        used[group.nodes] = True
    on_surface[outer] = True
    nodes, number = np.flatnonzero(used), np.cumsum(used) - 1
    blocks = [Block("", number[g.nodes], g.rows, 0 * g.rows, g.element.shape) for g in groups]
    hanging, leaders = NO_ROWS, Lists(np.zeros(1, dtype=np.int64), NO_ROWS)
    if mesh.hanging is not None:
        here = used[mesh.hanging.nodes]
        hanging = number[mesh.hanging.nodes[here]]
        every = Lists(mesh.hanging.start, mesh.hanging.independents).take(np.flatnonzero(here))
        kept = used[every.entries]
        leaders = lists(every.owner[kept], number[every.entries[kept]], len(hanging))
    return nodes, patches(blocks, mesh.points[nodes], on_surface[nodes], hanging, leaders)


class Recovery:
    """Recovered stresses and strains of a mesh, for any displacements."""

    def __init__(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> None:
        self.points, self.groups = mesh.points, list(groups)
        self.regions = _regions(mesh, groups)
        self._last: tuple[Array, list[Array]] | None = None  # displacements, and C ε at nodes

    def nodal(self, u: Array, *, stress: bool = True) -> Array:
        """Return recovered stresses with initial ones in Pa, or strains, at nodes (n, 6)."""
        total, count = np.zeros((len(self.points), 6)), np.zeros(len(self.points))
        for region, values in self.by_region(u, stress=stress):
            total[region.nodes] += values
            count[region.nodes] += 1
        return total / np.maximum(count, 1)[:, None]

    def by_region(self, u: Array, *, stress: bool = True) -> Iterator[tuple[Region, Array]]:
        """Yield each region with the values at its nodes (k, 6)."""
        free = stress and all(g.prestress is None and g.heating is None for g in self.groups)
        if free and self._last is not None and self._last[0] is u:
            yield from zip(self.regions, self._last[1], strict=True)
            return
        nodal = []
        for region in self.regions:
            values = [at_gauss(self.points, group, u, stress=stress) for group in region.groups]
            nodal.append(region.at_nodes(self.points, values))
            yield region, nodal[-1]
        if free:
            self._last = u, nodal

    def products(self, u: Array, z: Array, n_elements: int) -> tuple[Array, Array]:
        """Return ∫ (σ* - σ) : C⁻¹ : (σ* - σ)' dV of each element, (m,) in J, of two displacements (n, 3)."""
        # With recovered and with averaged σ*. Prestress is given and no part of the error. σ* is kept for the
        # first of them alone.
        energies, of_u = np.zeros((2, n_elements)), self._recovered(u)
        of_z = of_u if z is u else self._recovered(z, keep=False)
        for region, (values, nodal), (others, other_nodal) in zip(self.regions, of_u, of_z, strict=True):
            averaged = region.averaged(values)
            other_averaged = averaged if z is u else region.averaged(others)
            stars = (nodal, other_nodal), (averaged, other_averaged)
            for group, nodes, value, other in zip(region.groups, region.cells, values, others, strict=True):
                fine, N, dV, S = self._tables(group)
                raw = value if fine is group else at_gauss(self.points, fine, u)
                other_raw = raw if z is u else other if fine is group else at_gauss(self.points, fine, z)
                for row, (star, other_star) in zip(energies, stars, strict=True):
                    row[group.rows] = _products((star, raw), (other_star, other_raw), nodes, N, dV, S)
        return energies[0], energies[1]

    def _recovered(self, u: Array, keep: bool = True) -> list[tuple[list[Array], Array]]:
        """Return C ε at the points of the groups, and recovered at the nodes, of each region."""
        known = self._last[1] if self._last is not None and self._last[0] is u else None
        recovered = []
        for i, region in enumerate(self.regions):
            values = [at_gauss(self.points, group.without_initial, u) for group in region.groups]
            recovered.append((values, known[i] if known else region.at_nodes(self.points, values)))
        if keep:
            self._last = u, [nodal for _, nodal in recovered]
        return recovered

    def _tables(self, group: ElementGroup) -> tuple[ElementGroup, Array, Array, Array]:
        """Return a group without prestress and with a rule for squared errors, its N and volumes, and C⁻¹."""
        fine = _compared_at(group)
        N, _ = tabulate(fine.element.shape, fine.rule)
        inverse = as_double(np.linalg.inv(fine.material.C))
        volume = volumes(self.points, fine)  # for energies, so that factors of C divide it
        return fine, N, volume if fine.factors is None else volume / fine.factors[:, None], inverse


def recovered_at(recovery: Recovery, located: Located, u: Array, *, stress: bool = True) -> Array:
    """Return recovered stresses in Pa, or strains, (..., 6) at points, between nodes of one material."""
    out = np.zeros((*located.rows.shape, 6))
    for region, values in recovery.by_region(u, stress=stress):
        inside = np.isin(located.rows, np.concatenate([group.rows for group in region.groups]))
        if inside.any():
            nodal = np.zeros((len(located.mesh.points), 6))
            nodal[region.nodes] = values
            out[inside] = located[inside].interpolate(nodal)
    return out


def _compared_at(group: ElementGroup) -> ElementGroup:
    """Return a group with a rule for squared errors, where its stresses are known at any points."""
    shape = group.element.shape
    if group.rule.degree >= 2 * shape.degree or not group.element.has_standard_strain():
        return group
    return replace(group.without_initial, rule=rule_for(shape.cell, 2 * shape.degree))


def _joined(parts: Sequence[Array]) -> Array:
    """Return arrays one after another; a single one is not copied."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _products(
    first: tuple[Array, Array], second: tuple[Array, Array], nodes: Ints, N: Array, dV: Array, S: Array
) -> Array:
    """Return ∫ (N σ* - σ) : S : (N σ*' - σ') dV of each element, (m,), of two pairs of σ* and σ."""
    if module := kernels("recovery"):
        return module.products(
            *map(as_double, (*first, *second)), as_rows(nodes), *map(as_double, (N, dV, S))
        )
    one, other = (N @ nodal[nodes] - raw for nodal, raw in (first, second))
    return (((one @ S) * other).sum(axis=-1) * dV).sum(axis=1)


def _sum(values: Array, nodes: Ints, n: int) -> Array:
    """Return the sums at nodes (n, 6) of values (m, k, 6) of elements."""
    if module := kernels("recovery"):
        return module.summed(as_double(values), as_rows(nodes), n)
    total = np.zeros((n, 6))
    add_nodal(total, nodes, values)
    return total


def _combined(table: Array, values: Array, rows: Numbers) -> Array:
    """Return rows (m, k) of values (n, c) combined by a table (s, k), as (m, s, c)."""
    if module := kernels("recovery"):
        return module.combined(as_double(table), as_double(values), as_rows(rows))
    return table @ values[rows]


def _means(values: Array) -> Array:
    """Return the mean (m, 1, c) of values (m, s, c) in each element."""
    s = values.shape[1]
    return _from_points(np.full((1, s), 1 / s), values)


def _from_points(table: Array, values: Array) -> Array:
    """Return values (m, g, c) at the points of each element combined by a table (s, g), as (m, s, c)."""
    m, g, c = values.shape
    return _combined(table, values.reshape(-1, c), np.arange(m * g, dtype=np.int32).reshape(m, g))
