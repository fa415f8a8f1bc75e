"""Pressure that follows the faces of the deformed body."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kratos_lite.assembly.element_groups import add_nodal
from kratos_lite.bodies.free_body import FreeBody
from kratos_lite.bodies.linear_algebra import Entries, block_entries, sum_of
from kratos_lite.bodies.loads.base import AppliedLoad, BodyLoad
from kratos_lite.elements.surface import surface_pressure, surface_pressure_tangent
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Where
from kratos_lite.model.loads.surface import outward
from kratos_lite.typing import Array
from kratos_lite.validation import finite


class FollowerPressure(BodyLoad):
    """Pressure on faces of the deformed body: it follows their normals and areas.

    A positive pressure pushes into the body.  `kratos_lite.Pressure` is the dead one: normals and areas are
    those of the undeformed body (as in Solfec-1.0, whose sign is the other way round).

    Parameters
    ----------
    where : part; its conditions if it has any, otherwise the boundary faces among its nodes.
    pressure : Pa.

    Raises
    ------
    InputError
        The pressure is not one number.
    """

    def __init__(self, where: Where, pressure: float) -> None:
        value = finite(pressure, "a pressure")
        if value.ndim:
            raise InputError(f"a pressure must be one number in Pa; got {pressure}")
        self.where, self.pressure = where, float(value)

    def bind(self, body: FreeBody) -> AppliedLoad:
        """Return the load on a body.

        Raises
        ------
        ModelError
            The body is a batch of bodies or has no mesh, or there are no such faces.
        """
        mesh = body.mesh
        if mesh is None:
            raise ModelError("a pressure acts on the faces of a mesh; this body has none")
        blocks = [(block, self.pressure * outward(mesh, block)) for block in mesh.faces(self.where)]
        if not blocks:
            raise ModelError(f"a pressure finds no face on {self.where!r}")

        def nodal(x: Array) -> Array:
            total = np.zeros_like(x)
            for block, p in blocks:
                assert block.shape is not None
                add_nodal(total, block.nodes, surface_pressure(block.shape, x[block.nodes], p))
            return total

        def generalized(q: Array, u: Array, time: float) -> Array:
            if q.ndim > 1:
                raise ModelError("a following pressure acts on single bodies; integrate them one by one")
            return body.generalized_nodal_force(nodal(body.position(mesh.points, q)), q)

        def tangent(q: Array, u: Array, time: float) -> Entries:
            x = body.position(mesh.points, q)
            return body.generalized_nodal_tangent(sum_of(changes(x)))

        def changes(x: Array) -> Iterator[Entries]:
            for block, p in blocks:
                assert block.shape is not None
                dofs = (3 * block.nodes[..., None] + np.arange(3)).reshape(len(block.nodes), -1)
                change = surface_pressure_tangent(block.shape, x[block.nodes], p)
                yield block_entries(dofs, dofs, change)

        return AppliedLoad(generalized, tangent=tangent)
