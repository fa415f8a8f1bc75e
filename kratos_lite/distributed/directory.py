"""Directory: where ranks ask for what others know by id; each id is looked after by one rank."""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.distributed.lookup import Lookup, merged
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.typing import Ints, Mask

IN_TURN = 64
"""Ids that follow each other and are looked after by the same rank; the next ones by the next rank."""


class Route:
    """Rows on their way to other ranks, and the answers on their way back; all ranks make and use it.

    Parameters
    ----------
    ranks : the communicator.
    to : (k,) int, the rank to which each row goes.

    Attributes
    ----------
    sources : (q,) int, the rank from which each row has come that arrives here.
    """

    def __init__(self, ranks: Alone, to: Any) -> None:
        to = np.asarray(to, dtype=np.int64)
        self.ranks = ranks
        self._order = np.argsort(to, kind="stable")
        counts = np.bincount(to, minlength=ranks.size)
        arriving = np.concatenate(ranks.exchange(list(counts[:, None])))
        self._leaves, self._arrives = np.cumsum(counts)[:-1], np.cumsum(arriving)[:-1]
        self.sources: Ints = np.repeat(np.arange(ranks.size), arriving)

    def send(self, values: Any) -> Any:
        """Return what arrives here of values (k, ...), by source and in its order there."""
        parted = np.split(np.asarray(values)[self._order], self._leaves)
        return np.concatenate(self.ranks.exchange(parted))

    def back(self, answers: Any) -> Any:
        """Return the answers (k, ...) to the rows sent; each rank gives those to what has arrived there."""
        came = np.concatenate(self.ranks.exchange(np.split(np.asarray(answers), self._arrives)))
        out = np.empty_like(came)
        out[self._order] = came
        return out


def home(ranks: Alone, ids: Ints) -> Ints:
    """Return the rank that looks after each id."""
    return ids // IN_TURN % ranks.size


class Asked:
    """Ids (k,) for which this rank asks a directory, and what the directory is asked for here.

    Attributes
    ----------
    sources : (q,) int, the ranks that ask.
    rows : (q,) int, rows of `Directory.ids`; -1 for ids that are not among them.
    """

    def __init__(self, ranks: Alone, ids: Ints, known: Ints | None = None) -> None:
        self._route = Route(ranks, home(ranks, ids))
        arrived = self._route.send(ids)
        self.known = merged(arrived) if known is None else known
        self.sources, self.rows = self._route.sources, Lookup(self.known).rows(arrived)

    def tell(self, values: Any) -> Any:
        """Return at the directory, (q, ...), what the ranks say of their ids, (k, ...)."""
        return self._route.send(values)

    def has(self) -> Mask:
        """Return whether each id (k,) is in the directory."""
        mask: Mask = self._route.back(self.rows >= 0)
        return mask

    def answer(self, table: Any) -> Any:
        """Return (k, ...) of a table (n, ...) of what each rank looks after; every id must be there."""
        return self._route.back(table[self.rows])


class Directory:
    """The ids that any rank knows; all ranks make and use it.

    Parameters
    ----------
    ranks : the communicator.
    ids : (k,) int, ids that this rank knows; several may know the same.

    Attributes
    ----------
    ids : (n,) int, those that this rank looks after, ascending.
    given : what the ranks have given.
    """

    def __init__(self, ranks: Alone, ids: Ints) -> None:
        self.ranks = ranks
        self.given = Asked(ranks, ids)
        self.ids = self.given.known

    def ask(self, ids: Ints) -> Asked:
        """Return a question for ids (k,)."""
        return Asked(self.ranks, ids, self.ids)


def all_of(ranks: Alone, ids: Ints, values: Any, wanted: Ints) -> tuple[Ints, Any]:
    """Return every value that ranks have given for the wanted ids: ids (q,) and values (q, c).

    Parameters
    ----------
    ids, values : (k,) int and (k, c), what this rank gives; an id may have any number of values.
    wanted : (w,) int, each once.
    """
    route = Route(ranks, home(ranks, ids))
    ids, values = route.send(ids), route.send(values)
    order = np.argsort(ids, kind="stable")
    ids, values = ids[order], values[order]
    asked = Route(ranks, home(ranks, wanted))
    looked_for = asked.send(wanted)
    first = np.searchsorted(ids, looked_for)
    counts = np.searchsorted(ids, looked_for, side="right") - first
    found = np.repeat(first - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
    answers = Route(ranks, np.repeat(asked.sources, counts))
    return answers.send(ids[found]), answers.send(values[found])
