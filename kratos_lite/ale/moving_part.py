"""Parts: which nodes move where only a part of a model does, and what may join them to the rest."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.errors import ModelError
from kratos_lite.mesh import Mesh, WhereElements, with_rows
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array, Mask

ALONG = 1e-6
"""Cosine of the angle between a tie and the flow from which the tie carries force along the flow."""


def moving_nodes(mesh: Mesh, part: WhereElements) -> Mask:
    """Return the nodes (n,) of the elements of a part; ModelError if it shares one with other elements."""
    if part is None:
        return mesh.used_nodes()
    in_part = np.zeros(mesh.n_elements, dtype=bool)
    in_part[mesh.elements(part)] = True
    if not in_part.any():
        raise ModelError("a part in motion needs one element at least; got none")
    moving, resting = np.zeros((2, mesh.n_nodes), dtype=bool)
    for block, at in with_rows(mesh.blocks):
        moving[block.nodes[in_part[at]]] = True
        resting[block.nodes[~in_part[at]]] = True
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
