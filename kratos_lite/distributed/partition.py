"""Partition: which rank gets each element, so that all have equal work and few neighbors.

METIS cuts the graph of the elements that share faces, on rank 0, where its wheel `pymetis` is installed.
Else, and for meshes too large for one rank, the ranks halve the mesh together (`bisection`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np

from kratos_lite.distributed.bisection import bisected
from kratos_lite.distributed.directory import Route
from kratos_lite.distributed.lookup import Lookup, merged
from kratos_lite.distributed.node_directory import places
from kratos_lite.distributed.pieces import Kind, Piece, aligned, cell_ids
from kratos_lite.mesh import Block, Faces, Mesh
from kratos_lite.mesh.subdomain import ALONE, Alone
from kratos_lite.typing import Ints

METIS_ELEMENTS = 10_000_000
"""Elements up to which one rank cuts the graph: it takes 3 µs and 0.6 kB for each, 6 GB of all these."""
FEW = 10
"""Elements a part below which METIS leaves some parts empty."""


def parts_of(mesh: Mesh, ranks: Alone) -> Ints:
    """Return the rank of each element of a mesh that every rank knows whole.

    The work of an element is taken as the square of its number of nodes.

    Parameters
    ----------
    mesh : the same on all ranks.
    ranks : that share it.

    Returns
    -------
    (m,) int, 0 … size - 1.
    """
    work = _work(mesh.blocks)
    if not _takes_metis(ranks, mesh.n_elements):
        centers = [mesh.points[block.nodes].mean(axis=1) for block in mesh.blocks if len(block)]
        return bisected(ALONE, np.concatenate([np.zeros((0, 3)), *centers]), work, ranks.size)
    with ranks.together():
        parts = metis(mesh.blocks, work, ranks.size) if ranks.rank == 0 else work[:0]
        return ranks.exchange([parts] * ranks.size)[0]


def partitioned(ranks: Alone, piece: Piece) -> Piece:
    """Return a piece with its elements replaced by those of its part; all the rest stays where it is.

    Parameters
    ----------
    ranks : the communicator.
    piece : what this rank has of a mesh, such as a range of a file.

    Raises
    ------
    MeshError
        Nobody knows a node of an element, or ranks disagree on its place.
    """
    with ranks.together():
        kinds = aligned(ranks, piece.elements)
        if _takes_metis(ranks, ranks.sum(len(cell_ids(kinds)))):
            parts = _cut_on_one(ranks, kinds)
        else:
            ids, points = places(ranks, piece, kinds)
            rows = Lookup(ids)
            centers = [points[rows.rows(kind.nodes)].mean(axis=1) for kind in kinds]
            parts = bisected(ranks, np.concatenate([points[:0], *centers]), _work(kinds), ranks.size)
        ends = np.cumsum([len(kind.ids) for kind in kinds])[:-1]
        routes = [Route(ranks, part) for part in np.split(parts, ends)[: len(kinds)]]
        moved = [kind.with_table(route.send(kind.table)) for kind, route in zip(kinds, routes, strict=True)]
        return replace(piece, elements=tuple(moved))


def _work(cells: Sequence[Block | Kind]) -> Ints:
    return np.concatenate(
        [np.zeros(0, dtype=np.int64), *(np.full(len(c.ids), c.nodes.shape[1] ** 2) for c in cells)]
    )


def _takes_metis(ranks: Alone, n_elements: int) -> bool:
    """Return whether METIS cuts a mesh of so many elements: as rank 0 says, which does it."""
    fits = FEW * ranks.size <= n_elements <= METIS_ELEMENTS
    return ranks.size > 1 and fits and ranks.gather(find_spec("pymetis") is not None)[0]


def _cut_on_one(ranks: Alone, kinds: Sequence[Kind]) -> Ints:
    """Return the ranks of the elements of this rank, which rank 0 has found from the nodes of all."""
    routes = [Route(ranks, np.zeros(len(kind.ids), dtype=np.int64)) for kind in kinds]
    nodes = [route.send(kind.nodes) for kind, route in zip(kinds, routes, strict=True)]
    here = Lookup(merged(*nodes))
    blocks = [
        Block(kind.name, here.rows(some).astype(np.int32), shape=kind.shape)
        for kind, some in zip(kinds, nodes, strict=True)
    ]
    found = metis(blocks, _work(blocks), ranks.size) if ranks.rank == 0 else np.zeros(0, dtype=np.int64)
    ends = np.cumsum([len(block) for block in blocks])[:-1]
    parts = [route.back(part) for route, part in zip(routes, np.split(found, ends), strict=True)]
    return np.concatenate(parts)


def metis(blocks: Sequence[Block], work: Ints, size: int) -> Ints:
    """Return the part of each element, by METIS; elements that share a face are neighbors.

    Source: Karypis & Kumar, SIAM J. Sci. Comput. 20 (1998) 359-392.

    Parameters
    ----------
    blocks : of elements.
    work : (m,) int, of each.
    size : number of parts, 2 or more.
    """
    import pymetis

    faces: Any = Faces(blocks)
    one, other = faces.element[faces.one], faces.element[faces.other]
    cells, neighbors = np.concatenate([one, other]), np.concatenate([other, one])
    order = np.argsort(cells, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(cells, minlength=len(work)))])
    graph = pymetis.CSRAdjacency(starts, neighbors[order])
    return np.array(pymetis.part_graph(size, graph, vweights=work).vertex_part, dtype=np.int64)
