"""Joints of elements: where they have the same nodes, or share corners but not what lies between."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh import NO_ROWS, Mesh, equal_sets, with_rows
from kratos_lite.mesh.topology import Sets, corners, faces_of, set_keys
from kratos_lite.typing import Ints


def check_joints(mesh: Mesh) -> list[str]:
    """Warn of elements with the same nodes, and of faces joined at their corners only."""
    faces = mesh.all_faces
    warnings = []
    one, other = equal_sets([(block.nodes, [range(block.nodes.shape[1])]) for block in mesh.blocks])
    count, ids = _pairs(mesh, one, other)
    if count:
        warnings.append(f"{count} elements have the same nodes as another ({ids}): both count")
    open_ = faces.non_conforming()
    count, ids = _pairs(mesh, *(faces.element[chosen] for chosen in open_))
    if count:
        warnings.append(
            f"{count} pairs of elements ({ids}) share the corners of a face but not its further "
            "nodes: the mesh is non-conforming there; use elements of the same order on both sides"
        )
    elements = _halved_squares(mesh)
    count, ids = _pairs(mesh, elements, elements)
    if count:
        warnings.append(
            f"{count} four-sided faces (the first of element {ids.split()[0]}) meet "
            "triangles: the mesh is non-conforming there; put pyramids or wedges between"
        )
    return warnings


def _pairs(mesh: Mesh, one: Ints, other: Ints) -> tuple[int, str]:
    """Return how many pairs of elements there are, and the ids of the first."""
    if not len(one):
        return 0, ""
    a, b = sorted(mesh.element_ids[[one[0], other[0]]].tolist())
    return len(one), f"{a} and {b}"


def _halved_squares(mesh: Mesh) -> Ints:
    """Return the elements of four-sided faces of which three corners are a triangular face."""
    sizes = {len(corners(face)) for block in mesh.blocks if len(block) for face in faces_of(block)}
    if sizes != {3, 4}:
        return NO_ROWS
    triangles: list[Sets] = []
    thirds: list[Sets] = []
    elements = [NO_ROWS]
    for block, at in with_rows(mesh.blocks):
        found = [corners(face) for face in faces_of(block)]
        triangles.append((block.nodes, [face for face in found if len(face) == 3]))
        for square in found:
            if len(square) != 4:
                continue
            thirds.append((block.nodes, [square[:i] + square[i + 1 :] for i in range(4)]))
            elements.append(np.arange(at.start, at.stop))
    keys = set_keys(triangles + thirds)
    n_triangles = sum(len(cells) * len(columns) for cells, columns in triangles)
    meets, start = [], n_triangles
    for cells, columns in thirds:
        stop = start + len(cells) * len(columns)
        meets.append(np.isin(keys[start:stop].reshape(4, -1), keys[:n_triangles]).any(axis=0))
        start = stop
    return np.concatenate(elements)[np.concatenate(meets)]
