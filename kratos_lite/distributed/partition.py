"""Partition: which rank gets each element of a mesh."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array, Ints


def parts_of(mesh: Mesh, size: int) -> Ints:
    """Return a rank for each element: parts of equal work, halved again and again across their longest side.

    The work of an element is taken as the square of its number of nodes.

    Parameters
    ----------
    mesh : known whole.
    size : number of ranks.

    Returns
    -------
    (m,) int, 0 … size - 1.
    """
    parts = np.zeros(mesh.n_elements, dtype=np.int64)
    if size > 1 and mesh.n_elements:
        centers = np.concatenate(
            [mesh.points[block.nodes].mean(axis=1) for block in mesh.blocks if len(block)]
        )
        work = np.concatenate([np.full(len(block), block.nodes.shape[1] ** 2.0) for block in mesh.blocks])
        _halve(np.arange(mesh.n_elements), centers, work, 0, size, parts)
    return parts


def _halve(rows: Ints, centers: Array, work: Array, first: int, size: int, parts: Ints) -> None:
    """Give some elements to the ranks first … first + size - 1."""
    if size == 1 or not len(rows):
        parts[rows] = first
        return
    lower = size // 2
    x = centers[rows]
    longest = np.ptp(x, axis=0).argmax()
    rows = rows[np.lexsort((rows, x[:, longest]))]
    sums = np.cumsum(work[rows])
    cut = int(np.searchsorted(sums, sums[-1] * lower / size))
    _halve(rows[:cut], centers, work, first, lower, parts)
    _halve(rows[cut:], centers, work, first + lower, size - lower, parts)
