"""Upper bound of the error in the energy norm, by stresses in equilibrium with the loads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.analysis.error_estimate import ErrorEstimate, Origin
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.equilibrated_error import lacking_energies
from kratos_lite.assembly.equilibrated_tractions import Sides, equilibrated, needed_forces, own_tractions
from kratos_lite.elements.geometry import GEOMETRY
from kratos_lite.elements.overridden_steps import STRESS
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.model.loads import Load, TimeDependentLoad
from kratos_lite.model.loads.base import ScaledLoad
from kratos_lite.model.loads.body import BodyForce
from kratos_lite.model.loads.surface import LineLoad, Pressure, Traction
from kratos_lite.typing import Array, Mask


def error_bound(origin: Origin, groups: Sequence[ElementGroup], u: Array, energy: float) -> ErrorEstimate:
    """Return an upper bound of the error in the energy norm.

    Parameters
    ----------
    origin : what was solved.
    groups : the elements.
    u : (n, 3) m, the displacements that strain.
    energy : of these, in J.

    Raises
    ------
    ModelError
        Loads, supports or elements are such that stresses in equilibrium are not known.
    """
    model = origin.model
    mesh, supports = model.mesh, model.supports
    if supports.constraints:
        raise ModelError(
            "the bound of the error takes neither multi-point constraints nor hanging nodes; ask for "
            "method='recovery'"
        )
    for group in groups:
        if not group.element.inherits(*GEOMETRY, *STRESS):
            raise ModelError(
                "the bound of the error is for elements whose strain is that of their displacements; "
                f"{group.element.__name__} has its own: take formulation='standard', or method='recovery'"
            )
    sides = Sides(mesh)
    body = [np.zeros((*group.nodes.shape, 3)) for group in groups]
    guess, area = own_tractions(sides, groups, u)
    free = _held(sides, groups, supports.fixed) & ~sides.inner[:, None]
    guess[~sides.inner[:, None] & ~free] = 0.0
    loads = np.zeros_like(guess)
    for load in origin.loads:
        _spread(load, 1.0, mesh, groups, body, sides, loads)
    guess += np.where(free, 0.0, loads)
    forces = equilibrated(sides, needed_forces(sides, groups, u, body), guess, area, free)
    squares = np.zeros(mesh.n_elements)
    for group, f in zip(groups, body, strict=True):
        own = [(face, forces[rows]) for face, rows in sides.of_group(group)]
        squares[group.rows] = lacking_energies(mesh.points, group, u, f, own)
    total = float(squares.sum())
    size = 2 * energy + total
    return ErrorEstimate(total**0.5, (total / size) ** 0.5 if size else 0.0, np.sqrt(squares), "equilibrated")


def _held(sides: Sides, groups: Sequence[ElementGroup], fixed: Mask) -> Mask:
    """Return on which sides (h, 3) all nodes are prescribed."""
    held = np.zeros((len(sides.node), 3), dtype=bool)
    for group in groups:
        for _, rows in sides.of_group(group):
            held[rows] = fixed[sides.node[rows]].all(axis=1, keepdims=True)
    return held


def _spread(
    load: Load,
    factor: float,
    mesh: Mesh,
    groups: Sequence[ElementGroup],
    body: Sequence[Array],
    sides: Sides,
    faces: Array,
) -> None:
    """Add a load to the forces per volume of the elements, or to those on the sides (h, 3)."""
    if isinstance(load, ScaledLoad):
        _spread(load.load, factor * load.amplitude(0.0), mesh, groups, body, sides, faces)
    elif isinstance(load, TimeDependentLoad):
        if (now := load.at(0.0)) is not None:
            _spread(now, factor, mesh, groups, body, sides, faces)
    elif isinstance(load, BodyForce):
        chosen = load.carriers(mesh)
        for group, f in zip(groups, body, strict=True):
            b, mine = load.per_volume(group, mesh.points), chosen[group.rows]
            f[mine] += factor * (b if b.ndim == 1 else b[group.nodes[mine]])
    elif isinstance(load, (Traction, Pressure)) and not isinstance(load, LineLoad):
        for block, forces in load.on_faces(mesh):
            sides.add(faces, block, factor * forces)
    else:
        raise ModelError(
            "the bound of the error takes loads per area and volume, Traction, Pressure, BodyForce and "
            f"Gravity; got {type(load).__name__}: ask for method='recovery'"
        )
