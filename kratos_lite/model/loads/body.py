"""Body loads: force per volume, and gravity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from kratos_lite.assembly import gauss_point_fields
from kratos_lite.assembly.element_groups import ElementGroup, add_nodal
from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh, WhereElements, mask_of
from kratos_lite.model.loads.base import DistributedLoad, Drawn, OfPlace, is_of_places, placed, vectors
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.typing import Array, ArrayLike, Ints

if TYPE_CHECKING:
    from kratos_lite.mesh.refined_mesh import RefinedMesh

RESULTANT = 1e-6
"""Square of a resultant, beside the sum of those of its forces, up to which it is none."""


class BodyForce(DistributedLoad):
    """Force per volume.

    Parameters
    ----------
    force : (3,) float, or (n, 3) interpolated from the nodes; N/m³; or a function of places (m, 3) that
        returns either, taken at quadrature points.
    where : elements that carry it: part name, property id or indices; all if not given.
    local : axes of the force, one vector or a function: `Cylindrical`, …; x y z if not given.
    """

    unit = " [N/m³]"
    what: ClassVar[tuple[str, str]] = "a body force", "(3,) or (n, 3) in N/m³"

    def __init__(
        self, force: ArrayLike | OfPlace, where: WhereElements = None, *, local: LocalAxes | None = None
    ) -> None:
        self.force: Any = force if is_of_places(force, self.what[0]) else vectors(force, *self.what, (1, 2))
        self.where = where
        self._along(local)

    factors = 4  # N, and a polynomial of degree p + 2 over straight cells
    nodal = "force", 2

    def _scale(self, group: ElementGroup) -> float:
        """Return what multiplies the force in a group: 1, or the density in kg/m³ for `Gravity`."""
        return 1.0

    def check(self, mesh: Mesh) -> None:
        """Raise MeshError if there is no such part, property or element."""
        mesh.elements(self.where)

    def integral(self, mesh: Mesh, groups: Sequence[ElementGroup], factors: int) -> tuple[Ints, Array]:
        """Return all nodes (n,), and ∫ N b dV (n, 3) in N.

        Raises
        ------
        InputError
            A nodal force has another number of nodes, or a function does not return forces.
        """
        points, total, force = mesh.points, np.zeros_like(mesh.points), self._checked_force(mesh)
        for part in self._carriers(mesh, groups):
            scale = self._scale(part)
            if not scale:
                continue
            if callable(force):
                total += scale * gauss_point_fields.body_force_by_function(points, part, force, factors)
            elif force.any():
                total += gauss_point_fields.body_force(points, part, scale * force)
        return np.arange(len(total)), total

    def drawn(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[Drawn]:
        """Return the resultant at its center: of weight, that of mass; without one, the forces of nodes."""
        forces = self.integral(mesh, groups, self.factors)[1]
        total = forces.sum(axis=0)
        weights = forces @ total
        if weights.sum() <= RESULTANT * (forces**2).sum():
            return super().drawn(mesh, groups)
        return [((weights @ mesh.points / weights.sum())[None], total[None], "from")]

    def _checked_force(self, mesh: Mesh) -> Any:
        """Return the force as an array, or a function of places that is checked."""
        force, n = placed(self.force, self.local, self.what[0]), mesh.n_nodes
        if not callable(force) and force.ndim == 2 and len(force) != n:
            raise InputError(f"a nodal {type(self).__name__} needs shape ({n}, 3); got {force.shape}")
        return force

    def _carriers(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[ElementGroup]:
        """Return the elements that carry the force."""
        carriers = mask_of(mesh.elements(self.where), mesh.n_elements)
        parts = [group.take(carriers[group.rows]) for group in groups]
        return [part for part in parts if len(part)]

    def by_coordinates(self, mesh: Mesh, groups: Sequence[ElementGroup], v: Array) -> Array:
        """Return ∫ v·b div N dV (n, 3) in N; ModelError of a function of places."""
        force, total = self._checked_force(mesh), np.zeros_like(mesh.points)
        if callable(force):
            raise self.without_derivative("it is a function of places, or along local axes")
        for part in self._carriers(mesh, groups):
            works = gauss_point_fields.body_work(mesh.points, part, force, v, curved=True)
            for _, nodes, work, D in works:
                add_nodal(total, nodes, self._scale(part) * np.einsum("mg,mgik->mki", work, D))
        return total

    def _refined_where(self, finer: RefinedMesh) -> WhereElements:
        return finer.where_elements(self.where)


class Gravity(BodyForce):
    """Weight: density times an acceleration.

    Parameters
    ----------
    acceleration : (3,) float, or (n, 3) interpolated from the nodes; m/s²; or a function of places (m, 3)
        that returns either, taken at quadrature points.
    where : elements that carry it: part name, property id or indices; all if not given.
    local : as of `BodyForce`.

    Examples
    --------
    >>> Gravity((0.0, 0.0, -9.81)).force
    array([ 0.  ,  0.  , -9.81])
    """

    unit = " [m/s²]"
    what = "gravity", "(3,) or (n, 3) in m/s²"

    def __init__(
        self,
        acceleration: ArrayLike | OfPlace,
        where: WhereElements = None,
        *,
        local: LocalAxes | None = None,
    ) -> None:
        super().__init__(acceleration, where, local=local)

    def at(self, points: Array) -> Array:
        """Return the acceleration at the nodes.

        Parameters
        ----------
        points : (n, 3) m.

        Returns
        -------
        (n, 3) m/s².
        """
        force = placed(self.force, self.local, self.what[0])
        force = force(points) if callable(force) else force
        return np.broadcast_to(force, points.shape)

    def _scale(self, group: ElementGroup) -> float:
        """Return the density."""
        return group.material.density

    def by_density(self, mesh: Mesh, groups: Sequence[ElementGroup], v: Array) -> Array:
        """Return ∫ v·g dV (m,) of each element, in J m³/kg."""
        out, force = np.zeros(mesh.n_elements), self._checked_force(mesh)
        for part in self._carriers(mesh, groups):
            for rows, _, work, _ in gauss_point_fields.body_work(mesh.points, part, force, v):
                out[rows] = work.sum(axis=1)
        return out
