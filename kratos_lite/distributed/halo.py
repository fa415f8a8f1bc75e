"""Halo: cells go to all ranks that own a node of them, or that have a node of them already."""

from __future__ import annotations

import numpy as np

from kratos_lite.distributed.directory import Route, all_of
from kratos_lite.distributed.node_directory import NodeDirectory
from kratos_lite.distributed.pieces import Kind, cell_ids
from kratos_lite.mesh import NO_ROWS, distinct, rows_of_ids
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.typing import Ints, Mask


def with_halo(nodes: NodeDirectory, kinds: tuple[Kind, ...], layers: int) -> tuple[tuple[Kind, ...], Mask]:
    """Return the elements that are here with some layers around the own nodes, and which of them are own.

    Parameters
    ----------
    nodes : of all ranks.
    kinds : own elements, the same kinds on all ranks.
    layers : of elements.
    """
    ranks, found = nodes.ranks, kinds
    touched = _nodes_of(kinds)
    ids, holders = nodes.directory.ids, nodes.owner
    for layer in range(layers):
        if layer:  # the nodes that are here hold the next layer
            ids = distinct(np.append(nodes.own, _nodes_of(found)))
            holders = np.full(len(ids), ranks.rank)
        at, there = all_of(ranks, ids, holders[:, None], touched)
        others = there[:, 0] != ranks.rank
        at, there = at[others], there[others, 0]
        found = tuple(
            kind.with_table(np.concatenate([kind.table, _sent(ranks, kind, at, there)])) for kind in kinds
        )
    return found, rows_of_ids(cell_ids(kinds), cell_ids(found)) >= 0


def _nodes_of(kinds: tuple[Kind, ...]) -> Ints:
    """Return the ids of the nodes of cells, ascending."""
    return distinct(np.concatenate([NO_ROWS, *(kind.nodes.ravel() for kind in kinds)]))


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
    first = np.searchsorted(ids, kind.nodes)
    counts = np.searchsorted(ids, kind.nodes, side="right") - first
    cells = np.repeat(np.arange(len(kind.ids)), counts.sum(axis=1))
    counts, first = counts.ravel(), first.ravel()
    at = np.repeat(first - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
    pairs = distinct(cells * ranks.size + holders[at])
    return Route(ranks, pairs % ranks.size).send(kind.table[pairs // ranks.size])
