"""Topology: shared and outer faces, connected parts, and the orientation of faces and cells."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from kratos_lite.mesh.blocks import NO_ROWS, Block, ranges, with_rows
from kratos_lite.mesh.centers import Centers, Keys, keys_of, mixed
from kratos_lite.native import kernels
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints, Mask, Numbers, Rows

if TYPE_CHECKING:
    from kratos_lite.mesh.hanging import HangingNodes

Sets: TypeAlias = "tuple[Numbers, Sequence[Sequence[int]]]"
"""Cells (m, k), and columns of them: each tuple of columns makes up one set of nodes of each cell."""
FEW_SETS = 100
"""Up to this many no kernel needs to be loaded."""


def equal_sets(groups: Sequence[Sets]) -> tuple[Ints, Ints]:
    """Return pairs of equal sets of nodes, by number through groups, columns, cells; each with the next."""
    few = sum(len(cells) * len(columns) for cells, columns in groups) <= FEW_SETS
    compiled = None if few else kernels("mesh")
    if compiled is None:
        return _equal_keys(set_keys(groups))
    nodes = [np.ascontiguousarray(cells, dtype=np.int32) for cells, _ in groups]
    one, other = compiled.equal_sets(nodes, [_table(columns) for _, columns in groups])
    return one, other


def _table(columns: Sequence[Sequence[int]]) -> Rows:
    """Return tuples of columns as rows, filled up with -1."""
    table = np.full((len(columns), max(map(len, columns), default=0)), -1, dtype=np.int32)
    for row, picked in zip(table, columns, strict=True):
        row[: len(picked)] = picked
    return table


def set_keys(groups: Sequence[Sets]) -> Keys:
    """Return a number for each set: the sum of mixed numbers of its nodes, equal for equal sets."""
    highest = max((int(cells.max(initial=-1)) for cells, _ in groups), default=-1)
    key = mixed(np.arange(highest + 1, dtype=np.uint64))
    sums = [key[cells[:, list(picked)]].sum(axis=1) for cells, columns in groups for picked in columns]
    return np.concatenate([np.zeros(0, np.uint64), *sums])


def _equal_keys(keys: Keys) -> tuple[Ints, Ints]:
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    one, other = order[same], order[same + 1]
    in_order = np.argsort(one)
    return one[in_order], other[in_order]


def components(n: int, pairs: Ints) -> Ints:
    """Return the smallest member of the connected part of each of n members; pairs (p, 2) connect them."""
    compiled = kernels("mesh") if len(pairs) else None
    if compiled is not None:
        return compiled.components(n, np.ascontiguousarray(pairs, dtype=np.int64))
    labels = np.arange(n)
    while True:
        before = labels.copy()
        smallest = labels[pairs].min(axis=1)
        np.minimum.at(labels, pairs.ravel(), np.repeat(smallest, 2))
        # what a root has learnt reaches all that point to it
        np.minimum.at(labels, before, labels.copy())
        labels = labels[labels]
        if (labels == before).all():
            return labels


class Faces:
    """All faces of elements, through blocks, faces of a cell, cells; `one` and `other` meet."""

    def __init__(self, blocks: Sequence[Block], hanging: HangingNodes | None = None) -> None:
        self.blocks = list(blocks)
        self.one, self.other = equal_sets([(b.nodes, [corners(f) for f in faces_of(b)]) for b in blocks])
        self._n_equal = len(self.one)
        if hanging is not None and len(hanging.large):
            keys = np.concatenate([keys_of(b.nodes[:, corners(f)]) for b in blocks for f in faces_of(b)])
            order = np.argsort(keys, kind="stable")
            large, small = (
                order[np.searchsorted(keys, wanted, sorter=order)]
                for wanted in (hanging.large, hanging.small)
            )
            self.one, self.other = np.append(self.one, large), np.append(self.other, small)

    @cached_property
    def element(self) -> Ints:
        """Row of the element of each face."""
        rows = [np.tile(np.arange(at.start, at.stop), len(faces_of(b))) for b, at in with_rows(self.blocks)]
        return np.concatenate([NO_ROWS, *rows])

    def non_conforming(self) -> tuple[Ints, Ints]:
        """Return the pairs that have the same corners but not the same nodes."""
        if all(len(face) == len(corners(face)) for block in self.blocks for face in faces_of(block)):
            return NO_ROWS, NO_ROWS
        keys = set_keys([(block.nodes, faces_of(block)) for block in self.blocks])
        one, other = self.one[: self._n_equal], self.other[: self._n_equal]
        open_ = keys[one] != keys[other]
        return one[open_], other[open_]

    @cached_property
    def boundary(self) -> list[Block]:
        """Faces that belong to one element only, outward, one block per face shape.

        ``ids`` holds the row of the parent element.
        """
        alone = np.ones(sum(len(block) * len(faces_of(block)) for block in self.blocks), dtype=bool)
        alone[self.one] = alone[self.other] = False
        from kratos_lite.shapes.faces import FACE_SHAPES  # a quick start without

        by_size: dict[int, list[tuple[Rows, Ints]]] = {}
        start = 0
        for block, at in with_rows(self.blocks):
            for face in faces_of(block):
                cells = np.flatnonzero(alone[start : start + len(block)])
                start += len(block)
                chosen = block.nodes[cells][:, list(face)]
                by_size.setdefault(len(face), []).append((chosen, at.start + cells))
        faces = []
        for size, groups in by_size.items():
            nodes, parents = np.vstack([f for f, _ in groups]), np.concatenate([p for _, p in groups])
            shape = FACE_SHAPES[size]
            if len(parents):
                faces.append(Block(shape.__name__, nodes, parents, 0 * parents, shape))
        return faces

    @cached_property
    def _by_first_node(self) -> tuple[Ints, Ints, Rows]:
        """First nodes of the boundary faces in order, the faces in this order, and the nodes of each face."""
        width = max((block.nodes.shape[1] for block in self.boundary), default=1)
        columns = (np.minimum(np.arange(width), b.nodes.shape[1] - 1) for b in self.boundary)
        filled = [b.nodes[:, some] for b, some in zip(self.boundary, columns, strict=True)]
        nodes = np.vstack([np.zeros((0, width), dtype=np.int32), *filled])
        order = np.argsort(nodes[:, 0], kind="stable")
        return nodes[order, 0].astype(np.int64), order, nodes

    def among(self, rows: Ints, inside: Mask) -> Ints:
        """Return the boundary faces, through blocks, that have all their nodes in rows, `inside` (n,)."""
        first, order, nodes = self._by_first_node
        start = np.searchsorted(first, rows)
        faces = np.sort(order[ranges(start, np.searchsorted(first, rows, side="right") - start)])
        return faces[inside[nodes[faces]].all(axis=1)]

    @cached_property
    def _by_corners(self) -> dict[int, tuple[Rows, Centers]]:
        """Corners of the boundary faces that have so many, and which face has which."""
        tables = {}
        for c in (3, 4):
            outside = [b.nodes[:, :c] for b in self.boundary if b.known_shape.corners == c]
            tables[c] = np.vstack([np.zeros((0, c), dtype=np.int32), *outside]), Centers()
            tables[c][1].add(keys_of(tables[c][0]), np.arange(len(tables[c][0])))
            tables[c][1].sort()
        return tables

    def outward_signs(self, block: Block) -> Array:
        """Return +1 for faces whose nodes run counter-clockwise from outside, -1 for others, 0 inside."""
        c = block.known_shape.corners
        known, numbers = self._by_corners[c]
        corners = block.nodes[:, :c]
        match = numbers.find(keys_of(corners))
        signs = np.zeros(len(block))
        on = np.flatnonzero(match >= 0)
        other = known[match[on]]
        start = np.argmax(other == corners[on, :1], axis=1)
        following = np.take_along_axis(other, ((start + 1) % c)[:, None], axis=1)[:, 0]
        signs[on] = np.where(following == corners[on, 1], 1.0, -1.0)
        return signs


def faces_of(block: Block) -> tuple[tuple[int, ...], ...]:
    """Return the faces of the cells of a block as columns of its nodes."""
    return () if block.shape is None else block.shape.faces


def corners(face: tuple[int, ...]) -> tuple[int, ...]:
    """Return the corners of a face: the first three of a triangle, the first four of a quadrilateral."""
    return face[: 3 if len(face) in (3, 6) else 4]


# ---- orientation -----------------------------------------------------------------------------------


def mirror(shape: type[Shape]) -> Ints:
    """Return the node order of the mirror image of a cell: its reflection in r = s."""
    swapped = shape.nodes[:, [1, 0, 2]]
    distance = np.abs(swapped[:, None, :] - shape.nodes[None, :, :]).max(axis=2)
    return distance.argmin(axis=1)


def inverted(block: Block, points: Array) -> Mask:
    """Return a mask of the cells with det J < 0 at their centroid."""
    if block.shape is None or block.shape.nodes.shape[1] != 3:
        return np.zeros(len(block), dtype=bool)
    center = block.shape.nodes[: block.shape.corners].mean(axis=0)
    J = np.swapaxes(points[block.nodes], 1, 2) @ block.shape.dN(center)
    return np.linalg.det(J) < 0
