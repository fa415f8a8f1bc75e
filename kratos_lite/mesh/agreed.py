"""Agreed: which element contains a point, where many processes share a mesh and several of them find one."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh.blocks import Block, rows_of_ids
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.typing import Array, Ints

NONE = np.iinfo(np.int64).max


def agreed(
    ranks: Alone, blocks: tuple[Block, ...], block: Ints, cell: Ints, xi: Array
) -> tuple[Ints, Ints, Array]:
    """Return block, cell and xi of points for the element that all ranks take, where it is here.

    It is that of the first block and the lowest id.

    Parameters
    ----------
    blocks : of this rank.
    block, cell : (m,) int, where this rank has found the points; -1 where it has not.
    xi : (m, 3) float.
    """
    first = ranks.min(np.where(block < 0, NONE, block))
    ids = np.full(len(block), NONE)
    for number, one in enumerate(blocks):
        mine = (block == number) & (first == number)
        ids[mine] = one.ids[cell[mine]]
    lowest = ranks.min(ids)
    xi = ranks.max(np.where((ids == lowest)[:, None] & (ids < NONE)[:, None], xi, -np.inf))
    rows = np.full(len(block), -1)
    for number, one in enumerate(blocks):
        mine = first == number
        rows[mine] = rows_of_ids(one.ids, lowest[mine])
    here = rows >= 0
    return np.where(here, first, -1), rows, np.where(here[:, None], xi, np.nan)
