"""Attached matrices: stiffness of springs and mass beside those of elements, between any nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kratos_lite.assembly.sparsity_pattern import dofs_of
from kratos_lite.typing import Array, Csr, Ints, Rows


@dataclass(frozen=True, eq=False)
class Attached:
    """Matrices (3n, 3n) on all degrees of freedom, most of whose rows are empty."""

    K: Csr  # N/m
    M: Csr  # kg

    def on(self, nodes: Ints) -> Attached:
        """Return what they are on some nodes (a,), renumbered in order."""
        dofs = dofs_of(nodes)
        return Attached(self.K[dofs][:, dofs], self.M[dofs][:, dofs])

    @property
    def pairs(self) -> Rows:
        """The pairs of nodes (k, 2) between which they act."""
        A = (abs(self.K) + abs(self.M)).tocoo()
        pairs = np.column_stack([A.row // 3, A.col // 3])
        return np.asarray(pairs[pairs[:, 0] < pairs[:, 1]], dtype=np.int32)

    def forces(self, u: Array) -> Array:
        """Return the forces -K u of springs (n, 3) in N on the nodes of displacements (n, 3)."""
        return np.asarray(-(self.K @ u.ravel()).reshape(-1, 3))
