"""Nodal loads: forces on nodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError, MeshError, ModelError
from kratos_lite.mesh import Mesh, Where
from kratos_lite.mesh.blocks import without_repeats
from kratos_lite.mesh.selection import ONE_PLACE, near, nodes_at, point_of
from kratos_lite.model.loads.base import Drawn, Load, nodal, vectors
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.typing import Array, ArrayLike, Ints
from kratos_lite.validation import flag, short

if TYPE_CHECKING:
    from kratos_lite.mesh.refined_mesh import RefinedMesh


class PointLoad(Load):
    """A force on a point, or the same force on each node of a part.

    Parameters
    ----------
    where : a point (x, y, z) in m, or nodes.  A force on a point acts on the node there, or else on the nodes
        of the element around it, by its shape functions N.
    force : (3,) float, N: in all on a point, on each of several nodes.
    each : several nodes are refused otherwise: `Resultant` spreads a force over the faces of a part.
    local : axes of the force, at the point or at each node; x y z if not given.

    Examples
    --------
    >>> from kratos_lite import box
    >>> PointLoad((0.5, 0.5, 1.0), (0, 0, -8.0)).forces(box(), [])[:, 2].astype(int).tolist()
    [0, -2, 0, -2, 0, -2, 0, -2]
    """

    unit = " [N]"

    def __init__(
        self, where: Where, force: ArrayLike, each: bool = False, *, local: LocalAxes | None = None
    ) -> None:
        self.where, self.each = where, flag(each, "each")
        self.force = vectors(force, "a point load", "(3,) in N")
        self._point = point_of(where)
        self._along(local)

    def check(self, mesh: Mesh) -> None:
        """Check that the point lies in the mesh, or that the nodes exist.

        Raises
        ------
        MeshError
            They do not.
        ModelError
            There are several nodes, and the force was not said to be on each.
        """
        if self._point is None:
            self._nodes(mesh)
        else:
            around(mesh, self._point)

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N.

        Raises
        ------
        MeshError
            The point lies outside the mesh, or there is no such part or node.
        ModelError
            No node is chosen, or several, and the force was not said to be on each.
        """
        return nodal(mesh, *self.on_nodes(mesh, groups))

    def on_nodes(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> tuple[Ints, Array]:
        """Return nodes (k,) and the forces (k, 3) in N there.

        Raises
        ------
        MeshError
            The point lies outside the mesh, or there is no such part or node.
        ModelError
            No node is chosen, or several, and the force was not said to be on each.
        """
        if self._point is not None:
            nodes, N = around(mesh, self._point)
            return nodes, N[:, None] * self._at(self._point)
        nodes = self._nodes(mesh)
        if mesh.whole and not len(nodes):
            raise ModelError(f"a point load finds no node in {self.where!r}")
        return nodes, np.broadcast_to(self._at(mesh.points[nodes]), (len(nodes), 3))

    def _nodes(self, mesh: Mesh) -> Ints:
        """Return the nodes chosen, each once."""
        nodes = without_repeats(mesh.nodes(self.where))
        if len(nodes) > 1 and not self.each:
            where = f"part {self.where!r}" if isinstance(self.where, str) else "what is chosen"
            force = short(self.force.tolist())
            raise ModelError(
                f"a point load on {where} would put {force} N on each of its {len(nodes)} nodes: if so, give "
                "each=True; a force in all is kl.Resultant(part, force), or --resultant"
            )
        return nodes

    def drawn(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> list[Drawn]:
        """Return the force on its point, or those on its nodes."""
        if self._point is None:
            return super().drawn(mesh, groups)
        return [(self._point[None], self._at(self._point)[None], "on")]

    def _at(self, points: Array) -> Array:
        """Return the force along x y z at points (..., 3) in m."""
        return self.force if self.local is None else self.local.globally(self.force, points)

    def by_coordinates(self, mesh: Mesh, groups: Sequence[ElementGroup], v: Array) -> Array:
        """Return 0: the point moves with its element; ModelError of one along local axes."""
        if self.local is not None:
            raise self.without_derivative("it is along local axes")
        return np.zeros_like(v)

    def refined(self, finer: RefinedMesh) -> Load:
        """Return the load on a finer mesh: on the same nodes or point."""
        same = finer.coarse.nodes(self.where) if self._point is None else self.where
        return PointLoad(same, self.force, self.each, local=self.local)


def around(mesh: Mesh, point: Array, what: str = "a point load") -> tuple[Ints, Array]:
    """Return the nodes (k,) on which something on a point acts, and its fraction (k,) on each."""
    nodes = nodes_at(point, mesh)
    nodes = nodes[mesh.used_nodes()[nodes]][:1]
    size = float(np.linalg.norm(mesh.extent[1] - mesh.extent[0]))
    if len(nodes) and np.linalg.norm(mesh.points[nodes[0]] - point) <= ONE_PLACE * size:
        return nodes, np.ones(1)
    located = mesh.locate(point)
    if located.inside:
        return located.nodes_and_weights()
    if mesh.whole and not len(nodes):
        raise MeshError(f"{what} at {point.tolist()} m acts outside the mesh; {near(point, mesh.points)}")
    return nodes, np.ones(len(nodes))


class NodalForces(Load):
    """Given nodal forces.

    Parameters
    ----------
    values : (n, 3) float, N.
    """

    unit = " [N]"

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

    def by_coordinates(self, mesh: Mesh, groups: Sequence[ElementGroup], v: Array) -> Array:
        """Return 0."""
        return np.zeros_like(v)

    def refined(self, finer: RefinedMesh) -> Load:
        """Return the load on a finer mesh: on the same nodes."""
        new = np.zeros((finer.mesh.n_nodes - len(self.values), 3))
        return NodalForces(np.concatenate([self.values, new]))
