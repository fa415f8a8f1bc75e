"""Hanging nodes: nodes of small elements that lie inside an edge or face of a larger neighbor.

The field stays continuous if it has there the value that the larger edge or face interpolates:
u_h = Σ N_a(ξ_h) u_a.  An independent node may hang itself, on an edge or face that is larger still.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kratos_lite.errors import MeshError
from kratos_lite.mesh.blocks import NO_ROWS, Block, with_rows
from kratos_lite.mesh.centers import Centers, Keys, are_among, keys_of, sorted_keys
from kratos_lite.shapes import Shape
from kratos_lite.shapes.faces import FACE_SHAPES, Line3
from kratos_lite.typing import Array, Ints, Mask, Rows

NO_WEIGHTS: Array = np.zeros(0)


@dataclass(frozen=True, eq=False)
class HangingNodes:
    """Nodes whose displacement others interpolate, and the faces that meet without sharing their nodes.

    Attributes
    ----------
    nodes : (h,) int, rows of the hanging nodes.
    start : (h + 1,) int, where the independents of each begin.
    independents : (k,) int, rows of the nodes of the larger edge or face, corners first.
    weights : (k,) float, their shape functions at the hanging node.
    around : (h,) int, how many corners the hanging node is in the very middle of, or 0.
    large, small : keys of faces (`kratos_lite.mesh.centers.keys_of`): one large face for each small one.
    """

    nodes: Ints
    start: Ints
    independents: Ints
    weights: Array
    around: Ints
    large: Keys
    small: Keys

    def __len__(self) -> int:
        return len(self.nodes)

    def __iter__(self) -> Iterator[tuple[int, Ints, Array]]:
        for node, first, last in zip(self.nodes.tolist(), self.start, self.start[1:], strict=False):
            yield node, self.independents[first:last], self.weights[first:last]

    def select(self, nodes: Ints, n_nodes: int) -> HangingNodes:
        """Return those of some nodes (a,), numbered by these, without other independents."""
        if len(nodes) == n_nodes:
            return self
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
        for level in reversed(self._levels(len(forces))):
            first, take = self._rows(level)
            count = np.diff(np.append(first, len(take)))
            weights = self.weights[take].reshape(-1, *[1] * (forces.ndim - 1))
            passed_on = weights * np.repeat(forces[self.nodes[level]], count, axis=0)
            np.add.at(forces, self.independents[take], passed_on)
            forces[self.nodes[level]] = 0.0
        return forces

    def _levels(self, n: int) -> list[Ints]:
        """Return the hanging nodes that depend on none, then those that hang on these, and so on."""
        owner = np.repeat(np.arange(len(self)), np.diff(self.start))
        hangs, waiting, levels = np.zeros(n, dtype=bool), np.arange(len(self)), []
        hangs[self.nodes] = True
        while len(waiting):
            held = np.bincount(owner[hangs[self.independents]], minlength=len(self))[waiting] > 0
            if held.all():
                raise MeshError("hanging nodes hang on each other in a circle; a mesh has them from `refine`")
            levels.append(waiting[~held])
            hangs[self.nodes[levels[-1]]] = False
            waiting = waiting[held]
        return levels

    def _rows(self, chosen: Ints) -> tuple[Ints, Ints]:
        """Return where the independents of some hanging nodes begin, one after the other, and these."""
        count = np.diff(self.start)[chosen]
        first = np.cumsum(count) - count
        take = np.repeat(self.start[chosen] - first, count) + np.arange(int(count.sum()))
        return first, take


class _Found:
    """Hanging nodes as they are found."""

    def __init__(self) -> None:
        self.nodes: list[Ints] = [NO_ROWS]
        self.independents: list[Ints] = [NO_ROWS]
        self.weights: list[Array] = [NO_WEIGHTS]
        self.counts: list[Ints] = [NO_ROWS]
        self.around: list[Ints] = [NO_ROWS]

    def add(self, nodes: Ints, independents: Ints | Rows, weights: Array, around: int = 0) -> None:
        """Take up nodes (h,), -1 for none, with independents (h, k) and weights (k,)."""
        there = nodes >= 0
        count = int(there.sum())
        self.nodes.append(nodes[there])
        self.independents.append(independents[there].ravel().astype(np.int64))
        self.weights.append(np.tile(weights, count))
        self.counts.append(np.full(count, len(weights)))
        self.around.append(np.full(count, around))


@dataclass(frozen=True, eq=False)
class Split:
    """Edges or faces of elements whose middle is a corner of smaller elements.

    Attributes
    ----------
    shape : of the edge or face; None for an edge of two nodes, `Line3` for one of three.
    nodes : (k, n) int.
    middles : (k, e) int, nodes in the middle of its edges, then, of four corners, in its own.
    rows : (k,) int, element of each.
    half : 0 or 1 of four-sided faces that are halved, across the edges `half` and `half` + 2; else -1.
    """

    shape: type[Shape] | None
    nodes: Ints
    middles: Ints
    rows: Ints
    half: int = -1

    @property
    def corners(self) -> Ints:
        """(k, c) int, the corners."""
        return self.nodes[:, : 2 if self.shape in (None, Line3) else self.shape.corners]

    def parts(self) -> list[Ints]:
        """Return the corners (k, 2), (k, 3) or (k, 4) of the smaller edges and faces inside."""
        c, m = self.corners, self.middles
        n = c.shape[1]
        if n == 2:
            return [np.stack([c[:, i], m[:, 0]], axis=1) for i in (0, 1)]
        if n == 3:
            lines = [m[:, [i, (i + 1) % 3]] for i in range(3)]
            faces = [np.stack([c[:, i], m[:, i], m[:, i - 1]], axis=1) for i in range(3)]
            return [*lines, *faces, m]
        if self.half >= 0:
            one, other = m[:, self.half], m[:, self.half + 2]
            ends = [c[:, (self.half + i) % 4] for i in range(4)]
            return [
                np.stack([one, other], axis=1),
                np.stack([ends[0], one, other, ends[3]], axis=1),
                np.stack([one, ends[1], ends[2], other], axis=1),
            ]
        lines = [m[:, [i, 4]] for i in range(4)]
        return [*lines, *(np.stack([c[:, i], m[:, i], m[:, 4], m[:, (i + 3) % 4]], axis=1) for i in range(4))]


def split_edges(blocks: Sequence[Block], centers: Centers, corner: Mask) -> Iterator[Split]:
    """Yield the edges of elements that are split; `corner` (n,) says which nodes are corners of elements."""
    for block, at in with_rows(blocks):
        shape = block.shape
        if shape is None or not len(block) or not shape.edges:
            continue
        pairs = block.nodes[:, np.array(shape.edges)].astype(np.int64)
        middle = centers.find(keys_of(pairs))
        cell, edge = np.nonzero((middle >= 0) & corner[middle])
        found, m = pairs[cell, edge], middle[cell, edge][:, None]
        if len(shape.nodes) > shape.corners:
            yield Split(Line3, np.column_stack([found, m]), m, at.start + cell)
        else:
            yield Split(None, found, m, at.start + cell)


def split_faces(blocks: Sequence[Block], centers: Centers, corner: Mask, existing: Keys) -> Iterator[Split]:
    """Yield likewise the faces that are split; `existing` are the keys of the edges of all elements."""
    for block, at in with_rows(blocks):
        shape = block.shape
        if shape is None or not len(block):
            continue
        for face in shape.faces:
            kind = FACE_SHAPES[len(face)]
            nodes = block.nodes[:, list(face)].astype(np.int64)
            around = nodes[:, np.array(kind.edges)]
            middles = centers.find(keys_of(around))
            ends = (middles >= 0) & corner[middles]
            if kind.corners == 3:
                cells = np.flatnonzero(ends.all(axis=1))
                yield Split(kind, nodes[cells], middles[cells], at.start + cells)
                continue
            own = centers.find(keys_of(nodes[:, :4]))
            quartered = ends.all(axis=1) & (own >= 0) & corner[own]
            cells = np.flatnonzero(quartered)
            middles = np.column_stack([middles, own])
            yield Split(kind, nodes[cells], middles[cells], at.start + cells)
            for half in (0, 1):
                cells = np.flatnonzero(ends[:, half] & ends[:, half + 2] & ~quartered)
                if len(cells):
                    line = keys_of(middles[cells][:, [half, half + 2]])
                    cells = cells[are_among(line, existing)]
                yield Split(kind, nodes[cells], middles[cells], at.start + cells, half)


def hanging_nodes(blocks: Sequence[Block], centers: Centers, n_nodes: int) -> HangingNodes | None:
    """Return the hanging nodes of some elements, or None if there are none."""
    corner = is_corner(blocks, n_nodes)
    found, large, small = _Found(), [], []
    for edge in split_edges(blocks, centers, corner):
        _on_edges(edge, centers, found)
    existing = existing_keys(blocks)
    for face in split_faces(blocks, centers, corner, existing):
        if not len(face.rows):
            continue
        smaller = face.parts()
        inside = [keys_of(part) for part in smaller if part.shape[1] > 2]
        cut = are_among(np.stack(inside), existing).all(axis=0)
        if not cut.any():
            continue
        coarse = Split(face.shape, face.nodes[cut], face.middles[cut], face.rows[cut], face.half)
        _on_faces(coarse, centers, found)
        large += [keys_of(coarse.corners)] * len(inside)
        small += [keys[cut] for keys in inside]
    if not sum(map(len, found.nodes)):
        return None
    return _gathered(found, large, small)


def _gathered(found: _Found, large: list[Keys], small: list[Keys]) -> HangingNodes:
    nodes, counts = np.concatenate(found.nodes), np.concatenate(found.counts)
    none = np.zeros(0, dtype=np.uint64)
    every = HangingNodes(
        nodes,
        np.concatenate([[0], np.cumsum(counts)]),
        np.concatenate(found.independents),
        np.concatenate(found.weights),
        np.concatenate(found.around),
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


def _on_edges(edge: Split, centers: Centers, found: _Found) -> None:
    """Take up the nodes that hang on split edges."""
    if edge.shape is None:
        found.add(edge.middles[:, 0], edge.nodes, np.array([0.5, 0.5]), 2)
        return
    for half, xi in zip(edge.parts(), (-0.5, 0.5), strict=True):
        found.add(centers.find(keys_of(half)), edge.nodes, Line3.N([xi]))


def _on_faces(face: Split, centers: Centers, found: _Found) -> None:
    """Take up the nodes that hang inside split faces, not on their edges."""
    shape = face.shape
    assert shape is not None
    corners = shape.nodes[: shape.corners]
    middles = corners[np.array(shape.edges)].mean(axis=1)
    quadratic = len(shape.nodes) > shape.corners
    if shape.corners == 3:
        for i, line in enumerate(face.parts()[:3] if quadratic else ()):
            xi = (middles[i] + middles[(i + 1) % 3]) / 2
            found.add(centers.find(keys_of(line)), face.nodes, shape.N(xi))
        return
    if face.half >= 0:
        if quadratic:
            line, *halves = face.parts()
            middle = centers.find(keys_of(line))
            if len(shape.nodes) < 9:
                found.add(middle, face.nodes, shape.N(np.zeros(2)))
            for part, end in zip(halves, (-0.5, 0.5), strict=True):
                xi = end * np.eye(2)[face.half]
                found.add(centers.find(keys_of(part)), face.nodes, shape.N(xi))
        return
    if len(shape.nodes) < 9:
        found.add(face.middles[:, 4], face.nodes, shape.N(np.zeros(2)), 4)
    if quadratic:
        places = [*(middles / 2), *(corners / 2)]
        for part, xi in zip(face.parts(), places, strict=True):
            found.add(centers.find(keys_of(part)), face.nodes, shape.N(xi))


def known_centers(blocks: Sequence[Block], hanging: HangingNodes | None) -> Centers:
    """Return the nodes in the middle of edges, faces and cells of a mesh, those that hang there too."""
    centers = Centers(blocks)
    if hanging is not None:
        for around in (2, 4):
            chosen = np.flatnonzero(hanging.around == around)
            corners = hanging.independents[hanging.start[chosen][:, None] + np.arange(around)]
            centers.add(keys_of(corners), hanging.nodes[chosen])
        centers.sort()
    return centers


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
    shape = block.shape
    assert shape is not None
    sets = [*shape.edges, *(face[: FACE_SHAPES[len(face)].corners] for face in shape.faces)]
    return np.stack([keys_of(block.nodes[:, list(columns)]) for columns in sets], axis=1)
