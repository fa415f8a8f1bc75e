"""Halo: cells go to all ranks that own a node of them, or that have a node of them already."""

from __future__ import annotations

import numpy as np

from kratos_lite.distributed.directory import Route, all_of
from kratos_lite.distributed.lookup import Lookup, merged
from kratos_lite.distributed.node_directory import NodeDirectory
from kratos_lite.distributed.pieces import Kind, cell_ids
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.typing import Ints, Mask


def with_halo(
    nodes: NodeDirectory, kinds: tuple[Kind, ...], layers: int
) -> tuple[tuple[Kind, ...], Mask, Ints]:
    """Return the elements here, with layers around the own nodes; which are own; and the ids of their nodes.

    Parameters
    ----------
    nodes : of all ranks.
    kinds : own elements, the same kinds on all ranks.
    layers : of elements.
    """
    ranks, here = nodes.ranks, merged(nodes.own, nodes.touched)
    ids, holders = nodes.directory.ids, nodes.owner
    halo = [kind.table[:0] for kind in kinds]
    for layer in range(layers):
        if layer:  # the nodes that are here hold the next layer
            ids, holders = here, np.full(len(here), ranks.rank)
        at, there = all_of(ranks, ids, holders[:, None], nodes.touched)
        others = there[:, 0] != ranks.rank
        halo = [_sent(ranks, kind, at[others], there[others, 0]) for kind in kinds]
        here = merged(here, *(table[:, 3:] for table in halo))
    found = tuple(
        kind.with_table(np.concatenate([kind.table, table])) for kind, table in zip(kinds, halo, strict=True)
    )
    return found, Lookup(cell_ids(kinds)).rows(cell_ids(found)) >= 0, here


def to_owners(nodes: NodeDirectory, kinds: tuple[Kind, ...]) -> tuple[Kind, ...]:
    """Return the conditions that have an own node; those given here go to all owners of their nodes."""
    ids, asked = nodes.ask(kinds)
    owners = asked.answer(nodes.owner)
    return tuple(kind.with_table(_sent(nodes.ranks, kind, ids, owners)) for kind in kinds)


def _sent(ranks: Alone, kind: Kind, ids: Ints, holders: Ints) -> Ints:
    """Return the tables (q, 3 + k) of the cells that arrive when each goes to the holders of its nodes.

    Parameters
    ----------
    ids, holders : (p,) int, pairs of a node and a rank.
    """
    order = np.argsort(ids, kind="stable")
    ids, holders = ids[order], holders[order]
    starts = np.flatnonzero(np.append(True, ids[1:] != ids[:-1])) if len(ids) else ids
    counts = np.diff(np.append(starts, len(ids)))
    rows = Lookup(ids[starts]).rows(kind.nodes)
    cells, columns = np.nonzero(rows >= 0)
    rows = rows[cells, columns]
    counts, starts = counts[rows], starts[rows]
    at = np.repeat(starts - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
    pairs = merged(np.repeat(cells, counts) * ranks.size + holders[at])
    return Route(ranks, pairs % ranks.size).send(kind.table[pairs // ranks.size])
