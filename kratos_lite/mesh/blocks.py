"""Blocks of cells of one kind, and named parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints, Mask, Rows

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
    nodes: Rows
    ids: Ints
    properties: Ints
    shape: type[Shape] | None
    lines: Rows | None = None

    def __len__(self) -> int:
        return len(self.ids)

    def take(self, chosen: Ints | Mask) -> Block:
        """Return the block of some of the cells.

        Parameters
        ----------
        chosen : rows (k,) int or a mask (m,) bool.

        Returns
        -------
        Block
        """
        lines = None if self.lines is None else self.lines[chosen]
        return Block(
            self.name, self.nodes[chosen], self.ids[chosen], self.properties[chosen], self.shape, lines
        )


class Cells(Protocol):
    """Points and blocks of cells on them, as a mesh has them."""

    points: Array
    blocks: list[Block]
    node_ids: Ints

    def place(self, block: Block, cell: int) -> str:
        """Return a readable place of a cell for messages."""


@dataclass(eq=False)
class Part:
    """A named part (Kratos: SubModelPart): rows of what belongs to it.

    Rows of elements and conditions count through all blocks in order.

    Attributes
    ----------
    nodes, elements, conditions : (k,) int, rows.
    geometries, constraints : (k,) int, ids as a file gives them.
    properties, tables : ids as a file gives them.
    data : variables of the part by name.
    """

    nodes: Ints = field(default_factory=lambda: NO_ROWS)
    elements: Ints = field(default_factory=lambda: NO_ROWS)
    conditions: Ints = field(default_factory=lambda: NO_ROWS)
    geometries: Ints = field(default_factory=lambda: NO_ROWS)
    constraints: Ints = field(default_factory=lambda: NO_ROWS)
    properties: tuple[int, ...] = ()
    tables: tuple[int, ...] = ()
    data: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        sizes = {"nodes": self.nodes, "elements": self.elements, "conditions": self.conditions}
        return ", ".join(f"{len(rows)} {what}" for what, rows in sizes.items() if len(rows)) or "empty"


def with_rows(blocks: Iterable[Block]) -> Iterator[tuple[Block, slice]]:
    """Yield each block with the rows of its cells, which count through all blocks in order."""
    start = 0
    for block in blocks:
        yield block, slice(start, start + len(block))
        start += len(block)


def select(blocks: Sequence[Block], rows: Ints) -> list[Block]:
    """Return the cells with these rows, block by block."""
    mine = [
        (block, rows[(rows >= at.start) & (rows < at.stop)] - at.start) for block, at in with_rows(blocks)
    ]
    return [block.take(keep) for block, keep in mine if len(keep)]


def distinct(values: Ints) -> Ints:
    """Return the different values in increasing order.

    Unlike ``np.unique`` it does not import masked arrays, and it is quick where all are equal.

    >>> distinct(np.array([3, 1, 3])).tolist()
    [1, 3]
    """
    if not len(values) or (values == values[0]).all():
        return values[:1]
    ordered: Ints = np.sort(values)
    different: Ints = ordered[np.append(True, ordered[1:] != ordered[:-1])]
    return different


def without_repeats(rows: Ints) -> Ints:
    """Return the rows, each once, in the order in which they came first.

    >>> without_repeats(np.array([3, 1, 3])).tolist()
    [3, 1]
    """
    if (rows[1:] > rows[:-1]).all():
        return rows
    order = np.argsort(rows, kind="stable")
    ordered = rows[order]
    first: Ints = np.sort(order[np.append(True, ordered[1:] != ordered[:-1])])
    return rows[first]


def ids_of(blocks: Iterable[Block]) -> Ints:
    """Return the ids of all cells of some blocks, in order."""
    return np.concatenate([NO_ROWS, *(block.ids for block in blocks)])


def rows_of_ids(ids: Ints, wanted: ArrayLike, order: Ints | None = None) -> Ints:
    """Return where each wanted id stands in `ids`; -1 where it does not.

    Who asks often gives the `order` that sorts the ids.

    >>> rows_of_ids(np.array([7, 3, 9]), [9, 4, 7]).tolist()
    [2, -1, 0]
    """
    wanted = np.asarray(wanted, dtype=np.int64)
    if not len(ids):
        return np.full(wanted.shape, -1, dtype=np.int64)
    order = np.argsort(ids, kind="stable") if order is None else order
    rows = order[np.minimum(np.searchsorted(ids, wanted, sorter=order), len(ids) - 1)]
    return np.where(ids[rows] == wanted, rows, -1)
