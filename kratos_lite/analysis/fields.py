"""Fields of a result: of nodes and elements under their Kratos names, and columns of a table of its nodes."""

from __future__ import annotations

from typing import Any, Protocol

from kratos_lite import voigt
from kratos_lite.analysis.columns import stress_columns, vector_columns
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.vtk import mesh_fields
from kratos_lite.typing import Array, Numbers


class Solution(Protocol):
    """What fields are made of, a `Result`."""

    mesh: Mesh
    u: Array
    reactions: Array

    def stress(self, at: str) -> Any:
        """Return stresses in Pa, of elements (m, 6) or recovered at nodes (n, 6)."""

    def error(self) -> Any:
        """Return the estimated error."""


def fields(result: Solution) -> tuple[dict[str, Numbers], dict[str, Numbers]]:
    """Return point data and cell data of a result, as files and viewers hold them."""
    points, cells = mesh_fields(result.mesh)
    nodal, mean = result.stress("node"), result.stress("element")
    points = {
        "DISPLACEMENT": result.u,
        "REACTION": result.reactions,
        "CAUCHY_STRESS_VECTOR": nodal,
        "VON_MISES_STRESS": voigt.von_mises(nodal),
        **points,
    }
    cells = {
        "CAUCHY_STRESS_VECTOR": mean,
        "VON_MISES_STRESS": voigt.von_mises(mean),
        "ENERGY_NORM_ERROR": result.error().per_element,
        **cells,
    }
    return points, cells


def nodal_columns(result: Solution) -> dict[str, Numbers]:
    """Return ids, places, displacements, reactions and recovered stresses of the nodes."""
    return {
        "node": result.mesh.node_ids,
        **vector_columns("", result.mesh.points, "m"),
        **vector_columns("displacement", result.u, "m"),
        **vector_columns("reaction", result.reactions, "N"),
        **stress_columns(result.stress("node")),
    }
