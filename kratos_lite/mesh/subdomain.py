"""Subdomain: what one process (rank) holds of a mesh that many share; and the communicator of one process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any

import numpy as np

from kratos_lite.typing import Ints, Mask, Numbers


class Alone:
    """The communicator of a process that holds the whole mesh: each reduction returns what it is given."""

    rank = 0
    size = 1

    def sum(self, value: Any) -> Any:
        """Return the sum over ranks of a number or of each entry of an array, the same on all ranks."""
        return value

    def max(self, value: Any) -> Any:
        """Return the largest over ranks, entry by entry."""
        return value

    def min(self, value: Any) -> Any:
        """Return the smallest over ranks, entry by entry."""
        return value

    def any(self, value: Any) -> Any:
        """Return whether it is true on any rank, entry by entry."""
        return value

    def all(self, value: Any) -> Any:
        """Return whether it is true on all ranks, entry by entry."""
        return value

    def gather(self, value: Any) -> list[Any]:
        """Return the value of each rank, on all ranks; for small values."""
        return [value]

    def first(self, value: Any) -> Any:
        """Return the value of the first rank that has one, not None; None if none has."""
        return next((one for one in self.gather(value) if one is not None), None)

    def exchange(self, arrays: Sequence[Any]) -> list[Any]:
        """Send array i to rank i, and return what each rank has sent here.

        Parameters
        ----------
        arrays : one for each rank, with as many rows as there is to send; all of one type and row shape.
        """
        return list(arrays)

    def send(self, to: Ints, values: Numbers) -> list[Any]:
        """Send each row of values (k, ...) to a rank (k,); return what each rank has sent here."""
        order = np.argsort(to, kind="stable")
        ends = np.cumsum(np.bincount(to, minlength=self.size))[:-1]
        return self.exchange(np.split(values[order], ends))

    def ask(self, to: Ints, questions: Numbers, answer: Callable[[Any], Any]) -> Any:
        """Return what ranks (k,) answer to questions (k, ...), each for itself: (k, ...)."""
        came = self.send(to, questions)
        ends = np.cumsum([len(one) for one in came])[:-1]
        replies = np.concatenate(self.exchange(np.split(answer(np.concatenate(came)), ends)))
        found = np.empty_like(replies)
        found[np.argsort(to, kind="stable")] = replies
        return found

    def agree(self) -> None:
        """Raise on all ranks the error that one of them has met."""

    @contextmanager
    def together(self) -> Iterator[None]:
        """Let an error that a rank raises inside end the block on all ranks, with that same error."""
        yield


ALONE = Alone()


class Subdomain:
    """The nodes and cells of one rank: its own ones, and copies of those of others around them.

    Each node and each cell is own on one rank.  Every element that touches an own node is here, so that
    sums over elements are complete at own nodes; at the others, the ghosts, they are not.

    Parameters
    ----------
    ranks : the communicator.
    owner : (n,) int, rank that owns each node.
    numbers : (n,) int, number of each node among those of all ranks: from 0, ascending by owner, and on each
        by its rows.
    own_elements, own_conditions : (m,) bool.
    """

    def __init__(
        self, ranks: Alone, owner: Ints, numbers: Ints, own_elements: Mask, own_conditions: Mask
    ) -> None:
        self.ranks = ranks
        self.owner, self.numbers = np.asarray(owner, dtype=np.int32), np.asarray(numbers, dtype=np.int64)
        self.own_elements, self.own_conditions = own_elements, own_conditions

    def __deepcopy__(self, memo: Any) -> Subdomain:
        return self

    @cached_property
    def mine(self) -> Mask:
        """(n,) bool, the own nodes."""
        own: Mask = self.owner == self.ranks.rank
        return own

    @cached_property
    def own_nodes(self) -> Ints:
        """Rows of the own nodes, ascending."""
        return np.flatnonzero(self.mine)

    @cached_property
    def offsets(self) -> Ints:
        """(size + 1,) int, first number of the nodes of each rank; the last is the number of all nodes."""
        counts = self.ranks.gather(len(self.own_nodes))
        return np.concatenate([[0], np.cumsum(counts)])

    @property
    def n_all(self) -> int:
        """Number of nodes of all ranks."""
        return int(self.offsets[-1])

    @cached_property
    def _plan(self) -> tuple[list[Ints], list[Ints]]:
        """By rank: rows of the ghosts that it owns, and rows of the own nodes that are ghosts there."""
        ghosts = [np.flatnonzero(self.owner == rank) for rank in range(self.ranks.size)]
        ghosts[self.ranks.rank] = np.zeros(0, dtype=np.int64)
        first = self.offsets[self.ranks.rank]
        asked = self.ranks.exchange([self.numbers[rows] for rows in ghosts])
        return ghosts, [self.own_nodes[numbers - first] for numbers in asked]

    def fetch(self, values: Numbers) -> Any:
        """Return nodal values (n, ...) with those of ghosts taken from their owners; all ranks call it."""
        ghosts, wanted = self._plan
        out = np.array(values)
        for rows, came in zip(ghosts, self.ranks.exchange([out[rows] for rows in wanted]), strict=True):
            out[rows] = came
        return out

    def add(self, values: Numbers) -> Any:
        """Return nodal values (n, ...) summed over the ranks that have the node; all ranks call it."""
        ghosts, wanted = self._plan
        out = np.array(values)
        for rows, came in zip(wanted, self.ranks.exchange([out[rows] for rows in ghosts]), strict=True):
            out[rows] += came  # a rank asks for a node once
        return self.fetch(out)
