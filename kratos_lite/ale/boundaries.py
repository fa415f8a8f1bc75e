"""Boundaries: of the part that moves, of the mesh where material passes through it, and of a moving frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.elements.surface import area_vectors, face_rule, surface_mass
from kratos_lite.errors import ModelError
from kratos_lite.materials import Material
from kratos_lite.mesh import Mesh, WhereElements, mask_of
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.typing import Array, Ints, Mask
from kratos_lite.voigt import acoustic_tensor

FLAT = 1e-6
"""Fraction of the length of the frame by which a cut face may be uneven."""
ALONG = 1e-6
"""Cosine of the angle between a tie and the flow from which the tie carries force along the flow."""


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
    normal = largest = 0.0
    for block in mesh.boundary:
        if block.shape is None or not len(block):
            continue
        rule = face_rule(block.shape)
        closed = ~np.any([np.isin(block.nodes, nodes).all(axis=1) for nodes in open_faces], axis=0)
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
                f"the body has no boundary face normal to {direction.tolist()} at one end, so nothing can "
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


# ---- the part that moves --------------------------------------------------------------------------------


def moving_nodes(mesh: Mesh, part: WhereElements) -> Mask:
    """Return the nodes (n,) of the elements of a part; ModelError if it shares one with other elements."""
    if part is None:
        return mesh.used_nodes()
    in_part = mask_of(mesh.elements(part), mesh.n_elements)
    if not in_part.any():
        raise ModelError("a part in motion needs one element at least; got none")
    moving, resting = mesh.used_nodes(in_part), mesh.used_nodes(~in_part)
    shared = np.flatnonzero(moving & resting)
    if len(shared):
        raise ModelError(
            f"{in_part.sum()} moving elements share {len(shared)} nodes with elements at rest, such as node "
            f"{mesh.node_ids[shared[0]]}: material cannot both flow and rest in one place; give each side "
            "its own nodes, and tie those along the normal of the face with model.constrain"
        )
    return moving


def check_ties(
    structure: Structure, moving: Mask, field: Callable[[Array], Array], travels: bool
) -> list[str]:
    """Return a warning of ties of moving to other material along its flow; ModelError if it travels."""
    glued = []
    for dependent, independents, weights, _ in structure.supports.constraints:
        dofs = np.array([dependent, *independents])
        nodes, axes = dofs // 3, dofs % 3
        if moving[nodes].all() or not moving[nodes].any():
            continue
        if travels:
            name = structure.supports.name(int(dofs[moving[nodes]][0]))
            raise ModelError(
                f"{name} travels with the center of the moving part, but a constraint ties it to a node that "
                "does not; remove one of them"
            )
        rows, at = np.unique(nodes, return_inverse=True)
        force = np.zeros((len(rows), 3))
        np.add.at(force, (at, axes), [-1.0, *weights])
        c = field(structure.mesh.points[rows])
        sizes = np.linalg.norm(c, axis=1) * np.linalg.norm(force, axis=1)
        along = np.abs((c * force).sum(axis=1)) > ALONG * sizes
        glued += rows[along & moving[rows]][:1].tolist()
    if not glued:
        return []
    return [
        f"{len(glued)} constraints hold moving material along its flow to material at rest, as glue would, "
        f"such as at node {structure.mesh.node_ids[glued[0]]}: tie only along the normal of the face"
    ]
