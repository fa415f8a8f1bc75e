"""Reached: what is compared with expected values, a solution at rest or the end of a march."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from kratos_lite.mesh import Mesh

Array = NDArray[np.float64]


class Reached(Protocol):
    """A `kratos_lite.Result`, or an `End`."""

    @property
    def mesh(self) -> Mesh:
        """The mesh."""

    def displacement(self) -> Array:
        """Return the displacements (n, 3) in m."""

    def reaction(self) -> Array:
        """Return the reactions (n, 3) in N."""


@dataclass(frozen=True, eq=False)
class End:
    """The end of a march: mesh, displacements (n, 3) in m and reactions (n, 3) in N."""

    mesh: Mesh
    u: Array
    reactions: Array

    def displacement(self) -> Array:
        """Return the displacements (n, 3) in m."""
        return self.u

    def reaction(self) -> Array:
        """Return the reactions (n, 3) in N."""
        return self.reactions
