"""Formulations: the element class of a shape that a word means, and the one that does not lock."""

from __future__ import annotations

import numpy as np

from kratos_lite.elements.custom import is_builtin
from kratos_lite.elements.kinematic_linear import ELEMENTS, UNNAMED, KinematicLinear
from kratos_lite.errors import InputError
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array
from kratos_lite.validation import choice

NON_LOCKING = "non_locking"
"""The word for the element of a shape that does not lock with a material."""
INCOMPRESSIBLE = 2 * (1 + 0.45) / (3 * (1 - 2 * 0.45)) * (1 + 1e-9)
"""Bulk modulus over shear modulus above which plain quadratic elements lose accuracy: ν > 0.45."""


def formulations_of(shape: type[Shape]) -> dict[str, type[KinematicLinear]]:
    """Return the element class of each formulation of a shape, built-in before custom."""
    alike = [element for element in ELEMENTS.values(f"3D{len(shape.nodes)}N") if element.shape is shape]
    alike.sort(key=lambda element: (element.formulation, not is_builtin(element)))
    return {element.formulation: element for element in reversed(alike)}


def is_unnamed(name: str) -> bool:
    """Return whether the name of a block says only how many nodes its elements have, as ``Element3D8N``."""
    return name.startswith(UNNAMED) and name in ELEMENTS and name not in list(ELEMENTS)


def element_of(
    name: str, formulation: str | None, C: Array | None, unnamed: str = NON_LOCKING
) -> type[KinematicLinear]:
    """Return the class by which a block is computed, by its name or a word such as ``non_locking`` and C."""
    element = ELEMENTS[name]
    if not is_builtin(element):
        return element
    if formulation is None:
        if not is_unnamed(name):
            return element
        formulation = unnamed
    classes = formulations_of(element.shape)
    if formulation == NON_LOCKING:
        if len(element.nodes) != element.shape.corners:
            formulation = "b_bar" if C is not None and is_nearly_incompressible(C) else "standard"
        else:
            formulation = "enhanced"
        return classes.get(formulation, classes["standard"])
    if formulation not in classes:
        raise InputError(
            f"there is no formulation {formulation!r} of elements with {len(element.nodes)} nodes such as "
            f"{element.__name__}; there is {', '.join([*classes, NON_LOCKING])}"
        )
    return classes[formulation]


def checked_formulation(word: object) -> str:
    """Return the word of a formulation; InputError if no element has it."""
    known = sorted({element.formulation for element in ELEMENTS.values()} | {NON_LOCKING})
    return choice(word, "formulation", known)


def is_nearly_incompressible(C: Array) -> bool:
    """Return whether a C (6, 6) needs a projected dilatation: ν > 0.45 if it is isotropic."""
    return bulk_over_shear(C) > INCOMPRESSIBLE


NEAR_HALF = 50.0
"""Bulk over shear modulus (ν = 0.49) from which plain elements lock, and pressures of others pay."""


def bulk_over_shear(C: Array) -> float:
    """Return the bulk modulus 1 / mᵀC⁻¹m of a C (6, 6) over its mean shear modulus; 0 if C is singular."""
    m = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    try:
        flexible = float(m @ np.linalg.solve(C, m))
    except np.linalg.LinAlgError:
        return 0.0
    shear = float(C.diagonal()[3:].mean())
    return 1 / (flexible * shear) if flexible * shear > 0 else 0.0
