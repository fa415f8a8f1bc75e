"""Cells: points and blocks of elements on them, with their ids and faces; they do not change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from kratos_lite.errors import MeshError
from kratos_lite.mesh.blocks import Block, blocks_of, ids_of, rows_of_ids
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
    whole : False for one part of a larger mesh, where named parts may be empty.

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
    whole: bool

    def __init__(
        self,
        points: ArrayLike,
        blocks: Mapping[str, ArrayLike] | Sequence[Block],
        node_ids: ArrayLike | None,
        source: str,
        hanging: HangingNodes | None = None,
        whole: bool = True,
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
            whole=whole,
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

    @cached_property
    def extent(self) -> Array:
        """(2, 3) float, m, the lowest and the highest coordinates of the nodes.

        Without nodes they are infinite.
        """
        columns = self.points.T  # one by one, which is faster
        low = np.array([x.min(initial=np.inf) for x in columns])
        high = np.array([x.max(initial=-np.inf) for x in columns])
        return read_only(np.stack([low, high]))

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
