"""Nodal loads: forces on nodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh, Where
from kratos_lite.model.loads.base import Load, vectors

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from kratos_lite.mesh.finer import Finer
from kratos_lite.typing import Array


class PointLoad(Load):
    """The same force on each node of a part.

    Parameters
    ----------
    where : nodes.
    force : (3,) float, N, on each node.
    """

    def __init__(self, where: Where, force: ArrayLike) -> None:
        self.where = where
        self.force = vectors(force, "a point load", "(3,) in N")

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N.

        Raises
        ------
        ModelError
            No node is chosen.
        """
        total = np.zeros_like(mesh.points)
        rows = mesh.nodes(self.where)
        if not len(rows):
            raise ModelError(f"a point load finds no node in {self.where!r}")
        total[rows] += self.force
        return total

    def refined(self, finer: Finer) -> Load:
        """Return the load on a finer mesh: on the same nodes."""
        return PointLoad(finer.coarse.nodes(self.where), self.force)


class NodalForces(Load):
    """Given nodal forces.

    Parameters
    ----------
    values : (n, 3) float, N.
    """

    def __init__(self, values: ArrayLike) -> None:
        self.values = vectors(values, "nodal forces", "(n, 3) in N", (2,))

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return a copy of the values.

        Raises
        ------
        InputError
            The mesh has another number of nodes.
        """
        if self.values.shape != mesh.points.shape:
            raise InputError(f"nodal forces need shape {mesh.points.shape}; got {self.values.shape}")
        return self.values.copy()

    def refined(self, finer: Finer) -> Load:
        """Return the load on a finer mesh: on the same nodes."""
        new = np.zeros((finer.mesh.n_nodes - len(self.values), 3))
        return NodalForces(np.concatenate([self.values, new]))
