"""Hourglass modes: deformations without energy that a rule, or a step of an own element class, lets pass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import clearly_positive
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.kinematic_linear import ELEMENTS
from kratos_lite.elements.tables import tabulate
from kratos_lite.errors import InputError, MeshError, ModelError
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh import Mesh
from kratos_lite.model.spurious_modes import has_chains
from kratos_lite.quadrature import Rule
from kratos_lite.registry import remembered

NO_ENERGY = 1e-9
"""Eigenvalues of an element stiffness up to this fraction of the largest one are 0."""
DISTORTION = 0.04
"""Of the size of the reference cell by which nodes move in the distorted one."""


@remembered
def hourglass_modes(element: type[KinematicLinear], rule: Rule) -> int:
    """Return how many modes without energy beside the six rigid ones an element has with a rule.

    The larger number of the reference cell and of a slightly distorted one.
    """
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
            return 0  # what is no number is found by other checks
        values = np.linalg.eigvalsh((K + K.T) / 2)
        counts.append(int((values <= NO_ENERGY * np.abs(values).max()).sum()) - 6)
    return max(0, *counts)


def check_rules(mesh: Mesh, groups: Sequence[ElementGroup]) -> list[str]:
    """Check rules that replace those of their classes, and classes that are not of the library.

    Raises MeshError where det J ≤ 0 at a point of such a rule, and ModelError for an own class with hourglass
    modes that it does not state; returns warnings of all others.
    """
    if all(group.is_proven for group in groups):
        return []
    for group in groups:
        if group.rule is not group.element.rule:
            _check_points(mesh, group)
    replaced = [group for group in groups if group.rule is not group.element.rule]
    said = [
        f"{element.__name__} with {_points(rule)} has {_modes(n)}; its own rule has {_points(element.rule)} "
        f"and {hourglass_modes(element, element.rule) or 'none'}"
        for element, rule in dict.fromkeys((group.element, group.rule) for group in replaced)
        if (n := hourglass_modes(element, rule)) > 0
    ]
    own = dict.fromkeys(g.element for g in groups if g.rule is g.element.rule and not g.is_proven)
    return list(dict.fromkeys(said)) + [text for element in own if (text := _check_class(element))]


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


def _check_class(element: type[KinematicLinear]) -> str:
    """Return a warning of the hourglass modes that an own class states; raise ModelError for further ones."""
    modes, stated, name = hourglass_modes(element, element.rule), element.spurious_modes, element.__name__
    if not modes:
        return ""
    if modes > stated:
        cures = [f"take a rule with more points{_rule_of_library(element)}"]
        if element.custom:
            cures.append(f"correct {' and '.join(sorted(element.custom))}, which the class overrides")
        raise ModelError(
            f"{name} has {_modes(modes)} with its {_points(element.rule)}: beside rigid-body motions, an "
            f"element deforms in {modes} ways without energy, so that results may be many times too large; "
            f"{', or '.join(cures)}; or state spurious_modes = {modes} in the class to study them"
        )
    if has_chains(element):
        return ""
    return f"{name} has {_modes(modes)}, as it states; whether neighbors stop them is not checked"


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
