"""The ends of a window: the two faces at which it cuts the body, and what they do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.ale.motion import Translation
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.elements.surface import surface_mass
from kratos_lite.errors import ModelError
from kratos_lite.materials import LinearMaterial
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array, Ints
from kratos_lite.voigt import acoustic_tensor

if TYPE_CHECKING:
    from kratos_lite.solvers.constrained_system import ConstrainedSystem


FLAT = 1e-6
"""Share of the length of the window by which an end face may be uneven."""


def end_nodes(mesh: Mesh, motion: Translation) -> tuple[Ints, Ints]:
    """Return the rows of the nodes at the lower and the upper end along the direction."""
    x = mesh.points @ motion.direction
    used = mesh.used_nodes()
    low, high = float(x[used].min()), float(x[used].max())
    near = FLAT * (high - low)
    return np.flatnonzero((x <= low + near) & used), np.flatnonzero((x >= high - near) & used)


def dashpots(mesh: Mesh, motion: Translation, system: ConstrainedSystem) -> BlockMatrix:
    """Return the damping of absorbing ends, (3a, 3a) in N s/m; see `impedance`.

    Source: Lysmer & Kuhlemeyer, J. Eng. Mech. Div. ASCE 95 (1969) 859-877.
    """
    pattern = system.pattern
    data = np.zeros((len(pattern.indices), 3, 3))
    rows = np.repeat(np.arange(pattern.n_nodes, dtype=np.int64), np.diff(pattern.indptr))
    keys = rows * pattern.n_nodes + pattern.indices
    local = np.full(mesh.n_nodes, -1)
    local[system.nodes] = np.arange(len(system.nodes))
    of_element = np.zeros((mesh.n_elements, 3, 3))
    for group in system.groups:
        of_element[group.rows] = impedance(group.material, motion.direction)
    for nodes in end_nodes(mesh, motion):
        faces = mesh.faces(nodes)
        if not faces:
            raise ModelError(
                "an end of the window has no face across the direction "
                f"{motion.direction.tolist()}, so nothing can absorb waves there; cut the body across it, or "
                "take ends='natural'"
            )
        for block in faces:
            assert block.shape is not None
            m = surface_mass(block.shape, mesh.points[block.nodes])
            blocks = m[..., None, None] * of_element[block.ids][:, None, None]
            cells = local[block.nodes]
            places = np.searchsorted(keys, cells[:, :, None] * pattern.n_nodes + cells[:, None, :])
            np.add.at(data, places, blocks)
    return BlockMatrix(data, pattern.indices, pattern.indptr)


def impedance(material: LinearMaterial, direction: Array) -> Array:
    """Return √(ρ Γ) (3, 3) in N s/m³ with the acoustic tensor Γ of plane waves along a unit direction.

    Of an isotropic material it is ρ c_p along the direction and ρ c_s across it.

    >>> from kratos_lite.materials import Isotropic3D
    >>> impedance(Isotropic3D(E=4.0, nu=0.0, density=1.0), np.array([1.0, 0, 0])).round(9).diagonal().tolist()
    [2.0, 1.414213562, 1.414213562]
    """
    squares, ways = np.linalg.eigh(acoustic_tensor(material.C, direction))
    return np.asarray((ways * np.sqrt(material.density * squares)) @ ways.T)


def periodic_pairs(mesh: Mesh, motion: Translation) -> tuple[Ints, Ints]:
    """Return the nodes of the upper end and those of the lower one that they meet.

    Raises
    ------
    ModelError
        If the nodes of the two ends do not lie opposite one another.
    """
    low, high = end_nodes(mesh, motion)
    across = np.eye(3) - np.outer(motion.direction, motion.direction)
    a, b = mesh.points[low] @ across, mesh.points[high] @ across
    size = float(np.ptp(mesh.points, axis=0).max())
    if len(low) == len(high):
        distance = np.abs(a[:, None, :] - b[None]).max(axis=2)
        nearest = distance.argmin(axis=0)
        if len(set(nearest.tolist())) == len(high) and distance.min(axis=0).max() <= FLAT * size:
            return high, low[nearest]
    raise ModelError(
        f"periodic ends need nodes that lie opposite one another; there are {len(low)} and {len(high)}, "
        "not in the same places"
    )
