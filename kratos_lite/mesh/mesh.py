"""Mesh: points, blocks and named parts, and how to choose among them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.errors import MeshError, nearest
from kratos_lite.mesh.blocks import (
    NO_ROWS,
    Block,
    Part,
    distinct,
    ids_of,
    rows_of_ids,
    select,
    without_repeats,
)
from kratos_lite.mesh.locate import Located, locate
from kratos_lite.mesh.topology import Faces, inverted, mirror
from kratos_lite.typing import Array, Ints, Mask, Rows

Where: TypeAlias = "str | Callable[[Array], ArrayLike] | ArrayLike"
"""Nodes by part name, by a predicate on the points (n, 3), or by node rows or a mask."""
WhereElements: TypeAlias = "str | int | ArrayLike | None"
"""Elements by part name, by property id, by element rows, or all."""

SIDES = {letter + sign: (axis, end) for axis, letter in enumerate("xyz") for end, sign in enumerate("-+")}
"""Names of the sides of the bounding box: axis and end."""


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

    Raises
    ------
    MeshError
        If points or ids have the wrong shape, an id occurs twice, or a part has rows that do not exist.
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
        try:
            self.points: Array = np.array(points, dtype=float, order="C")
        except (TypeError, ValueError):
            raise MeshError(f"points must be real numbers of shape (n, 3); got {points!r:.80}") from None
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise MeshError(f"points must have shape (n, 3); got {self.points.shape}")
        n = len(self.points)
        ids = np.asarray(np.arange(1, n + 1) if node_ids is None else node_ids)
        if ids.shape != (n,) or (n and ids.dtype.kind not in "iu"):
            raise MeshError(f"node_ids must be whole numbers of shape ({n},); got {ids.dtype} {ids.shape}")
        self.node_ids: Ints = ids.astype(np.int64)
        self.blocks = list(blocks)
        self.conditions = list(conditions)
        self.parts = dict(parts or {})
        self.source = source
        self._faces: tuple[list[Rows], Faces | None] = ([], None)
        self._check()

    def _check(self) -> None:
        """Raise MeshError for ids that occur twice and for parts whose rows do not exist."""
        if not self._is_counting:
            ordered = self.node_ids[self._node_order]
            twice = ordered[1:][ordered[1:] == ordered[:-1]]
            if len(twice):
                raise MeshError(f"node id {twice[0]} occurs more than once; give every node its own")
        sizes = {"nodes": self.n_nodes, "elements": self.n_elements, "conditions": self.n_conditions}
        for name, part in self.parts.items():
            for what, size in sizes.items():
                _existing(getattr(part, what), size, f"part {name!r}: rows of {what}")

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

    @property
    def element_ids(self) -> Ints:
        """(m,) element ids through all blocks in order."""
        return ids_of(self.blocks)

    @cached_property
    def _node_order(self) -> Ints:
        return np.argsort(self.node_ids, kind="stable")

    def node_rows(self, ids: ArrayLike) -> Ints:
        """Return the rows of nodes by their ids.

        Parameters
        ----------
        ids : (...) int.

        Returns
        -------
        (...) int
            Rows of `points`; -1 where there is no such id.
        """
        ids = np.asarray(ids, dtype=np.int64)
        if self._is_counting:
            return np.where((ids >= 1) & (ids <= self.n_nodes), ids - 1, -1)
        return rows_of_ids(self.node_ids, ids, self._node_order)

    @cached_property
    def _is_counting(self) -> bool:
        """Whether the ids are 1 … n in order."""
        return bool((self.node_ids == np.arange(1, self.n_nodes + 1)).all())

    def place(self, block: Block, cell: int) -> str:
        """Return a readable place of a cell for messages: ``cube.mdpa:22: element 1 (…3D8N)``.

        Parameters
        ----------
        block : an element block.
        cell : row of the cell in the block.

        Returns
        -------
        str
        """
        line = f":{block.lines[cell]}" if block.lines is not None else ""
        where = f"{self.source}{line}: " if self.source else ""
        return f"{where}element {block.ids[cell]} ({block.name})"

    # ---- parts -----------------------------------------------------------------------------

    def part(self, name: str) -> Part:
        """Return a part by its full name, or by its last word when that is unique.

        ``x- x+ y- y+ z- z+`` mean the nodes on the sides of the bounding box where the mesh
        has no part of that name.

        Parameters
        ----------
        name : of the part.

        Returns
        -------
        Part

        Raises
        ------
        MeshError
            If there is no such part, or several.
        """
        if not isinstance(name, str):
            raise MeshError(
                f"a part is known by its name; got {name!r}: see nodes(where) and add_part(name, where)"
            )
        if name in self.parts:
            return self.parts[name]
        if name in SIDES and self.n_nodes:
            return Part(nodes=self._side(*SIDES[name]))
        ends = [full for full in self.parts if full.rsplit(".", 1)[-1] == name]
        if len(ends) == 1:
            return self.parts[ends[0]]
        if ends:
            raise MeshError(f"part {name!r} is not unique; write one of {', '.join(ends)}")
        have = ", ".join(part for part in self.parts if part not in SIDES)
        have = f"have {have} and" if have else "have"
        raise MeshError(f"there is no part {name!r}; {have} the sides x- … z+.{nearest(name, self.parts)}")

    def add_part(self, name: str, where: Where) -> None:
        """Give nodes a name.

        Parameters
        ----------
        name : of the new part; a part of that name is replaced.
        where : part name, predicate on the points (n, 3), mask (n,) or rows.

        Raises
        ------
        MeshError
            If no node is chosen.

        Examples
        --------
        >>> mesh = Mesh([[0, 0, 0], [1, 0, 0]])
        >>> mesh.add_part("tip", lambda X: X[:, 0] > 0.5)
        >>> mesh.nodes("tip")
        array([1])
        """
        if not isinstance(name, str) or not name:
            raise MeshError(f"a part needs a name; got {name!r}")
        rows = self.nodes(where)
        if not len(rows):
            raise MeshError(f"no node is chosen for part {name!r}")
        self.parts[name] = Part(nodes=rows)

    def _side(self, axis: int, end: int) -> Ints:
        x = self.points[:, axis]
        low, high = float(x.min()), float(x.max())
        goal = high if end else low
        return np.flatnonzero(np.abs(x - goal) <= 1e-6 * (high - low))

    def nodes(self, where: Where) -> Ints:
        """Return the rows of nodes, each once and in the order in which they are given.

        Parameters
        ----------
        where : part name, predicate on the points (n, 3), mask (n,) or rows.

        Returns
        -------
        (k,) int

        Raises
        ------
        MeshError
            If there is no such part, or a row or a mask does not fit the mesh.

        Examples
        --------
        >>> mesh = Mesh([[0, 0, 0], [1, 0, 0]])
        >>> mesh.nodes(lambda X: X[:, 0] > 0.5)
        array([1])
        """
        if isinstance(where, str):
            return self.part(where).nodes
        chosen = np.asarray(where(self.points.copy()) if callable(where) else where)
        if chosen.dtype == bool:
            if chosen.shape != (self.n_nodes,):
                raise MeshError(f"a node mask must have shape ({self.n_nodes},); got {chosen.shape}")
            return np.flatnonzero(chosen)
        if chosen.dtype.kind not in "iu":
            raise MeshError("nodes are chosen by part name, predicate, mask or integer rows")
        rows = chosen.astype(np.int64).ravel()
        return without_repeats(_existing(rows, self.n_nodes, "node rows"))

    def used_nodes(self) -> Mask:
        """Return which nodes belong to an element.

        Returns
        -------
        (n,) bool
        """
        used = np.zeros(self.n_nodes, dtype=bool)
        for block in self.blocks:
            used[block.nodes] = True
        return used

    def elements(self, where: WhereElements = None) -> Ints:
        """Return the rows of elements.

        A part without elements of its own gives the elements that have all their nodes in it.

        Parameters
        ----------
        where : part name, property id, rows, or None for all.

        Returns
        -------
        (k,) int

        Raises
        ------
        MeshError
            If there is no such part, property or row.
        """
        if where is None:
            return np.arange(self.n_elements)
        if isinstance(where, (int, np.integer)) and not isinstance(where, bool):
            ids = np.concatenate([NO_ROWS, *(block.properties for block in self.blocks)])
            rows = np.flatnonzero(ids == where)
            if not len(rows):
                raise MeshError(
                    f"no element has property {where}; the properties are {distinct(ids).tolist()}"
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
        return _existing(rows, self.n_elements, "element rows").astype(np.int64)

    def _elements_among(self, nodes: Ints) -> Ints:
        inside = np.zeros(self.n_nodes, dtype=bool)
        inside[nodes] = True
        return np.flatnonzero(np.concatenate([NO_ROWS, *(inside[b.nodes].all(axis=1) for b in self.blocks)]))

    def locate(self, points: ArrayLike, *, required: bool = False) -> Located:
        """Return which elements contain points, and where in them the points lie.

        A point on a face, edge or node of several elements belongs to the one in the lowest row.

        Parameters
        ----------
        points : (..., 3) float, m.
        required : raise MeshError where a point lies outside; otherwise its ``inside`` is False.

        Returns
        -------
        Located

        Raises
        ------
        InputError
            If the points are not finite or have the wrong shape.
        MeshError
            If a required point lies outside, or a node has no finite coordinates.

        Examples
        --------
        >>> from kratos_lite import box
        >>> found = box(cells=(2, 1, 1)).locate([[0.75, 0.5, 0.5], [3.0, 0.0, 0.0]])
        >>> found.rows.tolist(), found.xi[0].tolist()
        ([1, -1], [0.0, 0.0, 0.0])
        """
        found = locate(self, points)
        return found.require() if required else found

    # ---- faces -----------------------------------------------------------------------------

    @property
    def boundary(self) -> list[Block]:
        """Faces that belong to one element only, outward, one block per face shape.

        ``ids`` holds the row of the parent element.  Made anew when the blocks have changed.
        """
        return self.all_faces().boundary

    def all_faces(self, *, anew: bool = False) -> Faces:
        """Return all faces of the elements and which coincide; they are kept until a block is exchanged.

        Parameters
        ----------
        anew : find them in any case.

        Returns
        -------
        Faces
        """
        nodes = [block.nodes for block in self.blocks]
        known, faces = self._faces
        same = len(known) == len(nodes) and all(a is b for a, b in zip(known, nodes, strict=True))
        if faces is None or anew or not same:
            faces = Faces(self.blocks)
            self._faces = (nodes, faces)
        return faces

    def reoriented(self) -> Mesh:
        """Return the mesh in which inverted elements have the node order of their mirror image.

        Returns
        -------
        Mesh
        """
        blocks = []
        for block in self.blocks:
            turn = inverted(block, self.points)
            nodes = block.nodes.copy()
            if turn.any() and block.shape is not None:
                nodes[turn] = nodes[turn][:, mirror(block.shape)]
            blocks.append(replace(block, nodes=nodes))
        rest: Any = {"conditions": self.conditions, "parts": self.parts, "source": self.source}
        return Mesh(self.points, blocks, node_ids=self.node_ids, **rest)

    def faces(self, where: Where) -> list[Block]:
        """Return the faces of a part: its conditions, or else the boundary faces among its nodes.

        Parameters
        ----------
        where : part name, predicate on the points (n, 3), mask (n,) or rows.

        Returns
        -------
        list of Block
            One block for each shape of faces.
        """
        if isinstance(where, str) and len(rows := self.part(where).conditions):
            return select(self.conditions, rows)
        inside = np.zeros(self.n_nodes, dtype=bool)
        inside[self.nodes(where)] = True
        chosen = [block.take(np.asarray(inside[block.nodes].all(axis=1))) for block in self.boundary]
        return [block for block in chosen if len(block)]


def _existing(rows: Ints, size: int, what: str) -> Ints:
    """Return rows, all of which exist."""
    if len(rows) and not (0 <= rows.min() and rows.max() < size):
        raise MeshError(f"{what} must lie in 0 … {size - 1}; got {rows.min()} … {rows.max()}")
    return rows
