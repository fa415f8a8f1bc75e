"""Boundaries: where material passes through a mesh, and the two cut faces of a moving frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.elements.surface import area_vectors, face_rule, surface_mass
from kratos_lite.errors import ModelError
from kratos_lite.materials import Material
from kratos_lite.mesh import Mesh
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.typing import Array, Ints, Mask
from kratos_lite.voigt import acoustic_tensor

FLAT = 1e-6
"""Fraction of the length of the frame by which a cut face may be uneven."""


def cut_nodes(mesh: Mesh, direction: Array, moving: Mask) -> tuple[Ints, Ints]:
    """Return the rows of the moving nodes (n,) on both cut faces, lower and upper, along a unit direction."""
    x = mesh.points @ direction
    low, high = float(x[moving].min()), float(x[moving].max())
    near = FLAT * (high - low)
    return np.flatnonzero((x <= low + near) & moving), np.flatnonzero((x >= high - near) & moving)


def leak(
    mesh: Mesh, velocity: Callable[[Array], Array], moving: Mask, open_faces: Sequence[Ints] = ()
) -> float:
    """Return the largest normal velocity at closed boundaries as a fraction of the largest there."""
    normal, largest, is_open = 0.0, 0.0, np.zeros((len(open_faces) + 1, mesh.n_nodes), dtype=bool)
    for mask, nodes in zip(is_open, open_faces, strict=False):
        mask[nodes] = True
    for block in mesh.boundary:
        if block.shape is None or not len(block):
            continue
        rule = face_rule(block.shape)
        closed = ~is_open[:, block.nodes].all(axis=2).any(axis=0)
        X = mesh.points[block.nodes[closed & moving[block.nodes[:, 0]]]]
        n = area_vectors(block.shape, X, rule)
        n = n / np.linalg.norm(n, axis=-1, keepdims=True)
        N = np.array([block.shape.N(xi) for xi in rule.points])
        c = velocity(N @ X)
        normal = max(normal, float(np.abs((c * n).sum(axis=-1)).max(initial=0.0)))
        largest = max(largest, float(np.linalg.norm(c, axis=-1).max(initial=0.0)))
    return normal / largest if largest else 0.0


def dashpots(mesh: Mesh, direction: Array, system: ConstrainedSystem, moving: Mask) -> BlockMatrix:
    """Return the damping (3a, 3a) in N s/m of absorbing boundaries of moving nodes."""
    # Source: Lysmer & Kuhlemeyer, J. Eng. Mech. Div. ASCE 95 (1969) 859-877.
    pattern = system.pattern
    data = np.zeros((len(pattern.indices), 3, 3))
    keys = pattern.rows().astype(np.int64) * pattern.n_nodes + pattern.indices
    local = np.full(mesh.n_nodes, -1)
    local[system.nodes] = np.arange(len(system.nodes))
    of_element = np.zeros((mesh.n_elements, 3, 3))
    for group in system.groups:
        of_element[group.rows] = impedance(group.material, direction)
    for nodes in cut_nodes(mesh, direction, moving):
        faces = mesh.faces(nodes)
        if not faces:
            raise ModelError(
                f"the body has no face across the direction {direction.tolist()} at one end, so nothing can "
                "absorb waves there; cut the body across it, or take boundaries='natural'"
            )
        for block in faces:
            assert block.shape is not None
            m = surface_mass(block.shape, mesh.points[block.nodes])
            blocks = m[..., None, None] * of_element[block.ids][:, None, None]
            cells = local[block.nodes]
            at = np.searchsorted(keys, cells[:, :, None] * pattern.n_nodes + cells[:, None, :])
            np.add.at(data, at, blocks)
    return BlockMatrix(data, pattern.indices, pattern.indptr)


def impedance(material: Material, direction: Array) -> Array:
    """Return √(ρ Γ) (3, 3) in N s/m³, Γ the acoustic tensor of plane waves along a unit direction."""
    squares, ways = np.linalg.eigh(acoustic_tensor(material.C, direction))
    return np.asarray((ways * np.sqrt(material.density * squares)) @ ways.T)


def periodic_pairs(mesh: Mesh, direction: Array, moving: Mask) -> tuple[Ints, Ints]:
    """Return moving nodes of the upper cut face and the opposite ones of the lower; ModelError if none."""
    low, high = cut_nodes(mesh, direction, moving)
    across = np.eye(3) - np.outer(direction, direction)
    a, b = mesh.points[low] @ across, mesh.points[high] @ across
    size = float(np.ptp(mesh.points[moving], axis=0).max())
    if len(low) == len(high):
        distance = np.abs(a[:, None, :] - b[None]).max(axis=2)
        nearest = distance.argmin(axis=0)
        if len(set(nearest.tolist())) == len(high) and distance.min(axis=0).max() <= FLAT * size:
            return high, low[nearest]
    raise ModelError(
        "periodic boundaries need nodes that lie opposite one another; "
        f"there are {len(low)} and {len(high)}, not in the same places"
    )
