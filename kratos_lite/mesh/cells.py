"""Cells: points and blocks of elements on them, with their ids and faces; they do not change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from kratos_lite.errors import MeshError
from kratos_lite.mesh.blocks import Block, blocks_of, ids_of, rows_of_ids
from kratos_lite.mesh.subdomain import ALONE, Alone, Subdomain
from kratos_lite.mesh.topology import Faces
from kratos_lite.typing import Array, Ints, Mask

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from kratos_lite.mesh.hanging import HangingNodes
from kratos_lite.validation import finite, read_only, whole_numbers


class Cells:
    """Points (n, 3) in m and element blocks, of which a `Mesh` is made.

    Parameters
    ----------
    points : (n, 3) float, m.
    blocks : cells (m, k) by element name, rows of `points` from 0; or a list of `Block`.
    node_ids : (n,) int, ids of the nodes; 1 … n if not given.
    source : name of the file they came from, used in messages.
    hanging : nodes inside edges or faces of larger neighbors, or None.
    subdomain : which nodes and cells are own, where many processes share them, or None.

    Raises
    ------
    MeshError
        As for a `Mesh`.
    """

    points: Array
    node_ids: Ints
    blocks: tuple[Block, ...]
    source: str
    hanging: HangingNodes | None
    subdomain: Subdomain | None

    def __init__(
        self,
        points: ArrayLike,
        blocks: Mapping[str, ArrayLike] | Sequence[Block],
        node_ids: ArrayLike | None,
        source: str,
        hanging: HangingNodes | None = None,
        subdomain: Subdomain | None = None,
    ) -> None:
        X = finite(points, "points", ("n", 3), error=MeshError)
        n = len(X)
        ids = np.arange(1, n + 1) if node_ids is None else node_ids
        vars(self).update(
            points=read_only(np.ascontiguousarray(X)),
            node_ids=read_only(whole_numbers(ids, "node_ids", (n,), error=MeshError)),
            blocks=blocks_of(blocks),
            source=source,
            hanging=hanging,
            subdomain=subdomain,
        )
        if not self._is_counting:
            ordered = self.node_ids[self._node_order]
            twice = ordered[1:][ordered[1:] == ordered[:-1]]
            if len(twice):
                raise MeshError(f"node id {twice[0]} occurs more than once; give every node its own")
        self._check_rows(self.blocks)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise MeshError(f"a mesh does not change; make another one, as in mesh = mesh.replace({name}=...)")

    def __delattr__(self, name: str) -> NoReturn:
        self.__setattr__(name, None)

    def _check_rows(self, blocks: Sequence[Block]) -> None:
        """Raise MeshError for cells with rows of points that do not exist."""
        for block in blocks:
            if block.nodes.max(initial=-1) >= self.n_nodes:
                cell = int(np.argmax((block.nodes >= self.n_nodes).any(axis=1)))
                raise MeshError(
                    f"{self.place(block, cell)} uses node rows {block.nodes[cell].tolist()}; "
                    f"rows are 0 … {self.n_nodes - 1}"
                )

    # ---- what is own, where many processes share the mesh ----------------------------------

    @property
    def ranks(self) -> Alone:
        """The processes that share the mesh."""
        return ALONE if self.subdomain is None else self.subdomain.ranks

    @property
    def own_nodes(self) -> Mask:
        """(n,) bool, the nodes of this process: all, unless others share the mesh."""
        return np.ones(self.n_nodes, dtype=bool) if self.subdomain is None else self.subdomain.mine

    @property
    def own_elements(self) -> Mask:
        """(m,) bool, the elements of this process."""
        return np.ones(self.n_elements, dtype=bool) if self.subdomain is None else self.subdomain.own_elements

    @cached_property
    def extent(self) -> Array:
        """(2, 3) float, m, the lowest and the highest coordinates, of the nodes of all processes.

        Without nodes they are infinite.
        """
        columns = self.points.T  # one by one, which is faster
        low = np.array([x.min(initial=np.inf) for x in columns])
        high = np.array([x.max(initial=-np.inf) for x in columns])
        return read_only(np.stack([self.ranks.min(low), self.ranks.max(high)]))

    def first_element(self, chosen: Mask) -> int | None:
        """Return the row of the first element of a mask (m,); None where only another process has that.

        All processes ask.  The first is the one in the first block with the lowest id.

        Parameters
        ----------
        chosen : (m,) bool.

        Returns
        -------
        The row, or None, as where no process has any.
        """
        if self.subdomain is None:
            return int(chosen.argmax()) if chosen.any() else None
        rows = np.flatnonzero(chosen)
        number = np.repeat(np.arange(len(self.blocks)), [len(block) for block in self.blocks])[rows]
        ids = self.element_ids[rows]
        best = np.lexsort((ids, number))[:1]
        mine = (int(number[best[0]]), int(ids[best[0]])) if len(rows) else None
        known = [one for one in self.ranks.gather(mine) if one is not None]
        return int(rows[best[0]]) if mine is not None and mine == min(known) else None

    def first_node(self, chosen: Mask) -> int | None:
        """Return the row of the first node of a mask (n,); None where only another process has that.

        All processes ask; of several, the first is the one with the lowest id.

        Parameters
        ----------
        chosen : (n,) bool.

        Returns
        -------
        The row, or None, as where no process has any.
        """
        if self.subdomain is None:
            return int(chosen.argmax()) if chosen.any() else None
        rows = np.flatnonzero(chosen)
        none = np.iinfo(np.int64).max
        mine = int(self.node_ids[rows].min(initial=none))
        first = self.ranks.min(mine)
        return int(self.node_rows(mine)) if first == mine < none else None

    # ---- nodes and elements ----------------------------------------------------------------

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.points)

    @property
    def n_elements(self) -> int:
        """Number of elements in all blocks."""
        return sum(len(block) for block in self.blocks)

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

        Raises
        ------
        MeshError
            Ids are no whole numbers.
        """
        ids = whole_numbers(ids, "ids of nodes", error=MeshError)
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

    @cached_property
    def all_faces(self) -> Faces:
        """All faces of the elements, and which coincide."""
        return Faces(self.blocks, self.hanging)

    @property
    def boundary(self) -> list[Block]:
        """Faces that belong to one element only, outward, one block per face shape.

        ``ids`` holds the row of the parent element.
        """
        return self.all_faces.boundary
