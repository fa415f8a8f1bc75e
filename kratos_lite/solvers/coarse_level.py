"""The linear elements inside a mesh of quadratic ones: the coarse level of a p-multigrid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.elements import (
    KinematicLinear,
    KinematicLinear3D4N,
    KinematicLinear3D5N,
    KinematicLinear3D6N,
    KinematicLinear3D8N,
)
from kratos_lite.records import record
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints, Rows

LINEAR: dict[type[Shape] | None, type[KinematicLinear]] = {
    element.shape: element
    for element in (KinematicLinear3D4N, KinematicLinear3D5N, KinematicLinear3D6N, KinematicLinear3D8N)
}
"""The linear element of each linear shape."""


@record(eq=False)
class LinearLevel:
    """The linear elements inside a mesh of quadratic ones, as the coarse level of a p-multigrid.

    Attributes
    ----------
    K : (3m, 3m) stiffness matrix of the linear elements on the corner nodes.
    nodes : (m,) int, row among all n nodes of each corner node.
    indptr, indices, weights : interpolation (n, m) from corner nodes to all nodes in rows (CSR).
    """

    K: BlockMatrix
    nodes: Ints
    indptr: Rows
    indices: Rows
    weights: Array


def linear_level(points: Array, groups: Sequence[ElementGroup]) -> LinearLevel | None:
    """Return stiffness and interpolation of the linear elements on the corners of `groups`.

    Elements that are linear already take part as they are.  Each other node takes the shape
    functions of the corners, at its reference place, in the first element that has it; what they
    interpolate is a linear field wherever cells are straight-sided.

    Parameters
    ----------
    points : (n, 3) float, m.
    groups : elements with these points.

    Returns
    -------
    The level, or None if all elements are linear or some have no linear element on their corners.
    """
    corners = [_corners(group.element.shape) for group in groups]
    if any(c is None for c in corners) or all(_is_linear(group.element.shape) for group in groups):
        return None
    number = np.full(len(points), -1, dtype=np.int32)
    for group, c in zip(groups, corners, strict=True):
        number[group.nodes[:, c]] = 0
    nodes = np.flatnonzero(number == 0)
    number[nodes] = np.arange(len(nodes))
    linear = [_linear(group, number[group.nodes[:, c]]) for group, c in zip(groups, corners, strict=True)]
    pattern = Pattern(len(nodes), [group.nodes for group in linear])
    K = assemble_stiffness(points[nodes], linear, pattern)
    return LinearLevel(K, nodes, *_interpolation(groups, linear, number))


def _corners(shape: type[Shape]) -> Ints | None:
    """Return the rows among the nodes of a shape that are the nodes of its linear element."""
    linear = shape.linear()
    if linear is None or linear not in LINEAR:
        return None
    same = np.abs(shape.nodes[None] - linear.nodes[:, None]).max(axis=2) < 1e-12
    return same.argmax(axis=1) if same.any(axis=1).all() else None


def _is_linear(shape: type[Shape]) -> bool:
    return len(shape.nodes) == shape.corners


def _linear(group: ElementGroup, nodes: Rows) -> ElementGroup:
    """Return the linear elements of a group on their corner nodes."""
    if _is_linear(group.element.shape):
        return ElementGroup(group.element, group.rule, group.material, nodes, group.rows)
    element = LINEAR[group.element.shape.linear()]
    return ElementGroup(element, element.rule, group.material, nodes, group.rows)


def _interpolation(
    groups: Sequence[ElementGroup], linear: Sequence[ElementGroup], number: Rows
) -> tuple[Rows, Rows, Array]:
    """Return rows (indptr, indices, weights) from corners to all nodes; `number` is that of each corner."""
    corners = np.flatnonzero(number >= 0)
    entries = [(corners, number[corners], np.ones(len(corners)))]
    missing = number < 0
    for group, inner in zip(groups, linear, strict=True):
        k = group.nodes.shape[1]
        first = np.full(len(number), -1)
        flat = group.nodes.ravel()
        first[flat[::-1]] = np.arange(len(flat))[::-1]  # the first element with a node is written last
        rows = np.flatnonzero((first >= 0) & missing)
        missing[rows] = False
        element, local = np.divmod(first[rows], k)
        N = inner.element.shape.N(group.element.shape.nodes)
        N = np.where(np.abs(N) < 1e-14, 0.0, N)[local]
        at, corner = np.nonzero(N)
        entries.append((rows[at], inner.nodes[element[at], corner], N[at, corner]))
    rows, columns, weights = (np.concatenate(part) for part in zip(*entries, strict=True))
    order = np.lexsort((columns, rows))
    indptr = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=len(number)))])
    return indptr.astype(np.int32), columns[order].astype(np.int32), weights[order]
