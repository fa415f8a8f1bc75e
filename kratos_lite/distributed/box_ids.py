"""Ids in a whole box of the nodes and elements of a block of it, by counting, without the rest of the box.

`raise_order` numbers the nodes between corners in the order of their corners: first those of the lowest
corner, the anchor.  How many nodes each anchor has follows from where it lies in the box.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from kratos_lite.mesh.centers import surroundings
from kratos_lite.mesh.generators import SPLITS, Counts
from kratos_lite.shapes import Shape
from kratos_lite.shapes.hexahedra import Hexahedron8
from kratos_lite.typing import Ints, Rows

Offsets: TypeAlias = tuple[tuple[int, ...], ...]
"""Where corners lie from their anchor: 0 and steps in the grid, or 1 and those to the center of a brick."""
CORNERS: list[tuple[int, ...]] = [(0, *one) for one in (Hexahedron8.nodes > 0).astype(int).tolist()]


def element_ids(cells: Counts, shape: type[Shape], low: Counts, high: Counts) -> Ints:
    """Return the ids (m,) of the cells of the bricks between two corners."""
    split = len(SPLITS[shape.cell])
    bricks = _in_grid(cells, _axes(low, high)).ravel()
    return (bricks[:, None] * split + np.arange(1, split + 1)).ravel()


def node_ids(cells: Counts, shape: type[Shape], low: Counts, high: Counts, nodes: Ints | Rows) -> Ints:
    """Return the ids (n,) of the nodes of the bricks between two corners.

    Parameters
    ----------
    cells : bricks of the whole box.
    shape : of its cells.
    low, high : corners of the block.
    nodes : (m, k) int, rows of the nodes of its cells, as `unit_cells` gives them.
    """
    grid = tuple(n + 1 for n in cells)
    corners = _in_grid(grid, _axes(low, [b + 1 for b in high])).ravel()
    centers = _in_grid(cells, _axes(low, high)).ravel()
    ids = np.empty(int(nodes.max()) + 1, dtype=np.int64)
    ids[: len(corners)] = corners
    first = int(np.prod(grid, dtype=np.int64))
    if shape.cell == "pyramid":
        ids[len(corners) : len(corners) + len(centers)] = first + centers
        first += int(np.prod(cells, dtype=np.int64))
    split, around = SPLITS[shape.cell], surroundings(shape)
    nodes = nodes.reshape(-1, len(split), nodes.shape[1])
    for size in sorted({len(among) for among in around}):
        of_size = [k for k, among in enumerate(around) if len(among) == size]
        places = [[_place([cell[c] for c in around[k]]) for k in of_size] for cell in split]
        counting = _Counting(cells, {offsets for row in places for _, offsets in row}, low, high)
        for s, row in enumerate(places):
            for k, (anchor, offsets) in zip(of_size, row, strict=True):
                ids[nodes[:, s, shape.corners + k]] = first + counting.numbers(anchor, offsets)
        first += counting.total
    return ids + 1


def _place(corners: list[int]) -> tuple[tuple[int, ...], Offsets]:
    """Return the anchor of some corners of a brick, and the steps from it to the others, in order."""
    at = sorted((1, 0, 0, 0) if corner == 8 else CORNERS[corner] for corner in corners)
    (_, *anchor), *others = at
    return tuple(anchor), tuple((c, *(x - a for x, a in zip(one, anchor, strict=True))) for c, *one in others)


def _axes(low: Counts, high: Sequence[int]) -> list[Ints]:
    """Return the numbers along each axis, so that they are those of a grid together."""
    return list(np.ix_(*(np.arange(a, b) for a, b in zip(low, high, strict=True))))


def _in_grid(sizes: Sequence[int], axes: list[Ints]) -> Ints:
    """Return the numbers of places in a grid of such sizes."""
    i, j, k = axes
    return (i * sizes[1] + j) * sizes[2] + k


class _Counting:
    """Numbers of all sets of corners with some offsets: by their anchors, and then by the offsets.

    Parameters
    ----------
    cells : bricks of the whole box.
    kinds : offsets of the sets.
    low, high : corners of the block for which the numbers are wanted.
    """

    def __init__(self, cells: Counts, kinds: set[Offsets], low: Counts, high: Counts) -> None:
        self._low, self._high, axes = low, high, _axes(low, [b + 1 for b in high])
        before, self.total, self._number = np.zeros((1, 1, 1), dtype=np.int64), 0, {}
        regions = {kind: _region(cells, kind) for kind in sorted(kinds)}
        for start, stop in regions.values():
            n = [b - a for a, b in zip(start, stop, strict=True)]
            i, j, k = (np.clip(x - a, 0, m) for x, a, m in zip(axes, start, n, strict=True))
            in_i, in_j = ((a <= x) & (x < b) for x, a, b in list(zip(axes, start, stop, strict=True))[:2])
            before = before + i * n[1] * n[2] + in_i * (j * n[2] + in_j * k)
            self.total += n[0] * n[1] * n[2]
        for kind, (start, stop) in regions.items():
            self._number[kind] = before
            inside = [(a <= x) & (x < b) for x, a, b in zip(axes, start, stop, strict=True)]
            before = before + (inside[0] & inside[1] & inside[2])

    def numbers(self, anchor: tuple[int, ...], kind: Offsets) -> Ints:
        """Return the number of the set that each brick of the block has at such an anchor."""
        at = tuple(slice(a, b - low + a) for a, low, b in zip(anchor, self._low, self._high, strict=True))
        return self._number[kind][at].ravel()


def _region(cells: Counts, kind: Offsets) -> tuple[list[int], list[int]]:
    """Return where along each axis sets with these offsets have their anchor: from, and up to."""
    start, stop = [], []
    for axis, n in enumerate(cells, start=1):
        corners = [0, *(one[axis] for one in kind if not one[0])]
        bricks = [one[axis] for one in kind if one[0]]
        start.append(-min(corners + bricks))
        stop.append(min([n + 1 - max(corners), *(n - c for c in bricks)]))
    return start, stop
