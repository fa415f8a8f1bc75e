"""Subdomains: of what ranks know of a mesh by ids, what each of them holds, with owners, numbers and halo.

Each id is looked after by one rank, which the others ask: no rank sees all of the mesh.
"""

from __future__ import annotations

import numpy as np

from kratos_lite.distributed.halo import to_owners, with_halo
from kratos_lite.distributed.lookup import Lookup
from kratos_lite.distributed.node_directory import NodeDirectory
from kratos_lite.distributed.pieces import Kind, Piece, aligned, check_once, parts_here
from kratos_lite.distributed.scatter import scattered
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.blocks import ids_of
from kratos_lite.mesh.subdomain import Alone, Subdomain
from kratos_lite.typing import Ints

__all__ = ["scattered", "subdomain_mesh"]


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
        Nodes by their ids, cells of each block in their order; all ranks have the same blocks and parts, some
        of them empty.

    Raises
    ------
    MeshError
        Ranks disagree on a node, two give the same element, or nobody knows a node.

    Examples
    --------
    >>> from kratos_lite.mesh.subdomain import ALONE
    >>> one = Kind("KinematicLinear3D4N", np.array([[4, 2, 7, 9]]), np.array([1]), np.array([1]))
    >>> piece = Piece((one,), node_ids=np.array([2, 4, 7, 9]), points=np.eye(4, 3))
    >>> mesh = subdomain_mesh(ALONE, piece)
    >>> mesh.node_ids.tolist(), mesh.blocks[0].nodes.tolist()
    ([2, 4, 7, 9], [[1, 0, 2, 3]])
    """
    with ranks.together():
        elements, conditions = aligned(ranks, piece.elements), aligned(ranks, piece.conditions)
        check_once(ranks, elements, "element")
        check_once(ranks, conditions, "condition")
        nodes = NodeDirectory(ranks, piece)
        elements, own, here = with_halo(nodes, elements, layers)
        conditions = to_owners(nodes, conditions)
        here, asked = nodes.ask(conditions, np.append(here, piece.wanted))
        owner = asked.answer(nodes.owner)
        blocks, faces = _blocks(here, elements), _blocks(here, conditions)
        lowest = [owner[block.nodes].min(axis=1, initial=ranks.size) for block in faces]
        own_conditions = np.concatenate([np.zeros(0, dtype=np.int64), *lowest]) == ranks.rank
        have = {"nodes": here, "elements": ids_of(blocks), "conditions": ids_of(faces)}
        return Mesh(
            asked.answer(nodes.points),
            blocks,
            node_ids=here,
            conditions=faces,
            parts=parts_here(ranks, piece.parts, have),
            source=source,
            subdomain=Subdomain(ranks, owner, asked.answer(nodes.numbers), own, own_conditions),
        )


def _blocks(node_ids: Ints, kinds: tuple[Kind, ...]) -> list[Block]:
    """Return the blocks of kinds of cells whose nodes are all here."""
    here = Lookup(node_ids)
    return [kind.block(here.rows(kind.nodes)) for kind in kinds]
