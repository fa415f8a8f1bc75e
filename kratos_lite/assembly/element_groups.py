"""Batches: elements of one kind, rule and material, computed together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kratos_lite.elements import KinematicLinear
from kratos_lite.materials import LinearMaterial
from kratos_lite.quadrature import Rule
from kratos_lite.typing import Array, Ints

CHUNK_BYTES = 4_000_000
"""Memory of the element matrices computed at once: small enough for the cache."""


@dataclass(eq=False)
class ElementGroup:
    """Elements that share class, rule and material.

    Attributes
    ----------
    element : the element class.
    rule : its quadrature rule.
    material : its material.
    nodes : (m, k) int, rows of the points.
    rows : (m,) int, rows of the elements in the mesh.
    prestress : (m, 6) float in Pa, or None.
    """

    element: type[KinematicLinear]
    rule: Rule
    material: LinearMaterial
    nodes: NDArray[np.int32]
    rows: Ints
    prestress: Array | None = None

    def __len__(self) -> int:
        return len(self.rows)

    def at(self, points: Array, chunk: slice = slice(None)) -> KinematicLinear:
        """Return the elements of a chunk, placed at `points` (n, 3)."""
        return self.element(points[self.nodes[chunk]], self.rule)

    def take(self, chosen: NDArray[np.bool_]) -> ElementGroup:
        """Return the group of the chosen elements, a mask (m,)."""
        if chosen.all():
            return self
        stress = None if self.prestress is None else self.prestress[chosen]
        return replace(self, nodes=self.nodes[chosen], rows=self.rows[chosen], prestress=stress)

    def chunks(self, memory: int = CHUNK_BYTES, within: slice | None = None) -> Iterator[slice]:
        """Cut the group, or a slice of it, into slices whose matrices take about `memory` bytes each."""
        first, last = (within.start, within.stop) if within else (0, len(self))
        k = self.nodes.shape[1]
        per_element = 8 * (9 * k * k + 2 * len(self.rule) * 3 * k)
        step = max(1, memory // per_element)
        for start in range(first, last, step):
            yield slice(start, min(start + step, last))

    def initial_stress(self, chunk: slice) -> Array | float:
        """Return the prestress of a chunk as (m, 1, 6), or 0."""
        return 0.0 if self.prestress is None else self.prestress[chunk, None, :]


def add_nodal(total: Array, nodes: NDArray[np.int32], values: Array) -> None:
    """Add element vectors (m, k, 3) to nodal vectors `total` (n, 3)."""
    flat = nodes.ravel()
    for axis in range(total.shape[1]):
        total[:, axis] += np.bincount(flat, weights=values[..., axis].ravel(), minlength=len(total))
