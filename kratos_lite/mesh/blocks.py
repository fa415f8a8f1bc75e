"""Blocks of cells of one type, and named parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import MeshError
from kratos_lite.shapes import Shape
from kratos_lite.tabular import names_of
from kratos_lite.typing import Array, ArrayLike, Ints, Mask, Numbers, Rows
from kratos_lite.validation import instance, read_only, short, whole_numbers

NO_ROWS: Ints = read_only(np.zeros(0, dtype=np.int64))


@dataclass(frozen=True, eq=False)
class Block:
    """Cells of one type: elements, or the conditions that carry loads; its arrays are read-only.

    Parameters
    ----------
    name : type as registered or as written in the file, e.g. ``KinematicLinear3D8N``.
    nodes : (m, k) int, indices of ``mesh.points``, in Kratos order.
    ids : (m,) int, ids of the cells; 1 … m if not given.
    properties : int or (m,) int, property id of the cells.
    shape : the reference cell; if not given, that of the registered element of this name, or None for a
        type that kratos_lite does not know.
    lines : (m,) int, line of each cell in the file it came from, or None.

    Raises
    ------
    MeshError
        An array holds anything but whole numbers, has another shape, or a row of a node is negative.

    Examples
    --------
    >>> block = Block("KinematicLinear3D4N", [[0, 1, 2, 3], [1, 2, 3, 4]])
    >>> block.ids, block.properties, block.shape.__name__
    (array([1, 2]), array([1, 1]), 'Tetrahedron4')
    """

    name: str
    nodes: Rows
    ids: Ints
    properties: Ints
    shape: type[Shape] | None
    lines: Rows | None

    def __init__(
        self,
        name: str,
        nodes: ArrayLike,
        ids: ArrayLike | None = None,
        properties: ArrayLike = 1,
        shape: type[Shape] | None = None,
        lines: ArrayLike | None = None,
    ) -> None:
        instance(name, "the name of a block", str, "'KinematicLinear3D8N'", error=MeshError)
        if shape is None and name in ELEMENTS:
            shape = ELEMENTS[name].shape
        width = "k" if shape is None else len(shape.nodes)
        if isinstance(nodes, list) and not nodes and shape is not None:
            nodes = np.zeros((0, len(shape.nodes)), dtype=np.int32)
        vars(self).update(name=name, shape=shape, nodes=_column(name, "nodes", nodes, ("m", width), np.int32))
        if self.nodes.min(initial=0) < 0:
            raise MeshError(f"block {name}: nodes are indices of points, from 0; got {self.nodes.min()}")
        m = len(self.nodes)
        if isinstance(properties, (int, np.integer)) and not isinstance(properties, bool):
            properties = np.full(m, properties)
        vars(self).update(
            ids=_column(name, "ids", np.arange(1, m + 1) if ids is None else ids, (m,)),
            properties=_column(name, "properties", properties, (m,)),
            lines=None if lines is None else _column(name, "lines", lines, (m,), np.int32),
        )

    def __len__(self) -> int:
        return len(self.nodes)

    @property
    def known_shape(self) -> type[Shape]:
        """The reference cell, of a block whose type is known."""
        assert self.shape is not None
        return self.shape

    def __reduce__(self) -> tuple[Any, ...]:  # copies are read-only as well
        return Block, tuple(getattr(self, name) for name in names_of(type(self)))

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


def _column(
    name: str, what: str, values: Any, shape: tuple[int | str, ...], dtype: Any = np.int64
) -> Numbers:
    """Return whole numbers of a block, read-only."""
    return read_only(whole_numbers(values, f"block {name}: {what}", shape, dtype=dtype, error=MeshError))


@dataclass(frozen=True, eq=False)
class Part:
    """A named part (Kratos: SubModelPart): indices of what belongs to it, in read-only arrays.

    Those of elements and conditions count through all blocks in order.

    Parameters
    ----------
    nodes, elements, conditions : (k,) int, indices.
    geometries, constraints : (k,) int, ids as a file gives them.
    properties, tables : ids as a file gives them.
    data : variables of the part by name.

    Raises
    ------
    MeshError
        Rows or ids are no whole numbers, or a row is negative.
    """

    nodes: Ints = field(default_factory=lambda: NO_ROWS)
    elements: Ints = field(default_factory=lambda: NO_ROWS)
    conditions: Ints = field(default_factory=lambda: NO_ROWS)
    geometries: Ints = field(default_factory=lambda: NO_ROWS)
    constraints: Ints = field(default_factory=lambda: NO_ROWS)
    properties: tuple[int, ...] = ()
    tables: tuple[int, ...] = ()
    data: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("nodes", "elements", "conditions", "geometries", "constraints"):
            what = f"{name} of a part"
            vars(self)[name] = read_only(whole_numbers(getattr(self, name), what, ("k",), error=MeshError))

    def __reduce__(self) -> tuple[Any, ...]:  # copies are read-only as well
        return Part, tuple(getattr(self, name) for name in names_of(type(self)))

    def __str__(self) -> str:
        counts = {what: len(getattr(self, what)) for what in ("nodes", "elements", "conditions")}
        return ", ".join(f"{count} {what}" for what, count in counts.items() if count) or "empty"


class Cells(Protocol):
    """Points and blocks of elements on them, as a `Mesh` has them."""

    points: Array
    node_ids: Ints
    blocks: tuple[Block, ...]
    source: str
    whole: bool
    units: str

    @property
    def element_ids(self) -> Ints:
        """Ids of the elements (m,)."""

    @property
    def extent(self) -> Array:
        """Lowest and highest coordinates (2, 3)."""

    @property
    def places(self) -> tuple[Array, Ints]:
        """How far nodes are along a skew direction, in order (n,), and the nodes in this order."""

    def place(self, block: Block, cell: int) -> str:
        """Return a cell in words."""


def blocks_of(values: Any, what: str = "blocks") -> tuple[Block, ...]:
    """Return blocks from ``{element name: nodes}``, numbered through, or from a sequence."""
    if isinstance(values, Mapping):
        blocks: list[Block] = []
        for name, nodes in values.items():
            block, first = Block(name, nodes), sum(map(len, blocks)) + 1
            if name not in ELEMENTS:
                raise MeshError(f"there is no element {name!r}{_elements_of(block.nodes.shape[1])}")
            blocks.append(replace(block, ids=np.arange(first, first + len(block))))
        return tuple(blocks)
    sequence = tuple(values) if isinstance(values, Sequence) else (values,)
    if not all(isinstance(block, Block) for block in sequence):
        raise MeshError(
            f"{what} must be nodes by element name, as in kl.Mesh(points, {{'KinematicLinear3D8N': nodes}}), "
            f"or a list of kl.Block(name, nodes); got {short(values)}"
        )
    return sequence


def _elements_of(width: int) -> str:
    """Return a hint that names the elements with so many nodes."""
    names = [name for name in ELEMENTS if len(ELEMENTS[name].nodes) == width]
    return f"; with {width} nodes there is {', '.join(names)}" if names else f", nor any with {width} nodes"


def with_rows(blocks: Iterable[Block]) -> Iterator[tuple[Block, slice]]:
    """Yield each block with the rows of its cells, which count through all blocks in order."""
    start = 0
    for block in blocks:
        yield block, slice(start, start + len(block))
        start += len(block)


def select(blocks: Sequence[Block], rows: Ints, properties: Ints | None = None) -> list[Block]:
    """Return the cells with these rows (k,), block by block; with other properties (k,) if given."""
    inside = ((block, at, (rows >= at.start) & (rows < at.stop)) for block, at in with_rows(blocks))
    found = [(block.take(rows[here] - at.start), here) for block, at, here in inside if here.any()]
    return [b if properties is None else replace(b, properties=properties[here]) for b, here in found]


def ranges(start: Ints, count: Ints) -> Ints:
    """Return the whole numbers from each start on, as many as its count, one after the other."""
    return np.repeat(start - np.cumsum(count) + count, count) + np.arange(int(count.sum()))


def mask_of(indices: Any, count: int) -> Mask:
    """Return a mask (count,) of some indices."""
    mask = np.zeros(count, dtype=bool)
    mask[indices] = True
    return mask


SPARSE = 8
"""Largest id over their number, from which on ids are sorted instead of listed in a table."""


def distinct(values: Ints) -> Ints:
    """Return the different values in increasing order."""
    if not len(values) or (values == values[0]).all():
        return values[:1]
    if (values[1:] > values[:-1]).all():
        return values
    ordered: Ints = np.sort(values)
    different: Ints = ordered[np.append(True, ordered[1:] != ordered[:-1])]
    return different


def without_repeats(rows: Ints) -> Ints:
    """Return the rows, each once, in the order in which they came first."""
    if (rows[1:] > rows[:-1]).all():
        return rows
    return np.fromiter(dict.fromkeys(rows.tolist()), dtype=np.int64)


def ids_of(blocks: Iterable[Block]) -> Ints:
    """Return the ids of all cells of some blocks, in order."""
    return np.concatenate([NO_ROWS, *(block.ids for block in blocks)])


def rows_of_ids(ids: Ints, wanted: ArrayLike, order: Ints | None = None) -> Ints:
    """Return where each wanted id stands in `ids`; -1 where it does not."""
    wanted = np.asarray(wanted, dtype=np.int64)
    if not len(ids):
        return np.full(wanted.shape, -1, dtype=np.int64)
    if order is None and 0 <= ids.min() and (top := int(ids.max())) < SPARSE * len(ids):
        row_of = np.full(top + 2, -1)  # the last is that of ids that are not there
        row_of[ids[::-1]] = np.arange(len(ids))[::-1]
        if 0 <= wanted.min(initial=0) and wanted.max(initial=0) <= top:
            return row_of[wanted]
        return np.asarray(row_of[np.where((wanted < 0) | (wanted > top), top + 1, wanted)])
    order = np.argsort(ids, kind="stable") if order is None else order
    rows = order[np.minimum(np.searchsorted(ids, wanted, sorter=order), len(ids) - 1)]
    return np.where(ids[rows] == wanted, rows, -1)
