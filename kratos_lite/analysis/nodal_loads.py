"""Nodal forces of a structure: of its loads, its initial stress and the stresses of a result."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.mesh import Mesh
from kratos_lite.model.loads import Load
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array


def external_loads(mesh: Mesh, groups: Sequence[ElementGroup], loads: Sequence[Load]) -> Array:
    """Return the nodal forces (n, 3) in N of all loads."""
    total = np.zeros_like(mesh.points)
    for load in loads:
        total += load.forces(mesh, groups)
    return total


def initial_loads(model: Structure, groups: Sequence[ElementGroup]) -> Array | None:
    """Return ∫ B^T (σ0 - C ε0) dV: what prestress and stress-free displacement put on the nodes."""
    u0 = model.initial_displacement
    if u0 is None and model.prestress is None:
        return None
    start = np.zeros_like(model.mesh.points) if u0 is None else -u0
    return internal_load(model.mesh.points, groups, start)


def stress_load(model: Structure, groups: Sequence[ElementGroup], u: Array) -> Array:
    """Return ∫ B^T σ dV (n, 3) in N of the stresses that a result of u shows, with those of prestress."""
    u0 = model.initial_displacement
    return internal_load(model.mesh.points, groups, u if u0 is None else u - u0)
