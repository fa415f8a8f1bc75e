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

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements import KinematicLinear
from kratos_lite.errors import ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.model.opposite_faces import OppositeFaces, opposite_of
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
    across = OppositeFaces(mesh, faces)
    for open_ in faces.non_conforming():
        across.mate[open_] = -1
    ends = _ends(across, reduced)
    fixed = np.zeros(mesh.points.shape, dtype=bool) if supports is None else supports.fixed
    mirrored, held = _supported(across, ends[across.outer[ends]], fixed)
    joined: Mask = np.any((~across.outer | mirrored)[ends], axis=2)  # (m, 3)
    rows = faces.element[ends[:, 0, 0]]
    sound = ~reduced
    sound[rows[joined.sum(axis=1) >= 2]] = True
    held |= across.beyond(sound[faces.element])
    chained = np.all(joined[:, :, None] & held[ends], axis=2)
    free = np.zeros(mesh.n_elements, dtype=bool)
    free[rows] = ~sound[rows] & ~np.any(chained, axis=1)
    if free.any():
        row = int(free.argmax())
        raise ModelError(
            f"element {mesh.element_ids[row]} ({_name(groups, row)}) can deform without stress: {free.sum()} "
            "elements have neighbors along one axis at most, and 2x2x2 points do not see all of their "
            "deformations; take BBar3D20N or KinematicLinear3D20N, or more elements side by side"
        )
    return []


def _name(groups: Sequence[ElementGroup], row: int) -> str:
    return next(group.element.__name__ for group in groups if (group.rows == row).any())


def _ends(across: OppositeFaces, reduced: Mask) -> Ints:
    """Return the faces (m, 3, 2) at the ends of the axes of all elements with reduced integration."""
    found, start = [], 0
    for number, block in enumerate(across.mesh.blocks):
        cells = np.flatnonzero(reduced[start : start + len(block)])
        start += len(block)
        if len(cells) and block.shape is not None:
            pairs = np.array([(i, j) for i, j in enumerate(opposite_of(block.shape)) if i < j])
            found.append(across.number(number, pairs, cells[:, None, None]))
    return np.concatenate([np.zeros((0, 3, 2), dtype=np.int64), *found])


def _supported(across: OppositeFaces, outer: Ints, fixed: Mask) -> tuple[Mask, Mask]:
    """Return which of all faces are fixed along their normal, as mirrors, and which within their plane.

    `outer` are those to look at; `fixed` (n, 3) says which components of the nodes are.
    """
    mirrored = np.zeros(len(across.mate), dtype=bool)
    held = mirrored.copy()
    outer = outer[np.any(np.all(fixed[across.corners(outer)], axis=1), axis=1)]
    for face, nodes in zip(outer.tolist(), across.nodes(outer), strict=True):
        all_fixed = fixed[nodes].all(axis=0)
        if all_fixed.any():
            normal = _normal(across.mesh.points[nodes])
            mirrored[face] = all_fixed.all() or bool((all_fixed & (normal > 1 - 1e-9)).any())
            held[face] = all_fixed.all() or bool((all_fixed & (normal < 1e-9)).any())
    return mirrored, held


def _normal(X: Array) -> Array:
    """Return the absolute components of the normal of a flat face X (k, 3); 0.5 for a curved one."""
    spread, axes = np.linalg.svd(X - X.mean(axis=0))[1:]
    return np.abs(axes[2]) if spread[2] < 1e-9 * spread[0] else np.full(3, 0.5)
