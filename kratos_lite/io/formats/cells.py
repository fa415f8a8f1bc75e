"""What every format refuses of nodes and cells: ids that stand twice, and nodes that are missing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from kratos_lite.typing import Array, Ints

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
