"""The linear elements inside a mesh of quadratic ones: the coarse level of a p-multigrid."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.kinematic_linear_3d4n import KinematicLinear3D4N
from kratos_lite.elements.kinematic_linear_3d5n import KinematicLinear3D5N
from kratos_lite.elements.kinematic_linear_3d6n import KinematicLinear3D6N
from kratos_lite.elements.kinematic_linear_3d8n import KinematicLinear3D8N
from kratos_lite.mesh.centers import surroundings
from kratos_lite.mesh.hanging import HangingNodes
from kratos_lite.shapes import Shape
from kratos_lite.solvers.plan import EXTREME, PER_EXTREME, PER_STRETCHED, STRETCHED
from kratos_lite.typing import Array, Csr, Ints, Rows

LINEAR: dict[type[Shape] | None, type[KinematicLinear]] = {
    element.shape: element
    for element in (KinematicLinear3D4N, KinematicLinear3D5N, KinematicLinear3D6N, KinematicLinear3D8N)
}
"""The linear element of each linear shape."""


@dataclass(eq=False)
class PCoarseLevel:
    """The linear elements inside a mesh of quadratic ones, as the coarse level of a p-multigrid."""

    assemble: Callable[[], BlockMatrix]  # makes K
    nodes: Ints  # (m,) the corner nodes that do not hang, among all n nodes
    indptr: Rows  # with indices and weights: interpolation (n, m) from these to all nodes (CSR)
    indices: Rows
    weights: Array
    halved: bool = False  # whether long cells are two linear ones each

    @cached_property
    def K(self) -> BlockMatrix:
        """The stiffness matrix (3m, 3m) of the linear elements on the corner nodes."""
        return self.assemble()

    @property
    def interpolation(self) -> Csr:
        """Weights (n, m) of the corner nodes at all nodes, where they are no blocks."""
        from scipy.sparse import csr_array

        shape = len(self.indptr) - 1, len(self.nodes)
        return csr_array((self.weights, self.indices, self.indptr), shape=shape)

    def with_springs(self, springs: Csr) -> PCoarseLevel:
        """Return the level of K with springs (3n, 3n) on all nodes."""
        from scipy.sparse import eye_array, kron

        P = kron(self.interpolation, eye_array(3))
        return replace(self, assemble=lambda: BlockMatrix.of(self.K.scipy().tocsr() + P.T @ springs @ P))

    def with_mass(self, nodal: Array) -> PCoarseLevel:
        """Return the level of K + M, with masses of all nodes (n,) lumped at the corners."""
        lumped: Array = self.interpolation.T @ nodal

        def assemble() -> BlockMatrix:
            A = BlockMatrix(self.K.data.copy(), self.K.indices, self.K.indptr)
            A.add_scalar(lumped, A.diagonal_blocks())
            return A

        return replace(self, assemble=assemble)


SAMPLE = 2000
"""Cells of a group that show whether it is stretched."""
RIGID = 100
"""Dependents of one degree of freedom, in ties of several directions, from which they are a rigid part."""
LONG = 3.0
"""Length of a cell to its second length from which its halves are the linear elements."""


@dataclass(eq=False)
class _Submesh:
    """Some elements of a group, and the linear ones in each of them."""

    group: ElementGroup
    element: type[KinematicLinear]
    cells: Ints
    """(s, c), the nodes of each linear element among those of an element."""


def p_coarse_level(
    points: Array, groups: Sequence[ElementGroup], hanging: HangingNodes | None = None, whole: bool = True
) -> PCoarseLevel | None:
    """Return stiffness and interpolation of the linear elements on the corners of `groups`.

    Elements that are linear already take part as they are.  Long ones are halved, unless they are few, as
    the nodes in their middle are far from their corners compared with the others, which no smoothing of
    single nodes makes up for.  Each other node takes the shape functions of the corners, at its
    reference place, in the first element that has it; what they interpolate is a linear field wherever
    cells are straight-sided.  In a partition, where the mesh is not `whole`, nothing is
    halved, and elements that are all linear make a level, too.
    """
    corners = [c for group in groups if (c := _corners(group.element.shape)) is not None]
    if len(corners) < len(groups) or (whole and not has_middle_nodes(groups)):
        return None
    halved = whole and hanging is None  # else a middle node would be a corner of smaller neighbors
    submeshes = [
        p for group, c in zip(groups, corners, strict=True) for p in _submeshes(points, group, c, halved)
    ]
    number = np.full(len(points), -1, dtype=np.int32)
    for part in submeshes:
        number[part.group.nodes[:, sorted(set(part.cells.ravel().tolist()))]] = 0
    nodes = np.flatnonzero(number == 0)
    number[nodes] = np.arange(len(nodes))
    linear = [_linear(part, cell, number) for part in submeshes for cell in part.cells]

    def assemble() -> BlockMatrix:
        return assemble_stiffness(points[nodes], linear, Pattern(len(nodes), [g.nodes for g in linear]))

    halves = any(len(part.cells) > 1 for part in submeshes)
    level = PCoarseLevel(assemble, nodes, *_interpolation(submeshes, number), halves)
    return level if hanging is None else _continuous(level, groups, number, hanging)


def has_middle_nodes(groups: Sequence[ElementGroup]) -> bool:
    """Return whether some elements have nodes beside their corners."""
    return not all(_is_linear(group.element.shape) for group in groups)


def has_corners(groups: Sequence[ElementGroup]) -> bool:
    """Return whether all elements have linear ones on their corners."""
    return all(_corners(group.element.shape) is not None for group in groups)


def is_stretched(points: Array, groups: Sequence[ElementGroup]) -> bool:
    """Return whether, of some elements of each group, one of 20 is long or flat, or one of 200 extremely."""
    count = stretched = extreme = 0
    for group in groups:
        linear = group.element.shape.linear() or group.element.shape
        sample: Ints = np.arange(len(group))
        if len(sample) > SAMPLE:  # places that no order of the cells repeats: golden section
            sample = (0.6180339887498949 * sample[:SAMPLE] % 1 * len(sample)).astype(np.int64)
        corners = points[group.nodes[sample, : linear.corners]]
        sides = sides_of(linear, corners)
        count += len(sides)
        long, short = sides.max(axis=1), sides.min(axis=1)
        stretched += int(np.count_nonzero(long > STRETCHED * short))
        extreme += int(np.count_nonzero(long > EXTREME * short))
    return PER_STRETCHED * stretched > count or PER_EXTREME * extreme > count


def sides_of(shape: type[Shape], nodes: Array) -> Array:
    """Return the lengths (m, 3) of elements along their axes, at the center; nodes (m, k, 3) in m."""
    center, extent = shape.nodes.mean(axis=0), np.ptp(shape.nodes, axis=0)
    return extent * np.linalg.norm(np.swapaxes(nodes, 1, 2) @ shape.dN(center), axis=1)


def _corners(shape: type[Shape]) -> Ints | None:
    """Return which nodes of a shape are those of its linear element."""
    linear = shape.linear()
    if linear is None or linear not in LINEAR:
        return None
    same = np.abs(shape.nodes[None] - linear.nodes[:, None]).max(axis=2) < 1e-12
    return same.argmax(axis=1) if same.any(axis=1).all() else None


def _is_linear(shape: type[Shape]) -> bool:
    return len(shape.nodes) == shape.corners


def _submeshes(points: Array, group: ElementGroup, corners: Ints, halved: bool) -> list[_Submesh]:
    """Return the elements of a group that are not long, and those long along each axis, with their halves."""
    shape = group.element.shape
    if _is_linear(shape):
        return [_Submesh(group, group.element, corners[None])]
    element, along = LINEAR[shape.linear()], np.full(len(group), -1)
    cells = [*(_halves(shape, corners, axis) for axis in range(3) if halved), corners[None]]
    if any(len(ends) > 1 for ends in cells):
        sides = sides_of(element.shape, points[group.nodes[:, corners]])
        order = np.sort(sides, axis=1)
        long = order[:, 2] > LONG * order[:, 1]
        if 2 * np.count_nonzero(long) >= len(long):  # a few come apart from their neighbors, which takes more
            along[long] = sides[long].argmax(axis=1)
    return [_Submesh(group.take(along == axis), element, cells[axis]) for axis in sorted(set(along.tolist()))]


def _halves(shape: type[Shape], corners: Ints, axis: int) -> Ints:
    """Return the corners of the two halves of a cell along an axis; of the cell if it has no nodes there."""
    ends = shape.nodes[corners]
    middle = ends.copy()
    middle[:, axis] = (ends[:, axis].min() + ends[:, axis].max()) / 2
    same = np.abs(shape.nodes[None] - middle[:, None]).max(axis=2) < 1e-12
    if not same.any(axis=1).all():
        return corners[None]
    between, low = same.argmax(axis=1), ends[:, axis] < middle[:, axis]
    return np.array([np.where(low, corners, between), np.where(low, between, corners)])


def _linear(part: _Submesh, cell: Ints, number: Rows) -> ElementGroup:
    """Return one linear element of each element of a part, on numbered corners."""
    same = part.element is part.group.element
    rule = part.group.rule if same else part.element.rule
    nodes, factors = number[part.group.nodes[:, cell]], part.group.factors
    return ElementGroup(part.element, rule, part.group.material, nodes, part.group.rows, factors=factors)


def _weights(part: _Submesh) -> Array:
    """Return the interpolation (k, k) from the nodes of linear elements to all nodes of an element."""
    shape = part.element.shape
    nodes, low, high = part.group.element.shape.nodes, shape.nodes.min(axis=0), shape.nodes.max(axis=0)
    weights = np.zeros((len(nodes), len(nodes)))
    for cell in part.cells:
        ends = nodes[cell]
        start, end = ends.min(axis=0), ends.max(axis=0)
        local = low + (high - low) * (nodes - start) / (end - start)
        inside = (np.abs(2 * local - low - high) < high - low + 1e-9).all(axis=1)
        weights[np.ix_(inside, cell)] = shape.N(local[inside])
    weights[np.abs(weights) < 1e-14] = 0.0
    return weights


def _interpolation(submeshes: Sequence[_Submesh], number: Rows) -> tuple[Rows, Rows, Array]:
    """Return rows (indptr, indices, weights) from corners to all nodes; `number` is that of each corner."""
    owner, counts = np.full(len(number), -1), (number >= 0).astype(np.int64)
    blocks = []
    for part in submeshes:
        group, N = part.group, _weights(part)
        k = group.nodes.shape[1]
        first = np.full(len(number), -1)
        flat = group.nodes.ravel()
        first[flat[::-1]] = np.arange(len(flat))[::-1]  # the first element with a node is written last
        nodes = np.flatnonzero((first >= 0) & (number < 0) & (owner < 0))
        owner[nodes], local = np.divmod(first[nodes], k)
        for node in range(k):
            same, corners = nodes[local == node], np.flatnonzero(N[node])
            if len(same):
                counts[same] = len(corners)
                blocks.append((same, number[group.nodes[owner[same]][:, corners]], N[node, corners]))
    indptr = np.concatenate([[0], np.cumsum(counts)])
    indices, weights = np.empty(indptr[-1], dtype=np.int32), np.ones(indptr[-1])
    indices[indptr[:-1][number >= 0]] = number[number >= 0]
    for nodes, columns, N in blocks:
        at = indptr[nodes][:, None] + np.arange(len(N))
        order = columns.argsort(axis=1)
        indices[at], weights[at] = np.take_along_axis(columns, order, axis=1), N[order]
    return indptr.astype(np.int32), indices, weights


def _continuous(
    level: PCoarseLevel, groups: Sequence[ElementGroup], number: Rows, hanging: HangingNodes
) -> PCoarseLevel:
    """Return the level of continuous fields: corners in the middle of larger edges and faces follow these."""
    from scipy.sparse import csr_array

    n = len(number)
    at = np.repeat(np.arange(n), np.diff(level.indptr))
    rows, columns, weights = [at], [level.nodes[level.indices]], [level.weights]
    follows = np.zeros(n, dtype=bool)
    for nodes, leaders, factors in _followers(groups, number, hanging):
        new = ~follows[nodes]
        follows[nodes] = True
        rows.append(np.repeat(nodes[new], leaders.shape[1]))
        columns.append(leaders[new].ravel())
        weights.append(factors[new].ravel())
    kept = ~follows[at]
    rows[0], columns[0], weights[0] = rows[0][kept], columns[0][kept], weights[0][kept]
    entries = (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns)))
    S = csr_array(entries, shape=(n, n))
    nodes = level.nodes[~follows[level.nodes]]
    column = np.full(n, -1)
    column[nodes] = np.arange(len(nodes))
    while (column[S.indices[np.abs(S.data) > 1e-13]] < 0).any():  # who follows one that follows others
        S = S @ S
    S.data[np.abs(S.data) <= 1e-13] = 0.0
    S.eliminate_zeros()
    P = csr_array((S.data, column[S.indices], S.indptr), shape=(n, len(nodes)))

    return _on(level, nodes, P[level.nodes], P)


def _on(level: PCoarseLevel, nodes: Ints, inner: Any, P: Any) -> PCoarseLevel:
    """Return the level on some nodes, from which `inner` leads to its corner nodes and P to all nodes.

    Both have a weight, or a block of 3 x 3, for each pair of nodes.
    """
    from scipy.sparse import bsr_array, eye_array, kron

    def assemble() -> BlockMatrix:
        axes = inner if isinstance(inner, bsr_array) else kron(inner, eye_array(3)).tobsr((3, 3))
        return BlockMatrix.of(axes.T @ level.K.scipy() @ axes)

    P.sort_indices()
    return PCoarseLevel(
        assemble, nodes, P.indptr.astype(np.int32), P.indices.astype(np.int32), P.data, level.halved
    )


def apply_ties(level: PCoarseLevel, T: Any, free: Ints) -> PCoarseLevel | None:
    """Return the level of fields that keep the ties of nodes.

    Without it the linear elements of both sides come apart.  Corner nodes that depend on others than corner
    nodes leave the level as it is; but None for rigid parts, which it would hold at rest.
    """
    from scipy.sparse import bsr_array, csr_array, diags_array, eye_array, kron

    n, m = T.shape[0] // 3, len(level.nodes)
    entries = T.tocoo()
    column = free[entries.col]
    dependent = np.zeros((n, 3), dtype=bool)
    dependent.flat[entries.row] = True
    dependent.flat[free] = False
    is_dependent = np.asarray(dependent.any(axis=1))
    if not is_dependent[level.nodes].any():
        return level  # as with hanging nodes, which the level omits
    corner = np.full(n, -1)
    corner[level.nodes] = np.arange(m)
    of_corners = dependent.flat[entries.row] & (corner[entries.row // 3] >= 0)
    row, column, data = entries.row[of_corners], column[of_corners], entries.data[of_corners]
    W = level.interpolation
    by_axis = [
        csr_array((data[at], (row[at] // 3, column[at] // 3)), shape=(n, n))
        for at in (row % 3 == axis for axis in range(3))
    ]
    if all(abs(by_axis[0] - other).nnz == 0 for other in by_axis[1:]) and (row % 3 == column % 3).all():
        inner = diags_array(1.0 * ~is_dependent[level.nodes]) + (by_axis[0] @ W)[level.nodes]
        return _on(level, level.nodes, inner, (W @ inner).tocsr())
    if (corner[column // 3] < 0).any():
        return None if np.bincount(column).max() > RIGID else level
    at = tuple(3 * corner[dofs // 3] + dofs % 3 for dofs in (row, column))
    ties = csr_array((data, at), shape=(3 * m, 3 * m))
    blocks = bsr_array(diags_array(1.0 * ~dependent[level.nodes].ravel()) + ties, blocksize=(3, 3))
    return _on(level, level.nodes, blocks, kron(W, eye_array(3)).tobsr((3, 3)) @ blocks)


def _followers(
    groups: Sequence[ElementGroup], number: Rows, hanging: HangingNodes
) -> Iterator[tuple[Ints, Ints, Array]]:
    """Yield nodes (h,), each once, with the nodes (h, k) that they follow and the weights (h, k) of these."""
    counts = np.diff(hanging.start)
    for k in np.unique(counts):
        same = np.flatnonzero(counts == k)
        take = hanging.start[same][:, None] + np.arange(k)
        yield hanging.nodes[same], hanging.independents[take], hanging.weights[take]
    for group in groups:
        shape = group.element.shape
        around = () if _is_linear(shape) else surroundings(shape)
        for node, corners in enumerate(around, shape.corners):
            nodes, first = np.unique(group.nodes[:, node].astype(np.int64), return_index=True)
            inner = number[nodes] >= 0
            leaders = group.nodes[first[inner]][:, list(corners)].astype(np.int64)
            factors: Array = np.full(leaders.shape, 1 / len(corners))
            yield nodes[inner], leaders, factors
