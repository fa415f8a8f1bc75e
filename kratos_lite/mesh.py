"""Mesh: points, blocks of cells of one kind, and named parts.  It knows no physics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.errors import MeshError, nearest
from kratos_lite.shapes import FACE_SHAPES, Shape

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Where: TypeAlias = "str | Callable[[Floats], ArrayLike] | ArrayLike"
"""Nodes by part name, by a predicate on the points (n, 3), or by node rows or a mask."""
WhereElements: TypeAlias = "str | int | ArrayLike | None"
"""Elements by part name, by property id, by element rows, or all."""

SIDES = {letter + sign: (axis, end) for axis, letter in enumerate("xyz") for end, sign in enumerate("-+")}
"""Names of the sides of the bounding box: axis and end."""
NO_ROWS: Ints = np.zeros(0, dtype=np.int64)


@dataclass(eq=False)
class Block:
    """Cells of one kind: elements, or the conditions that carry loads.

    Attributes
    ----------
    name : kind as registered or as written in the file, e.g. ``KinematicLinear3D8N``.
    nodes : (m, k) int, rows of ``mesh.points``, in Kratos order.
    ids : (m,) int, ids of the cells.
    properties : (m,) int, property id of each cell.
    shape : the reference cell, or None for a kind that kratos_lite does not know.
    lines : (m,) int, line of each cell in the file it came from, or None.
    """

    name: str
    nodes: NDArray[np.int32]
    ids: Ints
    properties: Ints
    shape: type[Shape] | None
    lines: NDArray[np.int32] | None = None

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(eq=False)
class Part:
    """A named part (Kratos: SubModelPart): rows of nodes, elements and conditions.

    Element and condition rows count through all blocks in order.
    """

    nodes: Ints = field(default_factory=lambda: NO_ROWS)
    elements: Ints = field(default_factory=lambda: NO_ROWS)
    conditions: Ints = field(default_factory=lambda: NO_ROWS)
    geometries: Ints = field(default_factory=lambda: NO_ROWS)
    constraints: Ints = field(default_factory=lambda: NO_ROWS)
    properties: tuple[int, ...] = ()
    tables: tuple[int, ...] = ()
    data: dict[str, Any] = field(default_factory=dict)


class Mesh:
    """Points (n, 3) in m, element blocks, condition blocks and named parts.

    Parameters
    ----------
    points : (n, 3) float, m.
    blocks : element blocks.
    node_ids : (n,) int, ids of the nodes; 1 … n if not given.
    conditions : condition blocks.
    parts : named parts; a child of part ``A`` is named ``A.b``.
    source : name of the file it came from, used in messages.
    """

    def __init__(
        self,
        points: ArrayLike,
        blocks: Sequence[Block] = (),
        *,
        node_ids: ArrayLike | None = None,
        conditions: Sequence[Block] = (),
        parts: dict[str, Part] | None = None,
        source: str = "",
    ) -> None:
        self.points: Floats = np.ascontiguousarray(points, dtype=float)
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise MeshError(f"points must have shape (n, 3); got {self.points.shape}")
        n = len(self.points)
        ids = np.arange(1, n + 1) if node_ids is None else node_ids
        self.node_ids: Ints = np.asarray(ids, dtype=np.int64)
        if self.node_ids.shape != (n,):
            raise MeshError(f"node_ids must have shape ({n},); got {self.node_ids.shape}")
        self.blocks = list(blocks)
        self.conditions = list(conditions)
        self.parts = dict(parts or {})
        self.source = source

    # ---- sizes and ids ---------------------------------------------------------------------

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.points)

    @property
    def n_elements(self) -> int:
        """Number of elements in all blocks."""
        return sum(len(block) for block in self.blocks)

    @property
    def n_conditions(self) -> int:
        """Number of conditions in all blocks."""
        return sum(len(block) for block in self.conditions)

    @cached_property
    def element_ids(self) -> Ints:
        """(m,) element ids through all blocks in order."""
        return np.concatenate([NO_ROWS, *(block.ids for block in self.blocks)])

    @cached_property
    def _node_order(self) -> Ints:
        return np.argsort(self.node_ids, kind="stable")

    def node_rows(self, ids: ArrayLike) -> Ints:
        """Return the rows of `points` that carry these node ids; -1 where there is none."""
        ids = np.asarray(ids, dtype=np.int64)
        if self.n_nodes == 0:
            return np.full(ids.shape, -1, dtype=np.int64)
        if self.node_ids[0] == 1 and self.node_ids[-1] == self.n_nodes and self._is_counting:
            return np.where((ids >= 1) & (ids <= self.n_nodes), ids - 1, -1)
        order = self._node_order
        place = np.searchsorted(self.node_ids, ids, sorter=order)
        rows = order[np.minimum(place, self.n_nodes - 1)]
        return np.where(self.node_ids[rows] == ids, rows, -1)

    @cached_property
    def _is_counting(self) -> bool:
        return bool((np.diff(self.node_ids) == 1).all())

    def place(self, block: Block, cell: int) -> str:
        """Return a readable place of a cell for messages: ``cube.mdpa:22: element 1 (…3D8N)``."""
        line = f":{block.lines[cell]}" if block.lines is not None else ""
        where = f"{self.source}{line}: " if self.source else ""
        return f"{where}element {block.ids[cell]} ({block.name})"

    # ---- parts -----------------------------------------------------------------------------

    def part(self, name: str) -> Part:
        """Return a part by its full name, or by its last word when that is unique.

        ``x- x+ y- y+ z- z+`` mean the nodes on the sides of the bounding box where the mesh
        has no part of that name.
        """
        if name in self.parts:
            return self.parts[name]
        if name in SIDES and self.n_nodes:
            return Part(nodes=self._side(*SIDES[name]))
        ends = [full for full in self.parts if full.rsplit(".", 1)[-1] == name]
        if len(ends) == 1:
            return self.parts[ends[0]]
        if ends:
            raise MeshError(f"part {name!r} is not unique; write one of {', '.join(ends)}")
        have = ", ".join(self.parts) or "none"
        raise MeshError(
            f"there is no part {name!r}; have {have} and the sides x- … z+.{nearest(name, self.parts)}"
        )

    def _side(self, axis: int, end: int) -> Ints:
        x = self.points[:, axis]
        low, high = float(x.min()), float(x.max())
        goal = high if end else low
        return np.flatnonzero(np.abs(x - goal) <= 1e-6 * float(np.ptp(self.points, axis=0).max()))

    def nodes(self, where: Where) -> Ints:
        """Return the node rows of a part, of a predicate on the points, or of an array of rows.

        >>> mesh = Mesh([[0, 0, 0], [1, 0, 0]])
        >>> mesh.nodes(lambda X: X[:, 0] > 0.5)
        array([1])
        """
        if isinstance(where, str):
            return self.part(where).nodes
        chosen = np.asarray(where(self.points) if callable(where) else where)
        if chosen.dtype == bool:
            if chosen.shape != (self.n_nodes,):
                raise MeshError(f"a node mask must have shape ({self.n_nodes},); got {chosen.shape}")
            return np.flatnonzero(chosen)
        if chosen.dtype.kind not in "iu":
            raise MeshError("nodes are chosen by part name, predicate, mask or integer rows")
        rows = np.unique(chosen.astype(np.int64))
        if len(rows) and (rows[0] < 0 or rows[-1] >= self.n_nodes):
            raise MeshError(f"node rows must lie in 0 … {self.n_nodes - 1}; got {rows[0]} … {rows[-1]}")
        return rows

    def used_nodes(self) -> NDArray[np.bool_]:
        """Return a mask (n,) of the nodes that belong to an element."""
        used = np.zeros(self.n_nodes, dtype=bool)
        for block in self.blocks:
            used[block.nodes] = True
        return used

    def elements(self, where: WhereElements = None) -> Ints:
        """Return the element rows of a part, of a property id, of an array of rows, or of all.

        A part without elements of its own gives the elements that have all their nodes in it.
        """
        if where is None:
            return np.arange(self.n_elements)
        if isinstance(where, (int, np.integer)) and not isinstance(where, bool):
            ids = np.concatenate([NO_ROWS, *(block.properties for block in self.blocks)])
            rows = np.flatnonzero(ids == where)
            if not len(rows):
                raise MeshError(
                    f"no element has property {where}; the properties are {np.unique(ids).tolist()}"
                )
            return rows
        if isinstance(where, str):
            part = self.part(where)
            rows = part.elements if len(part.elements) else self._elements_among(part.nodes)
            if not len(rows):
                raise MeshError(f"part {where!r} has no elements")
            return rows
        rows = np.asarray(where)
        if rows.dtype.kind not in "iu" or rows.ndim != 1:
            raise MeshError("elements are chosen by part name, property id or an array of integer rows")
        if len(rows) and (rows.min() < 0 or rows.max() >= self.n_elements):
            raise MeshError(
                f"element rows must lie in 0 … {self.n_elements - 1}; got {rows.min()} … {rows.max()}"
            )
        return rows.astype(np.int64)

    def _elements_among(self, nodes: Ints) -> Ints:
        inside = np.zeros(self.n_nodes, dtype=bool)
        inside[nodes] = True
        return np.flatnonzero(
            np.concatenate([np.zeros(0, bool), *(inside[b.nodes].all(axis=1) for b in self.blocks)])
        )

    # ---- faces -----------------------------------------------------------------------------

    @cached_property
    def boundary(self) -> list[Block]:
        """Faces that belong to one element only, outward, one block per face shape.

        ``ids`` holds the row of the parent element.
        """
        by_size: dict[int, list[tuple[NDArray[np.int32], Ints]]] = {}
        start = 0
        for block in self.blocks:
            if block.shape is not None:
                parents = np.arange(start, start + len(block))
                for face in block.shape.faces:
                    by_size.setdefault(len(face), []).append((block.nodes[:, list(face)], parents))
            start += len(block)
        corners: list[NDArray[np.int32]] = []
        for size, groups in by_size.items():
            c = len(FACE_SHAPES[size].nodes) if size < 6 else FACE_SHAPES[size].corners
            corners += [
                np.sort(np.pad(f[:, :c], ((0, 0), (0, 4 - c)), constant_values=-1)) for f, _ in groups
            ]
        if not corners:
            return []
        _, inverse, counts = np.unique(np.vstack(corners), axis=0, return_inverse=True, return_counts=True)
        single = counts[inverse.ravel()] == 1
        faces, first = [], 0
        for size, groups in by_size.items():
            nodes = np.vstack([f for f, _ in groups])
            parents = np.concatenate([p for _, p in groups])
            keep = single[first : first + len(nodes)]
            first += len(nodes)
            shape = FACE_SHAPES[size]
            faces.append(Block(shape.__name__, nodes[keep], parents[keep], 0 * parents[keep], shape))
        return [block for block in faces if len(block)]

    def faces(self, where: Where) -> list[Block]:
        """Return the faces of a part: its conditions, or else the boundary faces among its nodes."""
        if isinstance(where, str) and len(rows := self.part(where).conditions):
            return select(self.conditions, rows)
        inside = np.zeros(self.n_nodes, dtype=bool)
        inside[self.nodes(where)] = True
        found = []
        for block in self.boundary:
            keep = inside[block.nodes].all(axis=1)
            if keep.any():
                found.append(
                    Block(block.name, block.nodes[keep], block.ids[keep], block.properties[keep], block.shape)
                )
        return found


def select(blocks: Sequence[Block], rows: Ints) -> list[Block]:
    """Return the cells with these rows (counted through all blocks), block by block."""
    chosen, start = [], 0
    for block in blocks:
        keep = rows[(rows >= start) & (rows < start + len(block))] - start
        start += len(block)
        if len(keep):
            lines = None if block.lines is None else block.lines[keep]
            chosen.append(
                Block(
                    block.name, block.nodes[keep], block.ids[keep], block.properties[keep], block.shape, lines
                )
            )
    return chosen
