"""Body loads: force per volume, and gravity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.assembly import gauss_point_fields
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh, WhereElements
from kratos_lite.model.loads.base import Load, vectors
from kratos_lite.typing import Array, Mask


class BodyForce(Load):
    """Force per volume.

    Parameters
    ----------
    force : (3,) float, or (n, 3) interpolated from the nodes; N/m³.
    where : elements that carry it: part name, property id or rows; all if not given.
    """

    def __init__(self, force: ArrayLike, where: WhereElements = None) -> None:
        self.force = vectors(force, "a body force", "(3,) or (n, 3) in N/m³", (1, 2))
        self.where = where

    def per_volume(self, group: ElementGroup) -> Array:
        """Return the force per volume.

        Parameters
        ----------
        group : elements of one material.

        Returns
        -------
        (3,) or nodal (n, 3) in N/m³.
        """
        return self.force

    def carriers(self, mesh: Mesh) -> Mask:
        """Return which elements carry it.

        Parameters
        ----------
        mesh : elements and named parts.

        Returns
        -------
        (m,) bool
        """
        chosen = np.zeros(mesh.n_elements, dtype=bool)
        chosen[slice(None) if self.where is None else mesh.elements(self.where)] = True
        return chosen

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return ∫ N b dV as nodal forces (n, 3) in N.

        Raises
        ------
        InputError
            A nodal force has another number of nodes.
        """
        if self.force.ndim == 2 and len(self.force) != mesh.n_nodes:
            name = type(self).__name__
            raise InputError(f"a nodal {name} needs shape ({mesh.n_nodes}, 3); got {self.force.shape}")
        total = np.zeros_like(mesh.points)
        chosen = self.carriers(mesh)
        for group in groups:
            b, part = self.per_volume(group), group.take(chosen[group.rows])
            if b.any() and len(part):
                total += gauss_point_fields.body_force(mesh.points, part, b)
        return total


class Gravity(BodyForce):
    """Weight: density times an acceleration.

    Parameters
    ----------
    acceleration : (3,) float, or (n, 3) interpolated from the nodes; m/s².
    where : elements that carry it: part name, property id or rows; all if not given.

    Examples
    --------
    >>> Gravity((0.0, 0.0, -9.81)).force
    array([ 0.  ,  0.  , -9.81])
    """

    def __init__(self, acceleration: ArrayLike, where: WhereElements = None) -> None:
        self.force = vectors(acceleration, "gravity", "(3,) or (n, 3) in m/s²", (1, 2))
        self.where = where

    def per_volume(self, group: ElementGroup) -> Array:
        """Return density × acceleration."""
        return group.material.density * self.force
