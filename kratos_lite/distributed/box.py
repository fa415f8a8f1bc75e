"""A box of which each rank makes its own part, however large the whole is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.distributed.communicator import Alone, world
from kratos_lite.distributed.partition import Partition
from kratos_lite.mesh import SIDES, Block, Mesh
from kratos_lite.mesh.generators import Counts, corner_and_lengths, counts_of, kind_of, sides_of, unit_cells
from kratos_lite.typing import Array, Ints

STEPS = 4
"""Places of nodes along a brick: those of a 13-node pyramid lie at its quarters."""


def box(
    size: Sequence[float] = (1.0, 1.0, 1.0),
    cells: Sequence[int] = (1, 1, 1),
    element: str = "Element3D8N",
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    ranks: Alone | None = None,
) -> tuple[Mesh, Partition]:
    """Return the part of a box that belongs to this rank, and its partition; all ranks call it.

    Parameters
    ----------
    size, cells, element, origin : as for `kratos_lite.box`.
    ranks : those of mpirun if not given.

    Returns
    -------
    The mesh of the part, with those nodes of the sides ``x- x+ y- y+ z- z+`` that it has; and the partition.

    Raises
    ------
    InputError
        As for `kratos_lite.box`, or there are more ranks than bricks.

    Examples
    --------
    >>> from kratos_lite.distributed.communicator import ALONE
    >>> mesh, partition = box(cells=(2, 2, 2), ranks=ALONE)
    >>> mesh.n_elements, int(partition.own.sum())
    (8, 27)
    """
    ranks = world() if ranks is None else ranks
    corner, lengths = corner_and_lengths(size, origin)
    (name, shape), counts = kind_of(element), counts_of(cells)
    low, high = block_of(counts, ranks.rank, ranks.size)
    unit, nodes = unit_cells(counts, shape, low, high)
    ids = _element_ids(counts, low, high, len(nodes))
    mesh = Mesh(
        corner + unit * lengths,
        [Block(name, nodes, ids, shape=shape)],
        node_ids=_node_ids(counts, unit),
        parts=sides_of(unit, SIDES),
        whole=False,
    )
    return mesh, Partition(ranks, mesh)


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


def _node_ids(cells: Counts, unit: Array) -> Ints:
    """Return a number of each place in the grid of all that nodes may have."""
    steps = STEPS * np.array(cells)
    x, y, z = np.rint(unit * steps).astype(np.int64).T
    return np.asarray(1 + x + (steps[0] + 1) * (y + (steps[1] + 1) * z))


def _element_ids(cells: Counts, low: Counts, high: Counts, count: int) -> Ints:
    """Return the ids that the cells between two corners of the grid have in the whole."""
    i, j, k = (np.arange(a, b) for a, b in zip(low, high, strict=True))
    bricks = ((i[:, None, None] * cells[1] + j[:, None]) * cells[2] + k).ravel()
    each = count // len(bricks) if len(bricks) else 1
    return np.asarray(1 + (bricks[:, None] * each + np.arange(each)).ravel())
