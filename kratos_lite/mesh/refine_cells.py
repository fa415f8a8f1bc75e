"""CellRefiner: makes a finer mesh from a coarser one, cell by cell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from kratos_lite.elements import ELEMENTS
from kratos_lite.mesh.blocks import NO_ROWS, Block, with_rows
from kratos_lite.mesh.centers import Centers, Keys, corners_around, keys_of, surroundings
from kratos_lite.mesh.hanging import hanging_nodes
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.mesh.refined_mesh import RefinedMesh
from kratos_lite.mesh.subdivision import Child
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints

Target: TypeAlias = "Callable[[Block, str], tuple[str, type[Shape]]]"
"""Gives name and shape of the children of a block, by their family."""
Cut: TypeAlias = "tuple[Ints, Sequence[Child]]"
"""Some cells of a block, and the children that each is cut into."""
Cuts: TypeAlias = "Callable[[Block, slice], Sequence[Cut]]"
"""Gives the cuts of a block and its rows; other cells stay as they are."""


class _Cells:
    """Blocks of cells as they are made; those of one name and shape become one block."""

    def __init__(self, blocks: Sequence[Block]) -> None:
        self._parts: dict[tuple[str, type[Shape] | None, int], list[tuple[Block, Ints]]] = {}
        self._next_id = 1 + max((int(block.ids.max(initial=0)) for block in blocks), default=0)

    def add(self, block: Block, parents: Ints, *, new: bool = False) -> None:
        """Take up cells with the rows of those that they come from; new ones get ids of their own."""
        if new:
            ids = self._next_id + np.arange(len(block))
            self._next_id += len(block)
            block = Block(block.name, block.nodes, ids, block.properties, block.shape, block.lines)
        key = block.name, block.shape, block.nodes.shape[1]
        self._parts.setdefault(key, []).append((block, parents))

    def blocks(self) -> list[Block]:
        """Return the blocks."""
        return [_joined([block for block, _ in parts]) for parts in self._parts.values()]

    def parents(self) -> Ints:
        """Return the rows that all cells come from, in the order of the blocks."""
        return np.concatenate([NO_ROWS, *(rows for parts in self._parts.values() for _, rows in parts)])


def _joined(blocks: Sequence[Block]) -> Block:
    lines = [block.lines for block in blocks if block.lines is not None]
    return Block(
        blocks[0].name,
        np.concatenate([block.nodes for block in blocks]),
        np.concatenate([block.ids for block in blocks]),
        np.concatenate([block.properties for block in blocks]),
        blocks[0].shape,
        np.concatenate(lines) if len(lines) == len(blocks) else None,
    )


class CellRefiner:
    """A refined mesh while it is made."""

    def __init__(self, mesh: Mesh, centers: Centers, target: Target) -> None:
        self.mesh, self.centers, self.target = mesh, centers, target
        self._elements, self._conditions = _Cells(mesh.blocks), _Cells(mesh.conditions)
        self._sources: list[tuple[Ints, Array]] = []
        self._inside: list[Keys] = [np.zeros(0, dtype=np.uint64)]

    def _refine(self, blocks: Sequence[Block], into: _Cells, cuts: Cuts) -> None:
        for block, at in with_rows(blocks):
            cut = cuts(block, at)
            kept = np.ones(len(block), dtype=bool)
            for cells, _ in cut:
                kept[cells] = False
            if kept.any():
                into.add(block.take(kept), at.start + np.flatnonzero(kept))
            for cells, children in cut:
                self._cut(block, cells, at.start, children, into)

    def _cut(self, block: Block, cells: Ints, first: int, children: Sequence[Child], into: _Cells) -> None:
        """Take up the children of some cells of a block, whose first cell has the row `first`."""
        corners = self._corners(block, cells, children)
        for family in dict.fromkeys(child.cell for child in children):
            name, shape = self.target(block, family)
            chosen = [i for i, child in enumerate(children) if child.cell == family]
            nodes = np.stack([corners[i] for i in chosen], axis=1)
            if around := surroundings(shape):
                places = np.stack([children[i].places(shape)[shape.corners :] for i in chosen])
                keys = np.stack([self.centers.middle(nodes[:, :, list(among)]) for among in around], axis=2)
                middles = self._nodes(block, cells, keys, places.reshape(-1, places.shape[2]))
                nodes = np.concatenate([nodes, middles], axis=2)
            parents = np.repeat(cells, len(chosen))
            lines = None if block.lines is None else block.lines[parents]
            flat = nodes.reshape(len(parents), -1)
            made = Block(name, flat, block.ids[parents], block.properties[parents], shape, lines)
            into.add(made, first + parents, new=len(children) > 1)

    def _corners(self, block: Block, cells: Ints, children: Sequence[Child]) -> list[Ints]:
        """Return the corners (m, c) of each child of some cells."""
        family, old = block.known_shape.cell, block.nodes[cells].astype(np.int64)
        places = np.concatenate([child.corners for child in children])
        of_places = corners_around(family, places)
        at = dict(zip(of_places, places, strict=True))
        nodes: dict[tuple[int, ...], Ints] = {around: old[:, around[0]] for around in at if len(around) == 1}
        if inner := [around for around in at if len(around) > 1]:
            keys = np.stack([self.centers.middle(old[:, list(around)]) for around in inner], axis=1)
            middles = self._nodes(block, cells, keys, np.array([at[around] for around in inner]))
            nodes.update((around, middles[:, i]) for i, around in enumerate(inner))
        each = iter(of_places)
        return [np.stack([nodes[next(each)] for _ in child.corners], axis=1) for child in children]

    def _nodes(self, block: Block, cells: Ints, keys: Keys, places: Array) -> Ints:
        """Return the nodes of keys (m, ...) at places (p, d) in each cell; new ones are made."""
        shape = block.known_shape
        new = self.centers.make(keys.ravel())
        cell, place = np.divmod(new, len(places))
        nodes, weights = block.nodes[cells[cell]].astype(np.int64), shape.N(places)
        self._sources.append((nodes, np.where(np.abs(weights) < 1e-14, 0.0, weights)[place]))
        inside, around = np.zeros(len(new), dtype=np.uint64), corners_around(shape.cell, places)
        for i in np.flatnonzero(np.bincount(place, minlength=len(places))).tolist():
            chosen = place == i
            inside[chosen] = keys_of(nodes[chosen][:, list(around[i])])
        self._inside.append(inside)
        return self.centers.find(keys)

    def refined_mesh(self, elements: Cuts, conditions: Cuts) -> RefinedMesh:
        """Return the refined mesh by the cuts of elements and of conditions."""
        self._refine(self.mesh.blocks, self._elements, elements)
        self._refine(self.mesh.conditions, self._conditions, conditions)
        blocks, n = self._elements.blocks(), self.centers.n_nodes
        start, nodes, weights = _compressed(self._sources)
        old = self.mesh
        first = int(old.node_ids.max(initial=0)) + 1
        parents, inside = (self._elements.parents(), self._conditions.parents()), np.concatenate(self._inside)
        bare = RefinedMesh(old, old, *parents, start, nodes, weights, inside)
        mesh = Mesh(
            bare.interpolate(old.points),
            blocks,
            node_ids=np.concatenate([old.node_ids, first + np.arange(n - old.n_nodes)]),
            conditions=self._conditions.blocks(),
            parts={name: bare.part(part) for name, part in old.parts.items()},
            source=old.source,
            hanging=hanging_nodes(blocks, self.centers, n),
            units=old.units,
        )
        return replace(bare, mesh=mesh)


def _compressed(sources: Sequence[tuple[Ints, Array]]) -> tuple[Ints, Ints, Array]:
    """Return start, nodes and weights of rows (k, w) of nodes and weights, without zeros."""
    counts = [np.count_nonzero(weights, axis=1) for _, weights in sources]
    start = np.concatenate([[0], np.cumsum(np.concatenate([NO_ROWS, *counts]))])
    nodes = [nodes[weights != 0] for nodes, weights in sources]
    values = [weights[weights != 0] for _, weights in sources]
    return start, np.concatenate([NO_ROWS, *nodes]), np.concatenate([np.zeros(0), *values])


def name_of(name: str, shape: type[Shape]) -> str:
    """Return the name of the same family of elements or conditions with another shape."""
    stem = name.rstrip("N").rstrip("0123456789")
    wanted = f"{stem}{len(shape.nodes)}N"
    if name in ELEMENTS and wanted not in ELEMENTS:
        return f"KinematicLinear3D{len(shape.nodes)}N"
    return wanted
