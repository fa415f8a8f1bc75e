"""Spurious modes: deformations without energy, of an element alone, or of a mesh with reduced integration.

Hourglass modes are those that a rule, or a step of an own element class, lets pass.  A 20-node hexahedron
with 2x2x2 points has six modes without energy beside the rigid ones.  With

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
from kratos_lite.assembly.gauss_point_fields import clearly_positive
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.kinematic_linear import ELEMENTS
from kratos_lite.elements.tables import tabulate
from kratos_lite.errors import InputError, MeshError, ModelError
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh import Mesh, with_rows
from kratos_lite.mesh.topology import faces_of
from kratos_lite.model.supports import Supports
from kratos_lite.quadrature import Rule
from kratos_lite.registry import remembered
from kratos_lite.typing import Array, Ints, Mask

NO_ENERGY = 1e-9
"""Eigenvalues of an element stiffness up to this fraction of the largest one are 0."""
DISTORTION = 0.04
"""Of the size of the reference cell by which nodes move in the distorted one."""


@remembered
def hourglass_modes(element: type[KinematicLinear], rule: Rule) -> int:
    """Return how many modes without energy beside the six rigid ones an element has with a rule."""
    # The larger number of the reference cell and of a slightly distorted one.
    X, C = element.shape.nodes, Isotropic3D(E=1.0, nu=0.3).C
    size = DISTORTION * float(np.ptp(X, axis=0).max())
    cells = (X, X + np.random.default_rng(3).uniform(-size, size, X.shape))
    counts = []
    for cell in cells:
        K = np.asarray(element(cell, rule).stiffness(C))
        if K.shape != (X.size, X.size):
            raise InputError(
                f"{element.__name__}.stiffness must return shape {(X.size, X.size)} here; got {K.shape}; "
                "see docs/howto/own-element.md"
            )
        if not np.isfinite(K).all():
            return 0  # NaN is found by other checks
        values = np.linalg.eigvalsh((K + K.T) / 2)
        counts.append(int((values <= NO_ENERGY * np.abs(values).max()).sum()) - 6)
    return max(0, *counts)


def check_rules(mesh: Mesh, groups: Sequence[ElementGroup]) -> list[str]:
    """Check rules that replace those of their classes, and classes that are not of the library.

    Raises MeshError where det J ≤ 0 at a point of such a rule, and ModelError for an own class with hourglass
    modes that it does not state; returns warnings of all others.
    """
    warnings: list[str] = []
    for group in groups:
        element, rule, own = group.element, group.rule, group.element.rule
        if group.is_proven:
            continue
        if rule is own:
            warnings += _check_class(element)
            continue
        _check_points(mesh, group)
        if n := hourglass_modes(element, rule):
            warnings.append(
                f"{element.__name__} with {_points(rule)} has {_modes(n)}; its own rule has {_points(own)} "
                f"and {hourglass_modes(element, own) or 'none'}"
            )
    return list(dict.fromkeys(warnings))


def _check_points(mesh: Mesh, group: ElementGroup) -> None:
    """Raise MeshError where det J is not positive at a point of the rule of a group."""
    _, dN = tabulate(group.element.shape, group.rule)
    part = group.take(~clearly_positive(mesh.points, group.nodes, group.element, dN, len(dN)))
    for chunk in part.chunks():
        bad = (part.at(mesh.points, chunk).determinants(dN) <= 0).any(axis=1)
        if bad.any():
            element = mesh.element_ids[part.rows[chunk][int(np.argmax(bad))]]
            raise MeshError(
                f"element {element} ({group.element.__name__}): det J must be > 0 at all points of "
                f"{group.rule}; the element's own rule, or a better shape, avoids this"
            )


def _check_class(element: type[KinematicLinear]) -> list[str]:
    """Warn of the hourglass modes that an own class states; raise ModelError for further ones."""
    modes, name = hourglass_modes(element, element.rule), element.__name__
    if modes > element.spurious_modes:
        cures = [f"take a rule with more points{_rule_of_library(element)}"]
        if element.custom:
            cures.append(f"correct {' and '.join(sorted(element.custom))}, which the class overrides")
        raise ModelError(
            f"{name} has {_modes(modes)} with its {_points(element.rule)}: beside rigid-body motions, an "
            f"element deforms in {modes} ways without energy, so that results may be many times too large; "
            f"{', or '.join(cures)}; or state spurious_modes = {modes} in the class to study them"
        )
    if not modes or has_chains(element):
        return []
    return [f"{name} has {_modes(modes)}, as it states; whether neighbors stop them is not checked"]


def _rule_of_library(element: type[KinematicLinear]) -> str:
    name = f"KinematicLinear3D{len(element.nodes)}N"
    alike = ELEMENTS[name] if name in ELEMENTS else element
    if alike.shape.cell != element.shape.cell or hourglass_modes(element, alike.rule):
        return ""
    return f" (rule = {name}.rule has {len(alike.rule)})"


def _points(rule: Rule) -> str:
    return f"{len(rule)} Gauss point{'s' if len(rule) > 1 else ''}"


def _modes(count: int) -> str:
    return f"{count} hourglass mode{'s' if count > 1 else ''}"


# ---- reduced integration in a mesh ----------------------------------------------------------------------


def has_chains(element: type[KinematicLinear]) -> bool:
    """Return whether this module knows where the modes that an element class states remain in a mesh."""
    return element.spurious_modes > 0 and element.shape.cell == "hexahedron" and len(element.nodes) == 20


def check_spurious_modes(mesh: Mesh, groups: Sequence[ElementGroup], supports: Supports) -> list[str]:
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
    mirrored, held = _supported(mesh.points, nodes, outer, supports.fixed)
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
            pairs = np.array([p for p in combinations(range(6), 2) if not np.isin(*columns[list(p)]).any()])
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
