"""Centers: the nodes in the middle of edges, faces and cells, known by the corners around them.

Whatever makes an element quadratic or cuts it into smaller ones puts nodes there.  Two elements agree on a
node if they agree on the corners of what they share, also where they cut that in different ways: nodes have
numbers, and that of a middle is the mean of those around it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from kratos_lite.mesh.blocks import NO_ROWS
from kratos_lite.registry import remembered
from kratos_lite.shapes import LINEAR, Shape
from kratos_lite.typing import Array, Ints, Mask, Rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

Keys: TypeAlias = "NDArray[np.uint64]"
PRIME, BITS = np.uint64(2**61 - 1), np.uint64(61)
"""Means are exact in integers modulo this prime: eight fit into 64 bits, and halving turns the bits."""
HALVINGS = 60  # levels of edges inside edges at most: halving a number of 53 bits more often changes nothing


def mixed(x: Keys) -> Keys:
    """Return numbers that look random: SplitMix64, Steele, Lea & Flood, OOPSLA (2014) 453-472."""
    x = x + np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


def keys_of(corners: Ints | Rows) -> Keys:
    """Return a number for each set of nodes (..., k), the same in whatever order they stand."""
    # It is the sum of the mixed numbers of the nodes, of 64 bits: two sets share it by accident alone.
    return mixed(np.asarray(corners).astype(np.uint64)).sum(axis=-1, dtype=np.uint64)


def sorted_keys(*keys: Keys) -> Keys:
    """Return the keys of some arrays in order, each once: faster than ``np.unique``, which hashes them."""
    every = np.sort(np.concatenate([np.zeros(0, dtype=np.uint64), *(part.ravel() for part in keys)]))
    return every[np.append(True, every[1:] != every[:-1])[: len(every)]]


def are_among(keys: Keys, known: Keys) -> Mask:
    """Return which keys (...) are among known ones, which are in order."""
    if not len(known):
        return np.zeros(keys.shape, dtype=bool)
    return known[np.minimum(np.searchsorted(known, keys), len(known) - 1)] == keys


@remembered
def surroundings(shape: type[Shape]) -> tuple[tuple[int, ...], ...]:
    """Return for each node of a shape beyond its corners the corners that it is in the middle of."""
    return tuple(corners_around(shape.cell, shape.nodes[shape.corners :]))


def corners_around(cell: str, places: Array) -> list[tuple[int, ...]]:
    """Return the corners of the edge, face or cell inside which each point (p, d) of a cell lies."""
    weights = np.abs(LINEAR[cell].N(places))
    return [tuple(np.flatnonzero(row).tolist()) for row in weights > 1e-12]


def raise_order(points: Array, corners: Ints, shape: type[Shape]) -> tuple[Array, Ints]:
    """Add the mid-edge, face and center nodes that `shape` has beyond its corners."""
    around = surroundings(shape)
    nodes = [corners]
    for size in sorted({len(among) for among in around}):
        group = [among for among in around if len(among) == size]
        keys = np.sort(corners[:, np.array(group)], axis=2).reshape(-1, size)
        unique, inverse = np.unique(keys, axis=0, return_inverse=True)
        nodes.append(len(points) + inverse.reshape(len(corners), len(group)))
        points = np.vstack([points, points[unique].mean(axis=1)])
    return points, np.hstack(nodes)


class Centers:
    """Which node lies in the middle of which corners."""

    def __init__(self, n_nodes: int = 0, known: Sequence[tuple[Ints | Rows, Ints | Rows]] = ()) -> None:
        """Take up middles: corners (k, c) around nodes (k,), which may be corners of others."""
        self._keys: Keys = np.zeros(0, dtype=np.uint64)
        self._nodes: Ints = NO_ROWS
        self._numbers: Keys = mixed(np.arange(n_nodes, dtype=np.uint64)) % PRIME
        for _ in range(HALVINGS):
            keys, before = [self.middle(corners) for corners, _ in known], self._numbers.copy()
            for (_, nodes), numbers in zip(known, keys, strict=True):
                self._numbers[nodes] = numbers
            if (self._numbers == before).all():
                break
        for (_, nodes), numbers in zip(known, keys, strict=True):
            self.add(numbers, nodes)
        self.sort()

    @property
    def n_nodes(self) -> int:
        """How many nodes there are, with those that were made."""
        return len(self._numbers)

    def middle(self, corners: Ints | Rows) -> Keys:
        """Return the number of the node in the middle of 2, 4 or 8 corners (..., c)."""
        total = self._numbers[corners].sum(axis=-1, dtype=np.uint64)
        halvings = np.uint64(corners.shape[-1].bit_length() - 1)
        total = (total & PRIME) + (total >> BITS)
        total -= np.where(total >= PRIME, PRIME, np.uint64(0))
        return (total >> halvings) | ((total << (BITS - halvings)) & PRIME)

    def add(self, keys: Keys, nodes: Ints | Rows) -> None:
        """Take up nodes (k,) by the keys (k,) of their corners; `find` needs `sort` first."""
        self._keys = np.concatenate([self._keys, keys])
        self._nodes = np.concatenate([self._nodes, np.asarray(nodes, dtype=np.int64)])

    def sort(self) -> None:
        """Make what was taken up ready to be found."""
        self._keys, first = np.unique(self._keys, return_index=True)
        self._nodes = self._nodes[first]

    def find(self, keys: Keys) -> Ints:
        """Return the node of each key (...), -1 where there is none."""
        if not len(self._keys):
            return np.full(keys.shape, -1)
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return np.where(self._keys[at] == keys, self._nodes[at], -1)

    def make(self, keys: Keys) -> Ints:
        """Give new nodes to keys (k,) that have none; return which they are."""
        missing = np.flatnonzero(self.find(keys) < 0)
        _, at = np.unique(keys[missing], return_index=True)
        new: Ints = missing[np.sort(at)]
        self.add(keys[new], self.n_nodes + np.arange(len(new)))
        self._numbers = np.concatenate([self._numbers, keys[new]])
        self.sort()
        return new
