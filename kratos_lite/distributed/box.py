"""A box: whole, or of which each of several ranks makes its own part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kratos_lite.distributed.pieces import Piece
    from kratos_lite.mesh import Mesh
    from kratos_lite.mesh.generators import Counts
    from kratos_lite.mesh.subdomain import Alone


def box(
    size: Sequence[float] = (1.0, 1.0, 1.0),
    cells: Sequence[int] = (1, 1, 1),
    element: str = "Element3D8N",
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    comm: Any = None,
) -> Mesh:
    """Return a box with parts ``x- x+ y- y+ z- z+``, the nodes of its six sides.

    Parameters
    ----------
    size : edge lengths in m, > 0.
    cells : bricks along x, y, z; a brick holds one hexahedron, two wedges or six tetrahedra or pyramids.
    element : name of the element, or its number of nodes, ``"20N"``, which means ``Element3D20N``: it and its
        kin are computed by one that does not lock.
    origin : the corner with the smallest coordinates, m.
    comm : communicator of mpi4py, whose processes share the box: each makes a block of it and the elements
        around, with the ids that they have in the whole; None for one process.

    Returns
    -------
    Mesh

    Raises
    ------
    InputError
        If a length or a number of cells is not positive, there is no such element, or `comm` is none.

    Examples
    --------
    >>> mesh = box((1, 1, 1), cells=(2, 2, 2), element="KinematicLinear3D20N")
    >>> mesh.n_nodes, mesh.n_elements, len(mesh.nodes("z+"))
    (81, 8, 21)
    """
    from kratos_lite.mesh import generators

    if comm is None:
        return generators.box(size, cells, element, origin)
    from dataclasses import replace

    from kratos_lite.distributed.communicator import ranks_of
    from kratos_lite.distributed.subdomains import subdomain_mesh

    ranks = ranks_of(comm)
    with ranks.together():
        corner, lengths = generators.corner_and_lengths(size, origin)
        piece = _piece(ranks, cells, element)
        return subdomain_mesh(ranks, replace(piece, points=corner + piece.points * lengths))


def _piece(ranks: Alone, cells: Sequence[int], element: str) -> Piece:
    """Return the block of the unit cube that a rank makes, by the ids of the whole."""
    from dataclasses import replace

    import numpy as np

    from kratos_lite.distributed.box_ids import element_ids, node_ids
    from kratos_lite.distributed.pieces import Kind, Piece
    from kratos_lite.mesh import SIDES
    from kratos_lite.mesh.generators import counts_of, kind_of, sides_of, unit_cells

    (name, shape), counts = kind_of(element), counts_of(cells)
    low, high = block_of(counts, ranks.rank, ranks.size)
    if min(b - a for a, b in zip(low, high, strict=True)) < 1:
        return Piece()
    points, nodes = unit_cells(counts, shape, low, high)
    ids = node_ids(counts, shape, low, high, nodes)
    sides = {side: replace(part, nodes=ids[part.nodes]) for side, part in sides_of(points, SIDES).items()}
    numbers = element_ids(counts, shape, low, high)
    kind = Kind(name, ids[nodes], numbers, np.ones_like(numbers), shape)
    return Piece((kind,), (), ids, points, parts=sides)


def block_of(cells: Counts, rank: int, size: int) -> tuple[Counts, Counts]:
    """Return the first and last corner of the bricks of a rank; they are none where ranks are too many.

    The box is halved again and again across its longest side.

    >>> block_of((4, 2, 2), 1, 4)
    ((1, 0, 0), (2, 2, 2))
    """
    low, high = [0, 0, 0], list(cells)
    while size > 1:
        lengths = [b - a for a, b in zip(low, high, strict=True)]
        axis, lower = lengths.index(max(lengths)), size // 2
        cut = low[axis] - (-lengths[axis] * lower // size)
        if rank < lower:
            high[axis], size = cut, lower
        else:
            low[axis], rank, size = cut, rank - lower, size - lower
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])
