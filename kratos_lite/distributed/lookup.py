"""Lookup: rows of ids; by a table where ids lie close together, as those of a piece of a mesh often do."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh import distinct, rows_of_ids
from kratos_lite.typing import Ints

CLOSE = 16
"""Numbers between the least and the largest id, for each of them, up to which a table is made."""


def merged(*ids: Ints) -> Ints:
    """Return the different ids of several arrays, ascending.

    >>> merged(np.array([[7, 5]]), np.array([5, 2])).tolist()
    [2, 5, 7]
    """
    every = np.concatenate([np.zeros(0, dtype=np.int64), *(some.ravel() for some in ids)])
    low, high = _range(every)
    if high - low > CLOSE * len(every):
        return distinct(every)
    there = np.zeros(high - low + 1, dtype=bool)
    there[every - low] = True
    return np.flatnonzero(there) + low


class Lookup:
    """Where each of some ids stands.

    Parameters
    ----------
    ids : (n,) int, different ones.

    Examples
    --------
    >>> Lookup(np.array([7, 3, 9])).rows([9, 4, 7]).tolist()
    [2, -1, 0]
    """

    def __init__(self, ids: Ints) -> None:
        self._ids = ids
        self._low, high = _range(ids)
        self._order = self._table = None
        if high - self._low > CLOSE * len(ids):
            self._order = np.argsort(ids, kind="stable")
        else:
            self._table = np.full(high - self._low + 2, -1)
            self._table[ids - self._low] = np.arange(len(ids))

    def rows(self, wanted: Ints) -> Ints:
        """Return the row of each id (...), -1 where it is not among them."""
        if self._table is None:
            return rows_of_ids(self._ids, wanted, self._order)
        at = np.asarray(wanted) - self._low
        last = len(self._table) - 1  # where nothing is
        return self._table[np.where((at >= 0) & (at < last), at, last)]


def _range(ids: Ints) -> tuple[int, int]:
    return (int(ids.min()), int(ids.max())) if len(ids) else (0, -1)
