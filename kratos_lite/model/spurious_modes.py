"""Spurious modes: where elements with reduced integration can deform without stress.

A 20-node hexahedron with 2x2x2 points has six modes without energy beside the rigid ones.  With

    m1 = (0, η (3ζ² - 1), -ζ (3η² - 1)),   m2 = (-ξ (3ζ² - 1), 0, ζ (3ξ² - 1)),   m3 likewise,

they are m1 and ξ m1, m2 and η m2, m3 and ζ m3 in covariant components: their strains vanish at the points
±1/√3.  Across a face ξ = ±1, m2 and m3 cannot continue into a neighbor, as one of their components keeps its
sign there and the other one changes it; nor into the mirror image beyond a plane of symmetry.  So they are
absent from any element that has a neighbor along ξ, and m1 is left, with an amplitude that is linear along ξ
and continuous through a chain of such neighbors.  An element with neighbors along two of its axes has none,
and holds the amplitude of a chain that ends at it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements import KinematicLinear
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Mesh, with_rows
from kratos_lite.mesh.topology import faces_of
from kratos_lite.model.supports import Supports
from kratos_lite.typing import Array, Ints, Mask


def has_chains(element: type[KinematicLinear]) -> bool:
    """Return whether this module knows where the modes that an element class states remain in a mesh."""
    return element.spurious_modes > 0 and element.shape.cell == "hexahedron" and len(element.nodes) == 20


def check_spurious_modes(
    mesh: Mesh, groups: Sequence[ElementGroup], supports: Supports | None = None
) -> list[str]:
    """Raise ModelError that names an element with reduced integration which can deform without stress.

    Constraints between degrees of freedom do not count as supports.
    """
    reduced = np.zeros(mesh.n_elements, dtype=bool)
    for group in groups:
        if has_chains(group.element) and group.rule is group.element.rule:
            reduced[group.rows] = True
    if not reduced.any():
        return []
    faces = mesh.all_faces
    neighbor = np.full(len(faces.element), -1)
    neighbor[faces.one], neighbor[faces.other] = faces.other, faces.one
    for open_ in faces.non_conforming():
        neighbor[open_] = -1
    ends, nodes = _ends(mesh, reduced)
    outer = neighbor[ends] < 0
    fixed = np.zeros(mesh.points.shape, dtype=bool) if supports is None else supports.fixed
    mirrored, held = _supported(mesh.points, nodes, outer, fixed)
    joined: Mask = np.any(~outer | mirrored, axis=2)  # (m, 3)
    elements = faces.element[ends[:, 0, 0]]
    sound = ~reduced
    sound[elements[joined.sum(axis=1) >= 2]] = True
    held |= ~outer & sound[faces.element[neighbor[ends]]]
    chained = np.all(joined[:, :, None] & held, axis=2)
    free = np.zeros(mesh.n_elements, dtype=bool)
    free[elements] = ~sound[elements] & ~np.any(chained, axis=1)
    if free.any():
        index = int(free.argmax())
        element = next(group.element.__name__ for group in groups if index in group.rows)
        raise ModelError(
            f"element {mesh.element_ids[index]} ({element}) can deform without stress: {free.sum()} "
            "elements have neighbors along one axis at most, and 2x2x2 points do not see all of their "
            "deformations; take BBar3D20N or KinematicLinear3D20N, or more elements side by side"
        )
    return []


def _ends(mesh: Mesh, reduced: Mask) -> tuple[Ints, Ints]:
    """Return the numbers (m, 3, 2) of the faces at both ends of each axis, and their nodes (m, 3, 2, 8)."""
    ends, nodes, start = [], [], 0
    for block, at in with_rows(mesh.blocks):
        cells, columns = np.flatnonzero(reduced[at]), np.array(faces_of(block))
        if len(cells):
            apart = [
                (i, j) for i, j in combinations(range(6), 2) if not np.isin(columns[i], columns[j]).any()
            ]
            pairs = np.array(apart)
            ends.append(start + pairs * len(block) + cells[:, None, None])
            nodes.append(block.nodes[cells][:, columns[pairs]])
        start += len(faces_of(block)) * len(block)
    return np.concatenate(ends), np.concatenate(nodes)


def _supported(points: Array, nodes: Ints, outer: Mask, fixed: Mask) -> tuple[Mask, Mask]:
    """Return which outer faces (m, 3, 2) are fixed along their normal, as mirrors, and which in the plane."""
    along = fixed[nodes].all(axis=3) & outer[..., None]
    normal = np.full(along.shape, 0.5)  # of curved faces, and of those that are not fixed
    if (chosen := along.any(axis=3)).any():
        X = points[nodes[chosen]]
        spread, axes = np.linalg.svd(X - X.mean(axis=1, keepdims=True), full_matrices=False)[1:]
        flat = spread[:, 2] < 1e-9 * spread[:, 0]
        normal[chosen] = np.where(flat[:, None], np.abs(axes[:, 2]), 0.5)
    clamped = along.all(axis=3)
    mirrored, held = ((along & mask).any(axis=3) for mask in (normal > 1 - 1e-9, normal < 1e-9))
    return np.asarray(clamped | mirrored), np.asarray(clamped | held)
