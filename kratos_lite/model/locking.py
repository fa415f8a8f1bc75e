"""Locking forecast: elements that will come out too stiff, and the better choice by name.

A plain linear element bends by shearing: its energy exceeds that of bending by G/E (a/t)², with a its length
and t the thickness of the wall; here that of the element, as if it were alone through the wall.  In a brick
with B-bar bending makes no pressure: its energy is 4/3 G/E, or G/E if it widens freely, in place of 1.

Source: Hughes, The Finite Element Method (1987), ch. 4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.custom import is_builtin
from kratos_lite.elements.formulations import NEAR_HALF, bulk_over_shear, formulations_of
from kratos_lite.materials import Material
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array

LONG = 2.0 * (1 - 1e-9)
"""Longest edge over the shortest one from which a cell may come out too stiff in bending."""
QUADRATIC = {"tetrahedron": "3D10N", "wedge": "3D15N", "pyramid": "3D13N", "hexahedron": "3D20N"}


def check_locking(mesh: Mesh, groups: Sequence[ElementGroup]) -> list[str]:
    """Return a warning for each element class that will lock, with the better choice."""
    softer = [group for group in groups if bulk_over_shear(group.material.C) <= NEAR_HALF]
    warnings = [*_in_constant_volume(groups), *_with_apex(softer)]
    for element in dict.fromkeys(group.element for group in groups if _shears(group.element)):
        warnings += _in_bending(mesh, element, [group for group in groups if group.element is element])
    return warnings


# ---- by element and material ---------------------------------------------------------------------------


def _in_constant_volume(groups: Sequence[ElementGroup]) -> list[str]:
    """Warn of plain elements with ν near ½, and of linear ones whose plastic flow keeps the volume."""
    replacements: dict[str, dict[str, str]] = {}
    for element, law in ((group.element, group.material) for group in groups):
        linear = len(element.nodes) == element.shape.corners
        plain = element.formulation == "standard" or (element.formulation == "total_lagrangian" and linear)
        if element.custom or not plain:
            continue
        if bulk_over_shear(law.C) > NEAR_HALF:
            why, better = "Poisson's ratio lies so near 0.5", better_element(element, "BBar", law)
        elif law.keeps_volume and linear:
            why = f"{type(law).__name__} flows without change of volume"
            flowing = formulations_of(element.shape).get("f_bar" if element.finite else "b_bar")
            better = flowing.__name__ if flowing else better_element(element)
        else:
            continue
        replacements.setdefault(why, {})[element.__name__] = better
    return [
        f"{why}: {', '.join(sorted(names))} may lock (come out far too stiff); take "
        f"{', '.join(sorted(set(names.values())))}"
        for why, names in replacements.items()
    ]


def _with_apex(groups: Sequence[ElementGroup]) -> list[str]:
    """Warn of linear tetrahedra, and of linear pyramids unless they are few, between other elements."""
    counts: dict[type[KinematicLinear], int] = {}
    for group in groups:
        if is_builtin(group.element) and len(group.element.nodes) in (4, 5):
            counts[group.element] = counts.get(group.element, 0) + len(group)
    half = sum(map(len, groups)) / 2
    return [
        f"{element.__name__} locks in bending (comes out far too stiff); take {better_element(element)}"
        for element, count in counts.items()
        if element.shape.cell == "tetrahedron" or count > half
    ]


def _takes_enhanced(material: Material) -> bool:
    """Return whether enhanced strains find equilibrium: not where a law softens, or flows off the normal."""
    softens = {"element_length", "element_radius"} & material.internal_variables.keys()
    return material.symmetric_tangent and not softens


def better_element(
    element: type[KinematicLinear], family: str = "KinematicLinear", law: Material | None = None
) -> str:
    """Return the name of the element to take in place of one that locks."""
    known = formulations_of(element.shape)
    if element.finite:
        quadratic = f"TotalLagrangianElement{QUADRATIC[element.shape.cell]}"
        return known["f_bar"].__name__ if family == "BBar" and "f_bar" in known else quadratic
    if "enhanced" in known and (law is None or _takes_enhanced(law)):
        return known["enhanced"].__name__
    linear = len(element.nodes) == element.shape.corners
    return f"{family}{QUADRATIC[element.shape.cell]}" if linear else known["b_bar"].__name__


# ---- in bending ----------------------------------------------------------------------------------------


def _in_bending(mesh: Mesh, element: type[KinematicLinear], groups: Sequence[ElementGroup]) -> list[str]:
    """Warn of plain linear bricks and wedges that are long: of the one with most G/E (a/t)², by its edges."""
    most, text, points = 0.0, "", mesh.points.T.copy()
    for group in groups:
        X = np.take(
            points, group.nodes.T, axis=1
        )  # (3, k, m): all elements at once for one edge after another
        longest, shortest = np.zeros(len(group)), np.full(len(group), np.inf)
        for a, b in element.shape.edges:
            square = sum((x[a] - x[b]) ** 2 for x in X)
            np.maximum(longest, square, out=longest)
            np.minimum(shortest, square, where=square > 0, out=shortest)
        ratio = np.sqrt(longest / shortest)
        G, projected = _shear_over_young(group.material.C), element.formulation in ("b_bar", "f_bar")
        worst = int(np.argmax(ratio))
        factor = G * float(ratio[worst]) ** 2 + (4 / 3 * G if projected else 1)
        if ratio[worst] >= LONG and factor > most:
            most, identifier = factor, mesh.element_ids[group.rows[worst]]
            text = f"such as element {identifier} ({ratio[worst]:.3g} times as long as thick)"
            if projected:
                text += f", or up to {1 / G:.2g} times too soft where it is alone through a thickness"
            text += f"; take {better_element(element, law=group.material)}"
    return [f"{element.__name__} may come out up to {most:.2g} times too stiff in bending, {text}"] * bool(
        text
    )


def _shear_over_young(C: Array) -> float:
    """Return the mean shear modulus over the mean of Young's moduli of a C (6, 6)."""
    return float(C.diagonal()[3:].mean() * np.linalg.inv(C).diagonal()[:3].mean())


def _shears(element: type[KinematicLinear]) -> bool:
    """Return whether an element is a plain linear brick or wedge of the library, which bends by shearing."""
    linear = element.shape.cell in ("hexahedron", "wedge") and len(element.nodes) == element.shape.corners
    return linear and is_builtin(element) and element.formulation != "enhanced"
