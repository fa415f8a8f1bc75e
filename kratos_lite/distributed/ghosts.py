"""Ghosts: copies of nodes of other ranks behind the own ones, and their exchange."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from kratos_lite.distributed.communicator import Alone
from kratos_lite.typing import Ints


class Ghosts:
    """The ghosts of a rank: rows `own`, `own` + 1, … of its nodal arrays, after those of its own nodes.

    All ranks call each method.

    Parameters
    ----------
    ranks : the communicator.
    offsets : (size + 1,) int, the first number of the nodes of each rank.
    numbers : (g,) int, ascending, the numbers of the ghosts.
    """

    def __init__(self, ranks: Alone, offsets: Ints, numbers: Ints) -> None:
        self.ranks, self.offsets, self.numbers = ranks, offsets, numbers
        self.own = int(offsets[ranks.rank + 1] - offsets[ranks.rank])
        at = np.searchsorted(numbers, offsets)
        self.starts = self.own + at  # the ghosts of each owner follow one another
        asked = ranks.exchange([numbers[a:b] for a, b in itertools.pairwise(at)])
        self.wanted = [np.asarray(each - offsets[ranks.rank], dtype=np.int64) for each in asked]
        self._givers = [rank for rank in range(ranks.size) if at[rank + 1] > at[rank]]
        self._takers = [rank for rank in range(ranks.size) if len(self.wanted[rank])]

    def __len__(self) -> int:
        return len(self.numbers)

    def update(self, values: Any) -> None:
        """Give ghosts the values of their owners, in place; `values` (n, k) of any type."""
        if not (self._givers or self._takers):
            return
        comm: Any = self.ranks.comm
        sent = [np.ascontiguousarray(values[self.wanted[rank]]) for rank in self._takers]
        open_ = [comm.Irecv(_bytes(values[self._of(rank)]), source=rank) for rank in self._givers]
        open_ += [comm.Isend(_bytes(one), dest=rank) for one, rank in zip(sent, self._takers, strict=True)]
        _wait(open_)

    def add(self, values: Any) -> None:
        """Add the values of ghosts to those of their owners, in place; the ghosts keep theirs."""
        if not (self._givers or self._takers):
            return
        comm: Any = self.ranks.comm
        came = [np.empty((len(self.wanted[rank]), *values.shape[1:]), values.dtype) for rank in self._takers]
        open_ = [comm.Irecv(_bytes(one), source=rank) for one, rank in zip(came, self._takers, strict=True)]
        open_ += [comm.Isend(_bytes(values[self._of(rank)]), dest=rank) for rank in self._givers]
        _wait(open_)
        for one, rank in zip(came, self._takers, strict=True):
            values[self.wanted[rank]] += one  # a rank has a node once

    def _of(self, rank: int) -> slice:
        """Return the rows of the ghosts that a rank owns."""
        return slice(int(self.starts[rank]), int(self.starts[rank + 1]))


def _bytes(values: Any) -> list[Any]:
    from mpi4py import MPI

    return [values, values.nbytes, MPI.BYTE]


def _wait(requests: list[Any]) -> None:
    from mpi4py import MPI

    MPI.Request.Waitall(requests)
