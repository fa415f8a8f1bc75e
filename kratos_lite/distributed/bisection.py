"""Bisection: elements of many ranks in parts of equal work, halved across the longest side of each."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh.subdomain import Alone
from kratos_lite.typing import Array, Ints, Mask

TILT = 1e-3
"""By how much a cut leans, so that it passes between elements that lie in one plane across the side."""
STEPS = 60
"""Halvings after which the place of a cut is exact."""


def bisected(ranks: Alone, centers: Array, work: Ints, size: int) -> Ints:
    """Return the part, 0 … size - 1, of each element of this rank; all ranks call it.

    The parts do not depend on which rank has which element.

    Parameters
    ----------
    ranks : the communicator.
    centers : (m, 3) float, m.
    work : (m,) int, of each element.
    size : number of parts.

    Examples
    --------
    >>> from kratos_lite.mesh.subdomain import ALONE
    >>> bisected(ALONE, np.eye(4, 3), np.ones(4, dtype=int), 2).tolist()
    [1, 1, 0, 0]
    """
    group, sizes = np.zeros(len(centers), dtype=np.int64), [size]
    while max(sizes) > 1:
        lower = np.array([one // 2 for one in sizes])
        side = _upper(ranks, centers, work, group, lower / np.array(sizes))
        children = [[half for half in (one // 2, one - one // 2) if half] for one in sizes]
        first = np.cumsum([0, *map(len, children)])[:-1]
        group = first[group] + (side & (lower[group] > 0))
        sizes = [half for halves in children for half in halves]
    return group


def _upper(ranks: Alone, centers: Array, work: Ints, group: Ints, share: Array) -> Mask:
    """Return which elements lie above the cut of their group, below which is a share of its work."""
    n, key = len(share), _along(ranks, centers, group, len(share))
    order = np.argsort(key, kind="stable")
    key_in_order = key[order]
    below = np.concatenate([[0], np.cumsum(work[order])])
    starts = below[np.searchsorted(key_in_order, np.arange(n + 1))]
    target = ranks.sum(np.diff(starts)) * share
    low, high = np.arange(n, dtype=float), np.arange(n) + 1.0
    for _ in range(STEPS):
        cut = (low + high) / 2
        found = ranks.sum(below[np.searchsorted(key_in_order, cut)] - starts[:-1])
        low, high = np.where(found < target, cut, low), np.where(found < target, high, cut)
    upper: Mask = key >= high[group]
    return upper


def _along(ranks: Alone, centers: Array, group: Ints, n: int) -> Array:
    """Return the group of each element plus where it lies along the longest side of it, 0 … 1."""
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    np.minimum.at(low, group, centers)
    np.maximum.at(high, group, centers)
    low, high = ranks.min(low), ranks.max(high)
    extent = np.where(high >= low, high - low, 0.0)
    sides = np.argsort(-extent, axis=1, kind="stable")
    x = np.zeros(len(centers))
    for number, weight in enumerate((1.0, TILT, TILT**2)):
        side = sides[group, number]
        row = np.arange(len(centers))
        length = np.where(extent[group, side] > 0, extent[group, side], 1.0)
        x += weight * (centers[row, side] - low[group, side]) / length
    return group + x / (1.0 + 2 * TILT)
