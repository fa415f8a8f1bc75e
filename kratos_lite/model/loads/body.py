"""Body loads: force per volume, and gravity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from kratos_lite.assembly import gauss_point_fields
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh, WhereElements
from kratos_lite.model.loads.base import Load, OfPlace, vectors
from kratos_lite.typing import Array, Mask

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from kratos_lite.mesh.finer import Finer


class BodyForce(Load):
    """Force per volume.

    Parameters
    ----------
    force : (3,) float, or (n, 3) interpolated from the nodes; N/m³; or a function of places (n, 3) that
        returns either.
    where : elements that carry it: part name, property id or rows; all if not given.
    """

    what: ClassVar[tuple[str, str]] = "a body force", "(3,) or (n, 3) in N/m³"

    def __init__(self, force: ArrayLike | OfPlace, where: WhereElements = None) -> None:
        self.force: Any = force if callable(force) else vectors(force, *self.what, (1, 2))
        self.where = where

    def per_volume(self, group: ElementGroup, points: Array) -> Array:
        """Return the force per volume.

        Parameters
        ----------
        group : elements of one material.
        points : (n, 3) m, of the mesh.

        Returns
        -------
        (3,) or nodal (n, 3) in N/m³.
        """
        return self.nodal(points)

    def nodal(self, points: Array) -> Array:
        """Return the force (3,) or nodal (n, 3) at the nodes of a mesh.

        Parameters
        ----------
        points : (n, 3) m, of the mesh.

        Returns
        -------
        (3,) or (n, 3), in the unit of the load.

        Raises
        ------
        InputError
            It has another number of nodes, or its function does not return such values.
        """
        force: Array = self.force
        if callable(force):
            force = vectors(force(points.copy()), *self.what, (1, 2))
        if force.ndim == 2 and len(force) != len(points):
            raise InputError(
                f"a nodal {type(self).__name__} needs shape ({len(points)}, 3); got {force.shape}"
            )
        return force

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

    def check(self, mesh: Mesh) -> None:
        """Check that the elements which carry it exist.

        Raises
        ------
        MeshError
            There is no such part, property or element.
        """
        if self.where is not None:
            mesh.elements(self.where)

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return ∫ N b dV as nodal forces (n, 3) in N.

        Raises
        ------
        InputError
            A nodal force has another number of nodes.
        """
        total = np.zeros_like(mesh.points)
        chosen = self.carriers(mesh)
        for group in groups:
            b, part = self.per_volume(group, mesh.points), group.take(chosen[group.rows])
            if b.any() and len(part):
                total += gauss_point_fields.body_force(mesh.points, part, b)
        return total

    def refined(self, finer: Finer) -> Load:
        """Return the load on a finer mesh; nodal values are interpolated."""
        nodal = not callable(self.force) and self.force.ndim == 2
        force = finer.interpolate(self.force) if nodal else self.force
        return type(self)(force, finer.where_elements(self.where))


class Gravity(BodyForce):
    """Weight: density times an acceleration.

    Parameters
    ----------
    acceleration : (3,) float, or (n, 3) interpolated from the nodes; m/s²; or a function of places (n, 3)
        that returns either.
    where : elements that carry it: part name, property id or rows; all if not given.

    Examples
    --------
    >>> Gravity((0.0, 0.0, -9.81)).force
    array([ 0.  ,  0.  , -9.81])
    """

    what = "gravity", "(3,) or (n, 3) in m/s²"

    def __init__(self, acceleration: ArrayLike | OfPlace, where: WhereElements = None) -> None:
        super().__init__(acceleration, where)

    def per_volume(self, group: ElementGroup, points: Array) -> Array:
        """Return density × acceleration."""
        return group.material.density * self.nodal(points)
