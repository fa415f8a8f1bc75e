"""Nodes of all ranks by their ids: place, owner and number of each."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from kratos_lite.distributed.directory import Asked, Directory, Route
from kratos_lite.distributed.lookup import merged
from kratos_lite.distributed.pieces import Kind, Piece
from kratos_lite.errors import MeshError
from kratos_lite.mesh import NO_ROWS
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.typing import Array, Ints


class NodeDirectory:
    """The nodes that any rank gives; all ranks make and use it.

    Parameters
    ----------
    ranks : the communicator.
    piece : what this rank gives, of which conditions and parts do not matter.

    Attributes
    ----------
    own : (k,) int, ids of the own nodes of this rank, ascending.
    touched : (t,) int, ids of the nodes of the elements that this rank gives, ascending.
    points, owner, numbers : of the nodes that this rank looks after.

    Raises
    ------
    MeshError
        Ranks disagree on the place or the owner of a node, or nobody knows a node of an element.
    """

    def __init__(self, ranks: Alone, piece: Piece) -> None:
        self.ranks, self.directory = ranks, Directory(ranks, piece.node_ids)
        self.points = _places(self.directory, piece)
        self.owner = self._owners(piece)
        self.own, self.numbers = self._numbered()

    def ask(self, kinds: Iterable[Kind], more: Ints = NO_ROWS) -> tuple[Ints, Asked]:
        """Return the ids of the nodes of cells, and more, ascending; and a question for them.

        Raises
        ------
        MeshError
            Nobody knows a node.
        """
        return _asked(self.directory, kinds, more)

    def _owners(self, piece: Piece) -> Ints:
        """Return the owner of each node: the one given, or the lowest rank with an element, or the node."""
        size, given = self.ranks.size, self.directory.given
        self.touched, touching = self.ask(piece.elements)
        lowest, named = np.full((2, len(self.directory.ids)), size)
        np.minimum.at(lowest, given.rows, size + given.sources)
        np.minimum.at(lowest, touching.rows, touching.sources)
        owners = np.full(len(piece.node_ids), -1) if piece.owners is None else np.asarray(piece.owners)
        if owners.max(initial=-1) >= size:
            node = int(owners.argmax())
            raise MeshError(
                f"node {piece.node_ids[node]} belongs to rank {owners[node]}, but there are {size} ranks; "
                "start as many as the parts were made for"
            )
        told = given.tell(owners)
        rows, told, sources = given.rows[told >= 0], told[told >= 0], given.sources[told >= 0]
        named[rows[::-1]] = told[::-1]  # the first one stays
        differ = np.flatnonzero(named[rows] != told)
        if len(differ):
            one = differ[0]
            raise MeshError(
                f"node {self.directory.ids[rows[one]]} belongs to rank {told[one]} according to rank "
                f"{sources[one]}, but to rank {named[rows[one]]} according to another; "
                "read parts that were made together"
            )
        lowest = np.where(lowest >= size, lowest - size, lowest)
        return np.where(named < size, named, lowest)

    def _numbered(self) -> tuple[Ints, Ints]:
        """Return the own nodes, ascending, and the numbers of those that this rank looks after."""
        to_owners = Route(self.ranks, self.owner)
        ids = to_owners.send(self.directory.ids)
        order = np.argsort(ids, kind="stable")
        first = sum(self.ranks.gather(len(ids))[: self.ranks.rank])
        numbers = np.empty(len(ids), dtype=np.int64)
        numbers[order] = first + np.arange(len(ids))
        return ids[order], to_owners.back(numbers)


def places(ranks: Alone, piece: Piece, kinds: Iterable[Kind]) -> tuple[Ints, Array]:
    """Return the nodes of cells: ids (n,), ascending, and places (n, 3); all ranks call it."""
    directory = Directory(ranks, piece.node_ids)
    table = _places(directory, piece)
    ids, asked = _asked(directory, kinds)
    return ids, asked.answer(table)


def _asked(directory: Directory, kinds: Iterable[Kind], more: Ints = NO_ROWS) -> tuple[Ints, Asked]:
    kinds = list(kinds)
    ids = merged(more, *(kind.nodes for kind in kinds))
    asked = directory.ask(ids)
    missing = ids[~asked.has()]
    if len(missing):
        raise MeshError(_who_needs(kinds, int(missing[0])))
    return ids, asked


def _places(directory: Directory, piece: Piece) -> Array:
    """Return the place of each node of a directory; MeshError where ranks give different ones."""
    rows, sources = directory.given.rows, directory.given.sources
    given = directory.given.tell(np.asarray(piece.points, dtype=float))
    first = np.empty(len(directory.ids), dtype=np.int64)
    first[rows[::-1]] = np.arange(len(rows))[::-1]
    points: Array = given[first]
    differ = np.flatnonzero((given != points[rows]).any(axis=1))
    if len(differ):
        other = differ[0]
        row = rows[other]
        raise MeshError(
            f"node {directory.ids[row]} is at {points[row].tolist()} m on rank "
            f"{sources[first[row]]}, but at {given[other].tolist()} m on rank {sources[other]}; "
            "give a node the same place on all ranks, and read parts that were made together"
        )
    return points


def _who_needs(kinds: Iterable[Kind], node: int) -> str:
    """Return the message about a node that is missing."""
    for kind in kinds:
        cells = np.flatnonzero((kind.nodes == node).any(axis=1))
        if len(cells):
            line = "" if kind.lines is None else f" in line {kind.lines[cells[0]]}"
            return f"{kind.name} {kind.ids[cells[0]]}{line}: there is no node {node} on any rank"
    return f"there is no node {node} on any rank"
