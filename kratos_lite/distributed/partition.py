"""Partition: how the parts of a mesh that no process has whole hang together."""

from __future__ import annotations

import itertools
import pickle
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.distributed.communicator import Alone
from kratos_lite.distributed.cut import NO_DEPENDENTS, Part
from kratos_lite.errors import MeshError
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array, Ints, Mask, Numbers


class Partition:
    """What a rank knows of the nodes of its part, an ordinary mesh; all ranks make it and call it."""

    def __init__(self, ranks: Alone, mesh: Mesh) -> None:
        self.ranks, self.rank, self.size = ranks, ranks.rank, ranks.size
        self.sum, self.max, self.gather = ranks.sum, ranks.max, ranks.gather
        self.agree_on_errors = ranks.agree_on_errors
        for block in mesh.blocks:
            self._check_once(block.ids)
        order = np.argsort(mesh.node_ids, kind="stable")
        self.owner = np.empty(mesh.n_nodes, dtype=np.int64)  # rank that owns each node, the lowest of those
        self.owner[order] = _owners(ranks, mesh.node_ids[order], mesh.points[order])
        self.own: Mask = self.owner == ranks.rank
        rows = np.flatnonzero(self.own)
        self.offsets = np.concatenate([[0], np.cumsum(ranks.gather(len(rows)))])
        self.number = np.full(mesh.n_nodes, -1)  # among the nodes of all ranks, ascending by owner
        self.number[rows] = self.offsets[ranks.rank] + np.arange(len(rows))
        ids = mesh.node_ids[rows]
        by_id = np.argsort(ids, kind="stable")
        ghosts = [np.flatnonzero((self.owner == rank) & ~self.own) for rank in range(ranks.size)]
        asked = ranks.exchange([mesh.node_ids[some] for some in ghosts])
        own = [rows[by_id[np.searchsorted(ids[by_id], some)]] for some in asked]
        self._ghosts, self._asked = ghosts, own
        self.number = self.fetch(self.number)

    def _check_once(self, ids: Ints) -> None:
        """Raise MeshError for an element that two parts have."""
        to = ids % self.ranks.size
        came = np.sort(np.concatenate(self.ranks.exchange([ids[to == r] for r in range(self.ranks.size)])))
        twice = came[1:][came[1:] == came[:-1]]
        with self.ranks.agree_on_errors():
            if len(twice):
                raise MeshError(f"element {twice[0]} is in two parts; make the parts anew")

    # ---- values of nodes ---------------------------------------------------------------------------

    def fetch(self, values: Numbers) -> Any:
        """Return nodal values (n, ...) with those of nodes that others own taken from these."""
        out = np.array(values)
        for rows, came in zip(
            self._ghosts, self.ranks.exchange([out[some] for some in self._asked]), strict=True
        ):
            out[rows] = came
        return out

    def add(self, values: Numbers) -> Any:
        """Return nodal values (n, ...) summed over the parts that have the node."""
        out = np.array(values)
        for rows, came in zip(
            self._asked, self.ranks.exchange([out[some] for some in self._ghosts]), strict=True
        ):
            out[rows] += came  # a part has a node once
        return self.fetch(out)

    @cached_property
    def _shared_by(self) -> Array:
        return np.asarray(self.add(np.ones(len(self.owner))))

    def average(self, values: Array) -> Array:
        """Return nodal values (n, ...) averaged over the parts that have the node."""
        return np.asarray(self.add(values) / self._shared_by.reshape(-1, *[1] * (values.ndim - 1)))

    # ---- equations ---------------------------------------------------------------------------------

    def equations(self, points: Array, groups: Sequence[ElementGroup], held: Mask) -> Part:
        """Return the equations of this rank, with all elements at own nodes; `held` (n, 3) is prescribed."""
        has = np.zeros(len(points), dtype=bool)
        for group in groups:
            has[group.nodes] = True
        has = np.asarray(self.add(has.astype(np.int8)) > 0) & ~held.all(axis=1)
        rows = np.flatnonzero(has & self.own)
        counts = self.ranks.gather(len(rows))
        equation = np.full(len(points), -1)
        equation[rows] = sum(counts[: self.ranks.rank]) + np.arange(len(rows))
        equation = self.fetch(equation)
        return self._with_halo(points, list(groups), held, rows, equation)

    def _with_halo(
        self, points: Array, groups: list[ElementGroup], held: Mask, own: Ints, equation: Ints
    ) -> Part:
        """Return the equations with the elements of other parts at own nodes, which these send."""
        all_groups = self._groups_of_all(groups)
        about = np.column_stack([self.number, equation, held, points])  # numbers are whole up to 2^53
        tables = []
        for group in all_groups:
            nodes = group.nodes
            to = [np.asarray((self.owner[nodes] == r).any(axis=1)) for r in range(self.ranks.size)]
            to[self.ranks.rank][:] = False
            tables.append(np.concatenate(self.ranks.exchange([about[nodes[chosen]] for chosen in to])))
        every = np.concatenate([about, *(table.reshape(-1, 8) for table in tables)])
        numbers, first = np.unique(every[:, 0], return_index=True)
        row = np.full(len(numbers), -1)
        row[np.searchsorted(numbers, self.number)] = np.arange(len(points))
        new = np.flatnonzero(row < 0)
        row[new] = len(points) + np.arange(len(new))
        every = every[np.concatenate([np.arange(len(points)), first[new]])]
        whole = []
        for group, table in zip(all_groups, tables, strict=True):
            halo = row[np.searchsorted(numbers, table[..., 0])].astype(np.int32)
            nodes = np.concatenate([group.nodes, halo])
            whole.append(replace(group, nodes=nodes, rows=np.arange(len(nodes))))
        fixed, places = every[:, 2:5].astype(bool), np.ascontiguousarray(every[:, 5:])
        return Part(places, whole, own, every[:, 1].astype(np.int64), ~fixed, fixed, NO_DEPENDENTS)

    def _groups_of_all(self, groups: list[ElementGroup]) -> list[ElementGroup]:
        """Return the groups that any rank has, in the same order on all, empty where this one has none."""
        empty = [replace(g.without_initial, nodes=g.nodes[:0], rows=g.rows[:0]) for g in groups]
        here = {pickle.dumps(kind): group for kind, group in zip(empty, groups, strict=True)}
        every = dict.fromkeys(itertools.chain(*self.ranks.gather(list(here))))
        return [here[kind] if kind in here else pickle.loads(kind) for kind in every]


def _owners(ranks: Alone, ids: Ints, points: Array) -> Ints:
    """Return who owns nodes, with ascending ids: one rank looks after each id, and the others ask it."""
    to = ids % ranks.size
    order = np.argsort(to, kind="stable")
    cuts = np.searchsorted(to[order], np.arange(1, ranks.size))
    asked = ranks.exchange(np.split(ids[order], cuts))
    places = np.concatenate(ranks.exchange(np.split(points[order], cuts)))
    known = np.concatenate(asked)
    of_rank = np.repeat(np.arange(ranks.size), [len(some) for some in asked])
    _, first, inverse = np.unique(known, return_index=True, return_inverse=True)  # first, so of the lowest
    first_of = first[inverse]
    with ranks.agree_on_errors():
        apart = np.flatnonzero((places != places[first_of]).any(axis=1))
        if len(apart):
            at, other = apart[0], first_of[apart[0]]
            raise MeshError(
                f"node {known[at]} lies at {places[other].tolist()} m in part {of_rank[other]} and at "
                f"{places[at].tolist()} m in part {of_rank[at]}; make the parts anew"
            )
    ends = np.cumsum([len(some) for some in asked])[:-1]
    owner = np.empty(len(ids), dtype=np.int64)
    owner[order] = np.concatenate(ranks.exchange(np.split(of_rank[first_of], ends)))
    return owner
