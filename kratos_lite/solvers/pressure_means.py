"""Means of the pressures of elements around corner nodes, and in long cells around long edges.

Where cells are long, pressures that change sign from cell to cell along them have no mean at corner nodes,
though they move nodes along the cells as much as smooth ones: the cells around a long edge have it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.shapes import Shape
from kratos_lite.solvers.coarse_level import sides_of
from kratos_lite.typing import Array, Ints

if TYPE_CHECKING:
    from scipy.sparse import csr_array

LONG = 2.0
"""Length of a cell to its other lengths from which it is long."""


class Pressures(Protocol):
    """Elements, and the orthonormal polynomials of their pressures."""

    group: ElementGroup
    polynomials: Array
    """(m, r, r): by 1 and, where r is 4, x, y and z from the center over the root of the volume."""


@dataclass(eq=False)
class PressureMeans:
    """The means (p, c) of pressures around c places, over the root of the modulus there."""

    matrix: csr_array  # (p, c) sparse
    ends: Ints  # (c, 2) int, the ends of the edge of each place, or a node twice


def pressure_means(points: Array, parts: Sequence[Pressures], modulus: Array) -> PressureMeans:
    """Return the means of pressures; of polynomials up to the first degree around halves of long edges."""
    from scipy.sparse import coo_array

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
    points: Array, part: Pressures, chosen: Ints, axis: int, first: int
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


def _at_halves(points: Array, part: Pressures, chosen: Ints, axis: int) -> Array:
    """Return 1, x, y, z as of `Pressures` in the middle of the half of a cell at each corner, (m, k, r)."""
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
