"""Loads on the conditions of a mesh, as files state them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, add_nodal
from kratos_lite.elements.surface import surface_load, surface_pressure
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Block, Mesh, with_rows
from kratos_lite.model.loads.base import Load
from kratos_lite.model.loads.surface import SURFACES

if TYPE_CHECKING:
    from kratos_lite.mesh.refined_mesh import RefinedMesh
from kratos_lite.typing import Array


class ConditionLoads(Load):
    """Loads on the conditions of the mesh, as a file states them.

    The load on a condition is its own value plus the one interpolated from its nodes.

    Parameters
    ----------
    force : (c, 3) per condition; Pa on faces, N/m on lines, N on points.
    nodal_force : (n, 3) per node, by the cell of the conditions that carry it.
    pressure : (c,) per condition, Pa, positive against the normal about which the nodes of the
        condition run counter-clockwise.
    nodal_pressure : (n,) per node, Pa.
    """

    def __init__(
        self, force: Array, nodal_force: dict[str, Array], pressure: Array, nodal_pressure: Array
    ) -> None:
        self.force, self.nodal_force = force, nodal_force
        self.pressure, self.nodal_pressure = pressure, nodal_pressure

    def forces(self, mesh: Mesh, groups: Sequence[ElementGroup]) -> Array:
        """Return the nodal forces (n, 3) in N."""
        total = np.zeros_like(mesh.points)
        for block, rows in with_rows(mesh.conditions):
            _check_loadable(block, bool(self.force[rows].any()), bool(self.pressure[rows].any()))
            if block.shape is None or not len(block):
                continue
            X = mesh.points[block.nodes]
            force = self.force[rows, None, :] + self.nodal_force[block.shape.cell][block.nodes]
            if force.any():
                add_nodal(total, block.nodes, surface_load(block.shape, X, force))
            pressure = self.pressure[rows, None] + self.nodal_pressure[block.nodes]
            if pressure.any() and block.shape.cell in SURFACES:
                add_nodal(total, block.nodes, surface_pressure(block.shape, X, pressure))
        return total

    def refined(self, finer: RefinedMesh) -> Load:
        """Return the loads on a finer mesh: conditions keep those of their parents, nodes interpolate."""
        return ConditionLoads(
            self.force[finer.conditions],
            {cell: finer.interpolate(force) for cell, force in self.nodal_force.items()},
            self.pressure[finer.conditions],
            finer.interpolate(self.nodal_pressure),
        )


def _check_loadable(block: Block, force: bool, pressure: bool) -> None:
    """Raise ModelError for a load stated on conditions that cannot carry it."""
    if block.shape is None and (force or pressure):
        raise ModelError(f"a load is given on conditions of the unknown kind {block.name}")
    if block.shape is not None and pressure and block.shape.cell not in SURFACES:
        raise ModelError(f"a pressure acts on faces; {block.name} is not one")
