"""Ghosts: copies of nodes of other ranks behind the own ones, and their exchange."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from kratos_lite.distributed.communicator import Alone
from kratos_lite.typing import Ints


class Ghosts:
    """The ghosts of a rank, after its own nodes in nodal arrays; all ranks call each method."""

    def __init__(self, ranks: Alone, offsets: Ints, numbers: Ints) -> None:
        self.ranks = ranks
        self.offsets = offsets  # (size + 1,), the first number of the nodes of each rank
        self.numbers = numbers  # (g,) of the ghosts, ascending
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
        """Give ghosts the values of their owners, in place; `values` (n, k) of numbers."""
        comm: Any = self.ranks.comm
        sent = [values[self.wanted[rank]] for rank in self._takers]
        requests = [comm.Irecv(values[self._of(rank)], rank) for rank in self._givers]
        requests += [comm.Isend(copies, rank) for copies, rank in zip(sent, self._takers, strict=True)]
        for request in requests:
            request.Wait()

    def add(self, values: Any) -> None:
        """Add the values of ghosts to those of their owners, in place; the ghosts keep theirs."""
        comm: Any = self.ranks.comm
        received = [np.empty_like(values[self.wanted[rank]]) for rank in self._takers]
        requests = [comm.Irecv(copies, rank) for copies, rank in zip(received, self._takers, strict=True)]
        requests += [comm.Isend(values[self._of(rank)], rank) for rank in self._givers]
        for request in requests:
            request.Wait()
        for copies, rank in zip(received, self._takers, strict=True):
            values[self.wanted[rank]] += copies  # a rank has a node once

    def _of(self, rank: int) -> slice:
        """Return the rows of the ghosts that a rank owns."""
        return slice(int(self.starts[rank]), int(self.starts[rank + 1]))
