"""The multigrid of `kratos_lite.solvers.multigrid` over ranks, as a preconditioner.

Each rank keeps the rows of its own nodes of every level; a step of the smoother needs one exchange of ghosts.
The coarsest level is factorized on every rank.  Not used over several ranks: lines, planes and patches that
are solved exactly in stretched meshes.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from kratos_lite.distributed.communicator import Alone
from kratos_lite.native import kernels
from kratos_lite.solvers.multigrid import DEGREE, RATIO, STRENGTH
from kratos_lite.typing import Array, Ints, Mask

FULL = 600
"""Unknowns of all ranks that are factorized on each."""
FULL_LIMIT = 3000
"""The same where aggregation has come to a halt; above, the coarsest level is smoothed well."""


class Level:
    """One level on this rank: what its kernel calls between steps, with memory of its vectors (all, b)."""

    def __init__(self, ghosts: Ghosts, b: int) -> None:
        self.ghosts, self.b, self.ranks = ghosts, b, ghosts.ranks  # b unknowns of a node
        self.sum, self.max = ghosts.ranks.sum, ghosts.ranks.max
        self.inverse: Any = None

    @property
    def unknowns(self) -> int:
        """Number of unknowns of all ranks."""
        return self.b * int(self.ghosts.offsets[-1])

    def update(self, memory: Any) -> None:
        """Give ghosts the values of their owners."""
        self.ghosts.update(self._nodal(memory))

    def add(self, memory: Any) -> None:
        """Add the values of ghosts to those of their owners."""
        self.ghosts.add(self._nodal(memory))

    def solve(self, c: Any, x: Any) -> bool:
        """Solve A x = c, if it is factorized."""
        if self.inverse is None:
            return False
        own = self.ghosts.own
        forces = np.concatenate(self.ranks.gather(self._nodal(c)[:own].ravel()))
        self._nodal(x)[:own] = (self.inverse @ forces).reshape(own, self.b)
        return True

    def _nodal(self, memory: Any) -> Any:
        return np.frombuffer(memory, np.float32).reshape(-1, self.b)

    def factorize(self, A: Rows) -> None:
        """Take the own rows of the inverse of A, of which each rank has its own rows."""
        ghosts, first = self.ghosts, int(self.ghosts.offsets[self.ranks.rank])
        numbers = np.concatenate([first + np.arange(ghosts.own), ghosts.numbers])
        full = np.zeros((ghosts.own, 6, self.unknowns // 6, 6))
        row = np.repeat(np.arange(ghosts.own), np.diff(A.indptr))
        full[row, :, numbers[A.columns]] = A.data.reshape(-1, 6, 6)
        matrix = np.concatenate(self.ranks.gather(full.reshape(6 * ghosts.own, self.unknowns)))
        inverse = np.linalg.pinv((matrix + matrix.T) / 2, rcond=1e-13, hermitian=True)
        self.inverse = inverse[6 * first : 6 * (first + ghosts.own)]


class Multigrid:
    """V-cycles over ranks, with compiled kernels alone; all ranks call each method."""

    def __init__(self, rank: int) -> None:
        self._kernel = kernels("multigrid").RankMultigrid(DEGREE, RATIO, STRENGTH, rank)
        self.levels: list[Level] = []  # from the finest to the coarsest

    def add_product(self, product: Any, ghosts: Ghosts, fixed: Mask) -> None:
        """Add the finest level, of elements; `fixed` (all, 3) as in `add`."""
        self.levels.append(Level(ghosts, 3))
        self._kernel.add_product(product, ghosts.own, fixed.ravel().astype(np.uint8), self.levels[-1])

    def add(self, A: Any, ghosts: Ghosts, fixed: Mask, P: Any = None) -> None:
        """Add a level of own rows of blocks A, P the prolongator to the one above; `fixed` is (all, b)."""
        self.levels.append(Level(ghosts, fixed.shape[1]))
        self._kernel.add_matrix(A, fixed.ravel().astype(np.uint8), self.levels[-1], P)

    def coarsen(self, modes: Array, all_nodes: int) -> None:
        """Add levels by smoothed aggregation of the last one, with modes (n, b, 6) of its own nodes."""
        last, A = self.levels[-1], None
        while last.unknowns > FULL:
            found = coarsened(self._kernel, last.ghosts, all_nodes, last.b, modes)
            if found is None:
                break
            A, P, modes = found.A, found.P, found.modes
            all_nodes = found.ghosts.own + len(found.ghosts)
            rows = A.indptr, A.columns, A.data.reshape(-1, 6, 6)
            way = P.indptr, P.columns, np.ascontiguousarray(P.data).reshape(-1, last.b, 6)
            self.add(rows, found.ghosts, np.zeros((all_nodes, 6), dtype=bool), way)
            last = self.levels[-1]
        if A is not None and last.unknowns <= FULL_LIMIT:
            last.factorize(A)
        self._kernel.finish()

    def precondition(self, r: Array) -> Array:
        """Return one V-cycle on the residual of own nodes (n · b,)."""
        return np.asarray(self._kernel.cycle(np.ascontiguousarray(r)))


# ---- copies of nodes of other ranks, and their exchange ---------------------------------------------------


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


# ---- from one level to the next: smoothed aggregation and the Galerkin product ----------------------------

# Each rank joins its own nodes to aggregates; the prolongator and the product P^T A P reach over ranks.
# Source: Vaněk, Mandel & Brezina, Computing 56 (1996) 179-196; Tuminaro & Tong, Parallel smoothed aggregation
# multigrid, Supercomputing 2000 (aggregates within ranks).
LEAST_GAIN = 0.9
"""Unknowns of a level to those of the level above, beyond which coarsening has come to a halt."""


@dataclass(eq=False)
class Rows:
    """Rows of blocks of a sparse matrix, with columns by number over all ranks."""

    indptr: Ints  # (m + 1,), where each row starts
    columns: Ints  # (nnz,)
    data: Array  # (nnz, k)

    def __len__(self) -> int:
        return len(self.indptr) - 1

    def local(self, own: int, first: int, ghosts: Ints) -> Rows:
        """Return them with columns by place: own nodes from 0, then ghosts; ascending within a row."""
        is_own = (self.columns >= first) & (self.columns < first + own)
        place = np.where(is_own, self.columns - first, own + np.searchsorted(ghosts, self.columns))
        row = np.repeat(np.arange(len(self)), np.diff(self.indptr))
        order = np.lexsort((place, row))
        return Rows(self.indptr.astype(np.int32), place[order].astype(np.int32), self.data[order])

    def elsewhere(self, own: int, first: int) -> Ints:
        """Return the numbers of the columns that are not own, ascending."""
        return np.unique(self.columns[(self.columns < first) | (self.columns >= first + own)])


class Coarser(NamedTuple):
    """The next level: its ghosts, own rows of its matrix and of the prolongator, and modes (m, 6, 6)."""

    ghosts: Ghosts
    A: Rows
    P: Rows
    modes: Array


def coarsened(kernel: Any, ghosts: Ghosts, all_nodes: int, b: int, modes: Array) -> Coarser | None:
    """Return the next level, or None if it would have hardly fewer unknowns."""
    ranks, own = ghosts.ranks, ghosts.own
    of, count = kernel.aggregates()
    offsets = np.concatenate([[0], np.cumsum(ranks.gather(count))])
    if not 0 < 6 * offsets[-1] <= LEAST_GAIN * b * ghosts.offsets[-1]:
        return None
    first = int(offsets[ranks.rank])
    T, R = kernel.tentative(of, count, np.ascontiguousarray(modes, dtype=float))
    aggregate = np.full((all_nodes, 1), -1, dtype=np.int64)
    aggregate[:own, 0] = np.where(of >= 0, of + first, -1)
    ghosts.update(aggregate)
    modes_of = np.zeros((all_nodes, 6 * b))
    modes_of[:own] = T.reshape(own, 6 * b)
    ghosts.update(modes_of)
    P = _prolongator(kernel, aggregate[:, 0], modes_of, count, first)
    around = _rows_of_ghosts(P, ghosts, all_nodes)
    A = _galerkin(kernel, ranks, around, offsets)
    _stand_alone(A, first)
    below = Ghosts(ranks, offsets, np.union1d(A.elsewhere(count, first), P.elsewhere(count, first)))
    A, P = (rows.local(count, first, below.numbers) for rows in (A, P))
    return Coarser(below, A, P, R.reshape(count, 6, 6))


def _prolongator(kernel: Any, aggregate: Ints, T: Array, count: int, first: int) -> Rows:
    """Return own rows of T - omega D^-1 A T."""
    is_own = (aggregate >= first) & (aggregate < first + count)
    others = np.unique(aggregate[(aggregate >= 0) & ~is_own])
    of = np.where(is_own, aggregate - first, count + np.searchsorted(others, aggregate))
    of[aggregate < 0] = -1
    indptr, indices, data = kernel.prolongator(of.astype(np.int32), np.ascontiguousarray(T))
    numbers = np.concatenate([first + np.arange(count), others])
    return Rows(indptr, numbers[indices], data.reshape(len(indices), T.shape[1]))


def _rows_of_ghosts(P: Rows, ghosts: Ghosts, all_nodes: int) -> Rows:
    """Return the rows of a prolongator at own nodes and at ghosts; those of other nodes are empty."""
    lengths = np.zeros((ghosts.own + len(ghosts), 1), dtype=np.int64)
    lengths[: ghosts.own, 0] = np.diff(P.indptr)
    ghosts.update(lengths)
    sent = [_places(P.indptr, rows) for rows in ghosts.wanted]
    columns = ghosts.ranks.exchange([P.columns[places] for places in sent])
    data = ghosts.ranks.exchange([P.data[places] for places in sent])
    ends = np.zeros(all_nodes + 1, dtype=np.int64)
    ends[1 : len(lengths) + 1] = np.cumsum(lengths[:, 0])
    ends[len(lengths) + 1 :] = ends[len(lengths)]
    return Rows(ends, np.concatenate([P.columns, *columns]), np.concatenate([P.data, *data]))


def _places(indptr: Ints, rows: Ints) -> Ints:
    """Return the places of the entries of some rows, one row after the other."""
    counts = (indptr[rows + 1] - indptr[rows]).astype(np.int64)
    ends = np.cumsum(counts)
    return np.arange(counts.sum()) + np.repeat(indptr[rows] - (ends - counts), counts)


def _galerkin(kernel: Any, ranks: Alone, P: Rows, offsets: Ints) -> Rows:
    """Return own rows of P^T A P: the sum of what the rows of all ranks give."""
    first, last = int(offsets[ranks.rank]), int(offsets[ranks.rank + 1])
    others = P.elsewhere(last - first, first)
    local = P.local(last - first, first, others)
    numbers = np.concatenate([np.arange(first, last), others])
    indptr, indices, data = kernel.galerkin(local.indptr, local.columns, local.data, len(numbers))
    rows = numbers[np.repeat(np.arange(len(numbers)), np.diff(indptr))]
    columns, data = numbers[indices], data.reshape(len(indices), 36)
    owner = np.searchsorted(offsets, rows, side="right") - 1
    to = [owner == rank for rank in range(ranks.size)]
    rows, columns, data = (
        np.concatenate(ranks.exchange([values[some] for some in to])) for values in (rows, columns, data)
    )
    return _summed(rows - first, columns, data, last - first)


def _summed(rows: Ints, columns: Ints, data: Array, count: int) -> Rows:
    """Return rows in which entries of the same row and column are added."""
    order = np.lexsort((columns, rows))
    rows, columns = rows[order], columns[order]
    new = np.flatnonzero(np.append(True, (rows[1:] != rows[:-1]) | (columns[1:] != columns[:-1])))
    new = new[: len(rows)]
    sums = np.add.reduceat(data[order], new, axis=0) if len(rows) else data
    counts = np.bincount(rows[new], minlength=count)
    return Rows(np.concatenate([[0], np.cumsum(counts)]), columns[new], sums)


def _stand_alone(A: Rows, first: int) -> None:
    """Give components without stiffness, modes that an aggregate cannot tell apart, a diagonal of 1."""
    rows = np.repeat(np.arange(len(A)), np.diff(A.indptr))
    at = np.flatnonzero(A.columns == rows + first)
    diagonal = A.data[at, ::7]
    A.data[at[:, None], np.arange(0, 36, 7)] = np.where(diagonal > 0, diagonal, 1.0)
