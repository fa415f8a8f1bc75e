"""Document: what a file says, before anything is made of it, and what no file may say of nodes and cells.

The readers of `.mdpa` and `.elem` fill one, the `.mdpa` writer writes one, and
``kratos_lite.io.kratos.to_model`` turns it into a Model.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite.mesh import Block, Mesh, distinct
from kratos_lite.typing import Array, Ints, Mask


@dataclass
class Properties:
    """One ``Properties`` block: variables by name, with the line of each.

    `source` is the name of the file, if it is not the file of the mesh.
    """

    id: int
    values: dict[str, Any] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)
    line: int = 0
    source: str = ""


@dataclass(eq=False)
class Data:
    """Values of one variable on nodes, elements or conditions."""

    variable: str  # e.g. ``DISPLACEMENT_X``.
    ids: Ints  # (m,) int ids as written in the file.
    fixed: Mask  # (m,) bool, True where the degree of freedom is fixed (nodal data only).
    values: Array  # (m,) or (m, k) float; empty for flags.
    line: int = 0  # line of the ``Begin``.
    source: str = ""  # name of the file, if it is not the file of the mesh.


@dataclass(frozen=True)
class Constraint:
    """One linear multi-point constraint: u[dependent] = sum(weights · u[independents]) + constant.

    Degrees of freedom are (node id, variable name) pairs.
    """

    id: int
    dependent: tuple[int, str]
    independents: tuple[tuple[int, str], ...]
    weights: tuple[float, ...]
    constant: float
    line: int = 0
    name: str = "LinearMasterSlaveConstraint"


@dataclass(frozen=True)
class Note:
    """Something the reader kept without use, skipped, or found odd.

    >>> print(Note(3, "odd"), Note(3, "odd", "beam.cond"), sep="; ")
    line 3: odd; beam.cond:3: odd
    """

    line: int
    text: str
    source: str = ""

    def __str__(self) -> str:
        place = ":".join([self.source, *([str(self.line)] if self.line else [])]) if self.source else ""
        return f"{place or f'line {self.line}'}: {self.text}" if place or self.line else self.text


@dataclass
class Document:
    """Everything that a model file says."""

    mesh: Mesh
    properties: dict[int, Properties] = field(default_factory=dict)
    nodal_data: list[Data] = field(default_factory=list)
    element_data: list[Data] = field(default_factory=list)
    condition_data: list[Data] = field(default_factory=list)
    constraints: list[Constraint] = field(default_factory=list)
    geometries: list[Block] = field(default_factory=list)
    tables: dict[int, Any] = field(default_factory=dict)
    model_data: dict[str, Any] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)
    attached: list[Any] = field(default_factory=list)  # springs and masses, which are no elements here

    def used_properties(self) -> list[Properties]:
        """Return the Properties of elements, by number."""
        used = {int(number) for block in self.mesh.blocks for number in distinct(block.properties)}
        return [self.properties[number] for number in sorted(used & self.properties.keys())]


MOST = 1000
"""Problems of one kind that are reported; the rest would only repeat them."""


def already(what: str, line: int, how: str = "") -> str:
    """Return the message about what a file defines for the second time.

    >>> already("node 7", 3)
    'node 7 is already defined at line 3'
    """
    return f"{what} is already defined at line {line}{how}"


def repeated(ids: Ints) -> list[tuple[int, int]]:
    """Return (row, row of the first) for every id that stands there again.

    >>> repeated(np.array([4, 7, 4]))
    [(2, 0)]
    """
    if len(ids) < 2 or (ids[1:] > ids[:-1]).all():
        return []
    _, first, inverse = np.unique(ids, return_index=True, return_inverse=True)
    first = first[inverse]
    again = np.flatnonzero(first != np.arange(len(ids)))
    return [(int(row), int(first[row])) for row in again]


def repeated_nodes(ids: Ints, points: Array, lines: NDArray[np.int32]) -> Iterator[tuple[int, str, bool]]:
    """Yield row, message and whether it is only odd for every node that stands there again."""
    for row, first in repeated(ids):
        is_same = bool((points[row] == points[first]).all())
        there, here = (" ".join(f"{x:.12g}" for x in points[i]) for i in (first, row))
        how = ", the same" if is_same else f" at {there}; found {here}; give each node its own id"
        yield row, already(f"node {ids[row]}", int(lines[first]), how), is_same


def wrong_nodes(ids: Ints, rows: Ints) -> Iterator[tuple[int, str]]:
    """Yield cell and message for each node of `ids` (m, k) that is missing (row -1), or twice in a cell."""
    if not rows.size:
        return
    for i, k in np.argwhere(rows < 0)[:MOST] if rows.min() < 0 else ():
        yield int(i), f": there is no node {ids[i, k]}"
    ordered = np.sort(rows, axis=1)
    twice = (ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] >= 0)
    for i in np.flatnonzero(twice.any(axis=1))[:MOST]:
        node = ids[i, np.argmax(rows[i] == ordered[i, 1:][twice[i]][0])]
        yield int(i), f" names node {node} twice; its nodes must differ"
