"""K of nearly incompressible elements, split into their dilatations and a stiffness without most of them.

K = A + Dᵀ κ D, where D u are the dilatations that elements have, by orthonormal polynomials, κ is the bulk
modulus that is taken off the material, and A is the stiffness with the rest of it: λ = μ.

Pressures are known by their means around corner nodes.  Where cells are long, pressures that change sign from
cell to cell along them have none there, though they move nodes as much as smooth ones: they have means around
the long edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import cast

import numpy as np
from scipy.sparse import bsr_array, coo_array, diags_array

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import add_in_parts, assemble_stiffness
from kratos_lite.elements.formulations import NEAR_HALF, bulk_over_shear
from kratos_lite.elements.tables import tabulate
from kratos_lite.materials import LinearMaterial
from kratos_lite.shapes import Shape
from kratos_lite.shapes.inverse import cofactors
from kratos_lite.solvers.coarse_level import sides_of
from kratos_lite.typing import Array, Bsr, Csr, Ints, Progress

KEPT = 1.0
"""λ / μ that A keeps: pressures are better known the more it is, and multigrid is still as good."""


@dataclass(eq=False)
class SplitMatrix:
    """K = A + Dᵀ κ D, (3n, 3n) in N/m, which is only multiplied."""

    A: BlockMatrix  # the stiffness without most of the bulk modulus
    D: Bsr  # (p, 3n) orthonormal dilatations of elements, √m³ / m; R x 3 blocks, R = 1 or 4
    bulk: Array  # (p,) Pa, κ
    kept: Array  # (p,) Pa, λ in A
    modulus: Array  # (p,) Pa, λ + 2μ in A
    means: PressureMeans  # with λ + 2μ of the stiffest element at a node; λ = 0 where it is split
    groups: list[ElementGroup]  # the elements, with materials as in A

    @property
    def shape(self) -> tuple[int, int]:
        """The number of rows and columns."""
        return self.A.shape

    def __matmul__(self, x: Array) -> Array:
        """Return K x of a vector (3n,)."""
        return self.A @ x + self.D.T @ (self.bulk * (self.D @ x))

    def norm(self) -> float:
        """Return the largest row sum of |A| and |D|ᵀ κ |D|: no less than that of |K|."""
        size = abs(self.D.tocsr())
        return self.A.norm() + float((size.T @ (self.bulk * size.sum(axis=1))).max(initial=0.0))

    def scipy(self) -> Csr:
        """Return K as a scipy.sparse.csr_array."""
        D = self.D.tocsr()
        return (self.A.scipy().tocsr() + D.T @ diags_array(self.bulk) @ D).tocsr()


def assemble(
    points: Array, groups: Sequence[ElementGroup], pattern: Pattern, progress: Progress | None = None
) -> SplitMatrix:
    """Return the stiffness matrix of elements some of which are nearly incompressible."""
    elastic, soft, at_once, parts = list(groups), list(groups), list(groups), {}
    for number, group in enumerate(groups):
        if not is_split(group):
            continue
        bulk, shear = _moduli(group.material.C)
        part = _SplitGroup(group, bulk - (KEPT + 2 / 3) * shear, shear, *_dilatations(points, group))
        parts[number] = part
        elastic[number] = _softened(group, part.bulk)
        soft[number] = _softened(elastic[number], KEPT * shear)
        at_once[number] = elastic[number] if part.is_all() else group
    K = assemble_stiffness(points, at_once, pattern, progress)
    for number, part in parts.items():
        if not part.is_all():
            part.take_off(K, pattern, number)
    split = list(parts.values())
    bulks, shears = (
        np.concatenate([np.full(part.count, getattr(part, name)) for part in split])
        for name in ("bulk", "shear")
    )
    means = pressure_means(points, split, _stiffest(len(points), soft))
    D = _assembled(len(points), split)
    return SplitMatrix(K, D, bulks, KEPT * shears, (KEPT + 2) * shears, means, elastic)


def is_split(group: ElementGroup) -> bool:
    """Return whether the dilatations of a group are known and its material is nearly incompressible."""
    return group.has_dilatations and bulk_over_shear(group.material.C) > NEAR_HALF


@dataclass(eq=False)
class _SplitGroup:
    """A nearly incompressible group, and the dilatations of its elements."""

    group: ElementGroup
    bulk: float  # the bulk modulus taken off it
    shear: float
    D: Array  # (m, r, 3k), integrals with orthonormal polynomials
    polynomials: Array  # (m, r, r): by 1 and, if r is 4, x, y, z from the center over the root of the volume

    @property
    def count(self) -> int:
        return self.D.shape[0] * self.D.shape[1]

    def is_all(self) -> bool:
        """Return whether there are no other dilatations: without κ the stiffness is of a softer material."""
        tables = self.group.strain_tables()
        return tables is not None and tables.C is None and tables.fraction == 1.0

    def take_off(self, K: BlockMatrix, pattern: Pattern, number: int) -> None:
        """Subtract Dᵀ κ D from the matrix."""
        m, r, size = self.D.shape
        by_axis = self.D.reshape(m, r, size // 3, 3).swapaxes(-1, -2).reshape(m, r, size)

        def products(chunk: slice) -> Array:
            D = by_axis[chunk]
            return (-self.bulk * D.swapaxes(-1, -2) @ D).reshape(len(D), 3, size // 3, 3, size // 3)

        for _ in add_in_parts(K.data, self.group, pattern, number, products):
            pass


def _dilatations(points: Array, group: ElementGroup) -> tuple[Array, Array]:
    """Return integrals of dilatations with r orthonormal polynomials (m, r, 3k), and these (m, r, r)."""
    tables, (_, dN) = group.strain_tables(), tabulate(group.element.shape, group.rule)
    assert tables is not None
    linear = tables.C is None and tables.functions.shape[1] > 0
    derivatives, weights = np.swapaxes(dN, 1, 2).reshape(-1, dN.shape[1]), group.rule.weights
    dilatations, polynomials = [], []
    for chunk in group.chunks():
        elements = group.at(points, chunk)
        J = elements._jacobian(dN)
        normals = cofactors(J)
        dV = (J[..., 0] * normals[..., 0, :]).sum(axis=-1) * weights
        P = np.ones((*dV.shape, 1))
        if linear:
            length = np.cbrt(dV.sum(axis=1))[:, None, None]
            P = np.concatenate([P, tables.functions @ elements.X / length], axis=-1)
        polynomials.append(np.linalg.inv(np.linalg.cholesky(np.swapaxes(P * dV[..., None], 1, 2) @ P)))
        m, r = polynomials[-1].shape[:2]
        rows = np.einsum("mgr,mgji->mrigj", P, normals * weights[:, None, None]).reshape(m, 3 * r, -1)
        integrals = np.swapaxes((rows @ derivatives).reshape(m, r, 3, -1), 2, 3).reshape(m, r, -1)
        dilatations.append(polynomials[-1] @ integrals)
    return np.concatenate(dilatations), np.concatenate(polynomials)


def _moduli(C: Array) -> tuple[float, float]:
    """Return bulk and mean shear modulus of a C (6, 6)."""
    shear = float(C.diagonal()[3:].mean())
    return bulk_over_shear(C) * shear, shear


def _longitudinal(group: ElementGroup) -> float:
    """Return λ + 2μ of a group."""
    bulk, shear = _moduli(group.material.C)
    return bulk + 4 / 3 * shear


def _stiffest(n_nodes: int, groups: Sequence[ElementGroup]) -> Array:
    """Return the largest λ + 2μ of the elements at each node, (n,)."""
    modulus = np.ones(n_nodes)
    for group in sorted(groups, key=_longitudinal):
        modulus[group.nodes] = _longitudinal(group)
    return modulus


def _softened(group: ElementGroup, bulk: float) -> ElementGroup:
    """Return a group whose material has a smaller bulk modulus."""
    C = group.material.C.copy()
    C[:3, :3] -= bulk
    return replace(group, material=cast("LinearMaterial", SimpleNamespace(C=C)))


def _assembled(n_nodes: int, parts: Sequence[_SplitGroup]) -> Bsr:
    """Return D (p, 3n) of the dilatations of each group, a row of blocks for each element if they allow."""
    sizes = {part.D.shape[1] for part in parts}
    R = sizes.pop() if len(sizes) == 1 else 1
    blocks, columns, counts = [], [], []
    for part in parts:
        m, r, size = part.D.shape
        k = size // 3
        blocks.append(part.D.reshape(m, r // R, R, k, 3).swapaxes(2, 3).reshape(-1, R, 3))
        columns.append(np.repeat(part.group.nodes[:, None], r // R, axis=1).ravel())
        counts.append(np.full(m * r // R, k))
    starts = np.concatenate([[0], np.cumsum(np.concatenate(counts))]).astype(np.int32)
    data = np.concatenate(blocks), np.concatenate(columns).astype(np.int32), starts
    return bsr_array(data, shape=(R * (len(starts) - 1), 3 * n_nodes))


# ---- means of pressures --------------------

LONG = 2.0
"""Length of a cell to its other lengths from which it is long."""


@dataclass(eq=False)
class PressureMeans:
    """The means (p, c) of pressures around c places, over the root of the modulus there."""

    matrix: Csr  # (p, c) sparse
    ends: Ints  # (c, 2) int, the ends of the edge of each place, or a node twice


def pressure_means(points: Array, parts: Sequence[_SplitGroup], modulus: Array) -> PressureMeans:
    """Return the means of pressures; of polynomials up to the first degree around halves of long edges."""
    n, first, entries = len(points), 0, []
    for part in parts:
        along = _long_axes(points, part.group)
        for axis in np.unique(along):
            entries.append(_entries(points, part, np.flatnonzero(along == axis), int(axis), first))
        first += part.polynomials[..., 0].size
    keys, volumes, rows, owners, values = (np.concatenate(column) for column in zip(*entries, strict=True))
    edges, place = np.unique(keys[keys >= n], return_inverse=True)
    keys[keys >= n] = n + place
    nodes, pairs = np.arange(n), edges // 2 - n
    ends = np.column_stack([np.concatenate([nodes, pairs // n]), np.concatenate([nodes, pairs % n])])
    size = np.bincount(keys, volumes, len(ends)) * modulus[ends].max(axis=1)
    columns = keys[owners]
    matrix = coo_array((values / np.sqrt(size)[columns], (rows, columns)), shape=(first, len(ends)))
    return PressureMeans(matrix.tocsr(), ends)


def _long_axes(points: Array, group: ElementGroup) -> Ints:
    """Return the axis along which each element is long, -1 for none, (m,)."""
    shape = group.element.shape
    sides = sides_of(shape, points[group.nodes])
    order, axis = np.sort(sides, axis=1), sides.argmax(axis=1)
    edged = np.array([_partners(shape, a) is not None for a in range(3)])
    return np.where((order[:, 2] > LONG * order[:, 1]) & edged[axis], axis, -1)


def _partners(shape: type[Shape], axis: int) -> Ints | None:
    """Return the corner at the other end of the edge along an axis of each corner, if all have one."""
    corners = shape.nodes[: shape.corners]
    apart = np.abs(corners[:, None] - corners) > 1e-9
    edges = apart[..., axis] & ~np.delete(apart, axis, axis=-1).any(axis=-1)
    return edges.argmax(axis=1) if (edges.sum(axis=1) == 1).all() else None


def _entries(
    points: Array, part: _SplitGroup, chosen: Ints, axis: int, first: int
) -> tuple[Ints, Array, Ints, Ints, Array]:
    """Return places and volumes of corners, and rows, corners and values of the means of some elements."""
    shape, polynomials = part.group.element.shape, part.polynomials[chosen]
    corners = part.group.nodes[chosen, : shape.corners].astype(np.int64)
    (m, k), n, r = corners.shape, len(points), polynomials.shape[1]
    volumes = np.repeat(polynomials[:, 0, 0] ** -2 / k, k)
    partners = None if axis < 0 else _partners(shape, axis)
    if partners is None:
        keys, values = corners, np.repeat(polynomials[:, None, :1, 0], k, axis=1)
    else:
        ends = np.sort(np.stack([corners, corners[:, partners]]), axis=0)
        half = (corners == ends[1]) if r > 1 else 0
        keys = 2 * (n + n * ends[0] + ends[1]) + half
        values = _at_halves(points, part, chosen, axis) @ np.swapaxes(polynomials, 1, 2)
    degrees = values.shape[-1]
    rows = first + r * chosen[:, None, None] + np.arange(degrees)
    owners = np.repeat(np.arange(m * k), degrees)
    weighted = volumes[:, None] * values.reshape(-1, degrees)
    return keys.ravel(), volumes, np.broadcast_to(rows, (m, k, degrees)).ravel(), owners, weighted.ravel()


def _at_halves(points: Array, part: _SplitGroup, chosen: Ints, axis: int) -> Array:
    """Return 1, x, y, z as of `_SplitGroup` in the middle of the half of a cell at each corner, (m, k, r)."""
    shape, r = part.group.element.shape, part.polynomials.shape[1]
    ones = np.ones((len(chosen), shape.corners, 1))
    if r == 1:
        return ones
    center = shape.nodes.mean(axis=0)
    at = np.tile(center, (shape.corners, 1))
    at[:, axis] = (center[axis] + shape.nodes[: shape.corners, axis]) / 2
    length = np.cbrt(part.polynomials[chosen, :1, :1] ** -2)
    offsets = (shape.N(at) - shape.N(center)) @ points[part.group.nodes[chosen]] / length
    return np.concatenate([ones, offsets], axis=-1)
