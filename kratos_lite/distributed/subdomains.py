"""Subdomains: of what ranks know of a mesh by ids, what each of them holds, with owners, numbers and halo.

Each id is looked after by one rank, which the others ask: no rank sees all of the mesh.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.distributed.halo import to_owners, with_halo
from kratos_lite.distributed.lookup import Lookup
from kratos_lite.distributed.node_directory import NodeDirectory
from kratos_lite.distributed.pieces import Kind, Piece, aligned, check_once, parts_here
from kratos_lite.distributed.scatter import scattered
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.blocks import ids_of
from kratos_lite.mesh.subdomain import Alone, Subdomain
from kratos_lite.records import replace
from kratos_lite.typing import Ints, Mask

__all__ = ["grown", "piece_of", "scattered", "subdomain_mesh"]


def subdomain_mesh(ranks: Alone, piece: Piece, *, layers: int = 1, source: str = "") -> Mesh:
    """Return what each rank holds of a mesh whose pieces the ranks give; all ranks call it.

    A node is own on the rank that a piece names, or else on the lowest that gives an element at it, or else
    on the lowest that knows it.  A condition is own on the lowest rank that owns a node of it.

    Parameters
    ----------
    ranks : the communicator.
    piece : what this rank gives.
    layers : of elements around the own nodes that are here, too.
    source : name of the file it came from, used in messages.

    Returns
    -------
    Mesh
        Nodes in their order, cells of each block in theirs; all ranks have the same blocks and parts, some of
        them empty.

    Raises
    ------
    MeshError
        Ranks disagree on a node, two give the same element, or nobody knows a node.

    Examples
    --------
    >>> from kratos_lite import box
    >>> from kratos_lite.mesh.subdomain import ALONE
    >>> subdomain_mesh(ALONE, piece_of(box())).subdomain.numbers.tolist()
    [0, 1, 2, 3, 4, 5, 6, 7]
    """
    with ranks.together():
        elements, conditions = aligned(ranks, piece.elements), aligned(ranks, piece.conditions)
        check_once(ranks, elements, "element")
        check_once(ranks, conditions, "condition")
        nodes = NodeDirectory(ranks, piece)
        elements, own, here = with_halo(nodes, elements, layers)
        conditions = to_owners(nodes, conditions)
        here, asked = nodes.ask(conditions, np.append(here, piece.wanted))
        order = np.argsort(asked.answer(nodes.order), kind="stable")
        here, owner = here[order], asked.answer(nodes.owner)[order]
        blocks, faces = _blocks(here, elements), _blocks(here, conditions)
        lowest = [owner[block.nodes].min(axis=1, initial=ranks.size) for block in faces]
        own_conditions = np.concatenate([np.zeros(0, dtype=np.int64), *lowest]) == ranks.rank
        have = {"nodes": here, "elements": ids_of(blocks), "conditions": ids_of(faces)}
        return Mesh(
            asked.answer(nodes.points)[order],
            blocks,
            node_ids=here,
            conditions=faces,
            parts=parts_here(ranks, piece.parts, have),
            source=source,
            subdomain=Subdomain(ranks, owner, asked.answer(nodes.numbers)[order], own, own_conditions),
        )


def _blocks(node_ids: Ints, kinds: tuple[Kind, ...]) -> list[Block]:
    """Return the blocks of kinds of cells whose nodes are all here."""
    here = Lookup(node_ids)
    return [kind.block(here.rows(kind.nodes)) for kind in kinds]


def piece_of(mesh: Mesh) -> Piece:
    """Return what a rank has of a mesh, by ids: the nodes, and its own cells."""

    def kinds(blocks: tuple[Block, ...], own: Mask) -> tuple[Kind, ...]:
        ends = np.cumsum([0, *map(len, blocks)])
        mine = [block.take(own[a:b]) for block, a, b in zip(blocks, ends, ends[1:], strict=False)]
        return tuple(
            Kind(b.name, mesh.node_ids[b.nodes], b.ids, b.properties, b.shape, b.lines, place)
            for place, b in enumerate(mine)
        )

    ids: dict[str, Any] = {
        "nodes": mesh.node_ids,
        "elements": mesh.element_ids,
        "conditions": ids_of(mesh.conditions),
    }
    share = mesh.subdomain
    return Piece(
        kinds(mesh.blocks, mesh.own_elements),
        kinds(mesh.conditions, mesh.own_conditions),
        mesh.node_ids,
        mesh.points,
        None if share is None else share.owner,
        np.arange(mesh.n_nodes) if share is None else share.numbers,
        {
            name: replace(part, **{what: ids[what][getattr(part, what)] for what in ids})
            for name, part in mesh.parts.items()
        },
        mesh.node_ids,
    )


def grown(mesh: Mesh, layers: int = 2) -> Mesh:
    """Return what a rank holds with another number of layers of elements around its own nodes.

    The own nodes stand in the same order and keep their numbers; all ranks call it.

    Parameters
    ----------
    mesh : with a subdomain.
    layers : of elements.
    """
    return subdomain_mesh(mesh.ranks, piece_of(mesh), layers=layers, source=mesh.source)
