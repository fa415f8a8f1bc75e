"""Hanging nodes: nodes of small elements that lie inside an edge or face of a larger neighbor.

The field stays continuous if it has there the value that the larger edge or face interpolates:
u_h = Σ N_a(ξ_h) u_a.  An independent node may hang itself, on an edge or face that is larger still.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from kratos_lite.errors import MeshError
from kratos_lite.mesh.blocks import Block, ranges, with_rows
from kratos_lite.mesh.centers import Centers, Keys, are_among, keys_of, sorted_keys, surroundings
from kratos_lite.shapes import Shape
from kratos_lite.shapes.faces import FACE_SHAPES, Line2, Line3
from kratos_lite.typing import Array, Ints, Mask, Rows

Hanging: TypeAlias = "tuple[Ints, Ints, Array, int]"
"""Hanging nodes (h,), their independents (h, k) and weights (k,), and `HangingNodes.around`."""


@dataclass(frozen=True, eq=False)
class HangingNodes:
    """Nodes whose displacement others interpolate, and the faces that meet without sharing their nodes."""

    nodes: Ints  # (h,) int, indices of the hanging nodes
    start: Ints  # (h + 1,) int, where the independents of each begin
    independents: Ints  # (k,) int, indices of the nodes of the larger edge or face, corners first
    weights: Array  # (k,) float, their shape functions at the hanging node
    around: Ints  # (h,) int, how many corners the hanging node is in the very middle of, or 0
    large: Keys  # keys of faces (`kratos_lite.mesh.centers.keys_of`): one large face for each small one
    small: Keys

    def __len__(self) -> int:
        return len(self.nodes)

    def __iter__(self) -> Iterator[tuple[int, Ints, Array]]:
        for node, first, last in zip(self.nodes.tolist(), self.start, self.start[1:], strict=False):
            yield node, self.independents[first:last], self.weights[first:last]

    def select(self, nodes: Ints, n_nodes: int) -> HangingNodes:
        """Return those of some nodes (a,), numbered by these, without other independents."""
        number = np.full(n_nodes, -1)
        number[nodes] = np.arange(len(nodes))
        owner = np.repeat(np.arange(len(self)), np.diff(self.start))
        there = number[self.nodes] >= 0
        kept = there[owner] & (number[self.independents] >= 0)
        counts = np.bincount(owner[kept], minlength=len(self))[there]
        return replace(
            self,
            nodes=number[self.nodes[there]],
            start=np.concatenate([[0], np.cumsum(counts)]),
            independents=number[self.independents[kept]],
            weights=self.weights[kept],
            around=self.around[there],
        )

    def interpolate(self, values: Array) -> Array:
        """Return nodal values (n, ...) in which hanging nodes take what their independents give them."""
        values = values.copy()
        for level in self._levels(len(values)):
            first, take = self._rows(level)
            weights = self.weights[take].reshape(-1, *[1] * (values.ndim - 1))
            values[self.nodes[level]] = np.add.reduceat(weights * values[self.independents[take]], first)
        return values

    def gather(self, forces: Array) -> Array:
        """Return nodal forces (n, ...) with those on hanging nodes passed on to their independents."""
        forces = forces.copy()
        by_axis = forces.reshape(len(forces), -1).T
        for level in reversed(self._levels(len(forces))):
            first, take = self._rows(level)
            count = np.diff(np.append(first, len(take)))
            for along in by_axis:  # `bincount` sums numbers faster than `add.at` sums rows
                passed_on = self.weights[take] * np.repeat(along[self.nodes[level]], count)
                along[:] += np.bincount(self.independents[take], passed_on, len(along))
                along[self.nodes[level]] = 0.0
        return forces

    def _levels(self, n: int) -> list[Ints]:
        """Return the hanging nodes that depend on none, then those that hang on these, and so on."""
        owner = np.repeat(np.arange(len(self)), np.diff(self.start))
        hangs, waiting, levels = np.zeros(n, dtype=bool), np.arange(len(self)), []
        hangs[self.nodes] = True
        while len(waiting):
            hang_too = np.bincount(owner[hangs[self.independents]], minlength=len(self))[waiting] > 0
            if hang_too.all():
                raise MeshError("hanging nodes hang on each other in a circle; a mesh has them from `refine`")
            levels.append(waiting[~hang_too])
            hangs[self.nodes[levels[-1]]] = False
            waiting = waiting[hang_too]
        return levels

    def _rows(self, chosen: Ints) -> tuple[Ints, Ints]:
        """Return where the independents of some hanging nodes begin, one after the other, and these."""
        count = np.diff(self.start)[chosen]
        return np.cumsum(count) - count, ranges(self.start[chosen], count)


CHILDREN = {
    ("line", -1): ((0, 2), (1, 2)),
    ("triangle", -1): ((3, 4), (4, 5), (5, 3), (0, 3, 5), (1, 4, 3), (2, 5, 4), (3, 4, 5)),
    ("quadrilateral", -1): (
        *((4, 8), (5, 8), (6, 8), (7, 8)),
        *((0, 4, 8, 7), (1, 5, 8, 4), (2, 6, 8, 5), (3, 7, 8, 6)),
    ),
    ("quadrilateral", 0): ((4, 6), (0, 4, 6, 3), (4, 1, 2, 6)),
    ("quadrilateral", 1): ((5, 7), (1, 5, 7, 0), (5, 2, 3, 7)),
}
"""The smaller edges and faces inside a split edge or face, by its cell and `Split.half`.

They are columns of the corners, then the middles of the edges, then the middle.
"""


@dataclass(frozen=True, eq=False)
class Split:
    """Edges or faces of elements whose middle is a corner of smaller elements."""

    shape: type[Shape]  # of the edge or face
    nodes: Ints  # (k, n) int
    middles: Ints  # (k, e) int, nodes in the middle of its edges, then, of four corners, in its own
    elements: Ints  # (k,) int, element of each
    # 0 or 1 of four-sided faces that are halved, across the edges `half` and `half` + 2; else -1
    half: int = -1

    @property
    def corners(self) -> Ints:
        """(k, c) int, the corners."""
        return self.nodes[:, : self.shape.corners]

    @property
    def _columns(self) -> list[list[int]]:
        return [list(columns) for columns in CHILDREN[self.shape.cell, self.half]]

    def children(self) -> list[Ints]:
        """Return the corners (k, 2), (k, 3) or (k, 4) of the smaller edges and faces inside."""
        nodes = np.column_stack([self.corners, self.middles])
        return [nodes[:, columns] for columns in self._columns]

    def hanging(self, centers: Centers) -> Iterator[Hanging]:
        """Yield the nodes in its middle and in those of its children that are not its own."""
        shape, corners = self.shape, self.shape.nodes[: self.shape.corners]
        middles = corners[np.array(shape.edges or ((0, 1),))].mean(axis=1)
        places = np.vstack([corners, middles, corners.mean(axis=0)])
        candidates = []
        if self.half < 0 and shape.cell != "triangle":
            candidates.append((self.middles[:, -1], corners.mean(axis=0), shape.corners))
        if len(shape.nodes) > shape.corners:
            for child, columns in zip(self.children(), self._columns, strict=True):
                candidates.append((centers.find(centers.middle(child)), places[columns].mean(axis=0), 0))
        for nodes, xi, around in candidates:
            there = nodes >= 0
            if there.any() and np.abs(shape.nodes - xi).max(axis=1).min() > 1e-9:
                yield nodes[there], self.nodes[there], shape.N(xi), around


def split_edges(blocks: Sequence[Block], centers: Centers, corner: Mask) -> Iterator[Split]:
    """Yield the edges of elements that are split; `corner` (n,) says which nodes are corners of elements."""
    for block, at in with_rows(blocks):
        shape = block.shape
        if shape is None or not len(block) or not shape.edges:
            continue
        beside = _beside_smaller(block, corner)
        pairs = block.nodes[beside][:, np.array(shape.edges)].astype(np.int64)
        middle = centers.find(centers.middle(pairs))
        cell, edge = np.nonzero((middle >= 0) & corner[middle])
        ends, m, cells = pairs[cell, edge], middle[cell, edge][:, None], at.start + beside[cell]
        if len(shape.nodes) > shape.corners:
            yield Split(Line3, np.column_stack([ends, m]), m, cells)
        else:
            yield Split(Line2, ends, m, cells)


def split_faces(blocks: Sequence[Block], centers: Centers, corner: Mask, existing: Keys) -> Iterator[Split]:
    """Yield likewise the faces that are split; `existing` are the keys of the edges of all elements."""
    for block, at in with_rows(blocks):
        shape = block.shape
        if shape is None or not len(block):
            continue
        beside = _beside_smaller(block, corner)
        cells_of_block = block.nodes[beside].astype(np.int64)
        for face in shape.faces:
            shape_of_face = FACE_SHAPES[len(face)]
            nodes = cells_of_block[:, list(face)]
            around = nodes[:, np.array(shape_of_face.edges)]
            middles = centers.find(centers.middle(around))
            ends = (middles >= 0) & corner[middles]
            whole = ends.all(axis=1)
            if shape_of_face.corners == 4:
                own = centers.find(centers.middle(nodes[:, :4]))
                whole &= (own >= 0) & corner[own]
                middles = np.column_stack([middles, own])
            cells = np.flatnonzero(whole)
            yield Split(shape_of_face, nodes[cells], middles[cells], at.start + beside[cells])
            for half in (0, 1) if shape_of_face.corners == 4 else ():
                cells = np.flatnonzero(ends[:, half] & ends[:, half + 2] & ~whole)
                if len(cells):
                    line = keys_of(middles[cells][:, [half, half + 2]])
                    cells = cells[are_among(line, existing)]
                yield Split(shape_of_face, nodes[cells], middles[cells], at.start + beside[cells], half)


def _beside_smaller(block: Block, corner: Mask) -> Ints:
    """Return the cells of a block that may have split edges: quadratic ones know the middles of theirs."""
    shape = block.known_shape
    middles = block.nodes[:, shape.corners : shape.corners + len(shape.edges)]
    if not middles.shape[1]:
        return np.arange(len(block))
    return np.flatnonzero(corner[middles].any(axis=1))


def hanging_nodes(blocks: Sequence[Block], centers: Centers, n_nodes: int) -> HangingNodes | None:
    """Return the hanging nodes of some elements, or None if there are none."""
    corner = is_corner(blocks, n_nodes)
    hanging: list[Hanging] = []
    large, small = [], []
    for edge in split_edges(blocks, centers, corner):
        hanging += edge.hanging(centers)
    existing = existing_keys(blocks)
    for face in split_faces(blocks, centers, corner, existing):
        inside = [keys_of(child) for child in face.children() if child.shape[1] > 2]
        cut = are_among(np.stack(inside), existing).all(axis=0)
        if not cut.any():
            continue
        coarse = Split(face.shape, face.nodes[cut], face.middles[cut], face.elements[cut], face.half)
        hanging += coarse.hanging(centers)
        large += [keys_of(coarse.corners)] * len(inside)
        small += [keys[cut] for keys in inside]
    return _joined(hanging, large, small) if hanging else None


def _joined(hanging: Sequence[Hanging], large: list[Keys], small: list[Keys]) -> HangingNodes:
    """Return hanging nodes, each once."""
    none = np.zeros(0, dtype=np.uint64)
    nodes = np.concatenate([nodes for nodes, *_ in hanging])
    counts = [np.full(len(nodes), len(weights)) for nodes, _, weights, _ in hanging]
    every = HangingNodes(
        nodes,
        np.concatenate([[0], np.cumsum(np.concatenate(counts))]),
        np.concatenate([independents.ravel() for _, independents, _, _ in hanging]),
        np.concatenate([np.tile(weights, len(nodes)) for nodes, _, weights, _ in hanging]),
        np.concatenate([np.full(len(nodes), around) for nodes, _, _, around in hanging]),
        np.concatenate([none, *large]),
        np.concatenate([none, *small]),
    )
    _, once = np.unique(nodes, return_index=True)
    start, take = every._rows(once)
    return replace(
        every,
        nodes=nodes[once],
        start=np.append(start, len(take)),
        independents=every.independents[take],
        weights=every.weights[take],
        around=every.around[once],
    )


def known_centers(blocks: Sequence[Block], hanging: HangingNodes | None, n_nodes: int) -> Centers:
    """Return the nodes in the middle of edges, faces and cells of a mesh, those that hang there too."""
    known: list[tuple[Ints | Rows, Ints | Rows]] = [
        (block.nodes[:, list(around)], block.nodes[:, node])
        for block in blocks
        if block.shape is not None and len(block)
        for node, around in enumerate(surroundings(block.shape), start=block.shape.corners)
    ]
    if hanging is not None:
        for size in (2, 4):
            chosen = np.flatnonzero(hanging.around == size)
            corners = hanging.independents[hanging.start[chosen][:, None] + np.arange(size)]
            known.append((corners, hanging.nodes[chosen]))
    return Centers(n_nodes, known)


def is_corner(blocks: Iterable[Block], n_nodes: int) -> Mask:
    """Return which nodes (n,) are corners of elements."""
    corner = np.zeros(n_nodes, dtype=bool)
    for block in blocks:
        if block.shape is not None:
            corner[block.nodes[:, : block.shape.corners]] = True
    return corner


def existing_keys(blocks: Iterable[Block]) -> Keys:
    """Return the keys of the edges and faces of elements, each once and in order."""
    return sorted_keys(*(entity_keys(block) for block in blocks if block.shape and block.shape.faces))


def entity_keys(block: Block) -> Keys:
    """Return the keys (m, e) of the edges and faces of the cells of a block."""
    shape = block.known_shape
    sets = [*shape.edges, *(face[: FACE_SHAPES[len(face)].corners] for face in shape.faces)]
    return np.stack([keys_of(block.nodes[:, list(columns)]) for columns in sets], axis=1)
