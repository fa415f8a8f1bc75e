"""Formulations: the element class of a shape that a word means, and the one that does not lock."""

from __future__ import annotations

import numpy as np

from kratos_lite.elements.custom import is_builtin
from kratos_lite.elements.kinematic_linear import ELEMENTS, UNNAMED, KinematicLinear
from kratos_lite.errors import InputError, nearest
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array
from kratos_lite.validation import short

NON_LOCKING = "non_locking"
"""The word for the element of a shape that does not lock with a material."""
INCOMPRESSIBLE = 2 * (1 + 0.45) / (3 * (1 - 2 * 0.45)) * (1 + 1e-9)
"""Bulk modulus over shear modulus above which plain quadratic elements lose accuracy: ν > 0.45."""


def formulations_of(shape: type[Shape]) -> dict[str, type[KinematicLinear]]:
    """Return the element class of each formulation of a shape, those of the library before those of users.

    >>> from kratos_lite.shapes.hexahedra import Hexahedron8
    >>> {word: element.__name__ for word, element in formulations_of(Hexahedron8).items()}
    {'standard': 'KinematicLinear3D8N', 'enhanced': 'EnhancedStrain3D8N', 'b_bar': 'BBar3D8N'}
    """
    alike = [element for element in ELEMENTS.values(f"3D{len(shape.nodes)}N") if element.shape is shape]
    alike.sort(key=lambda element: (element.formulation, not is_builtin(element)))
    return {element.formulation: element for element in reversed(alike)}


def is_unnamed(name: str) -> bool:
    """Return whether the name of a block says only how many nodes its elements have.

    >>> is_unnamed("Element3D8N"), is_unnamed("SmallDisplacementElement3D8N")
    (True, False)
    """
    return name.startswith(UNNAMED) and name in ELEMENTS and name not in list(ELEMENTS)


def element_of(
    name: str, formulation: str | None, C: Array | None, unnamed: str = NON_LOCKING
) -> type[KinematicLinear]:
    """Return the class by which the elements of a block are computed.

    Parameters
    ----------
    name : registered name of the elements.
    formulation : a word in place of what the name says, or None.
    C : (6, 6) float, Pa, of their material; if not given, ``non_locking`` takes it for compressible.
    unnamed : the formulation of elements whose name says none, such as ``Element3D8N``.

    Raises
    ------
    InputError
        If the name is unknown, or its shape has no such formulation.
    """
    element = ELEMENTS[name]
    if not is_builtin(element):
        return element
    if formulation is None:
        if not is_unnamed(name):
            return element
        formulation = unnamed
    found = formulations_of(element.shape)
    if formulation == NON_LOCKING:
        if len(element.nodes) != element.shape.corners:
            formulation = "b_bar" if C is not None and is_nearly_incompressible(C) else "standard"
        else:
            formulation = "enhanced"
        return found.get(formulation, found["standard"])
    if formulation not in found:
        raise InputError(
            f"there is no formulation {formulation!r} of elements with {len(element.nodes)} nodes such as "
            f"{element.__name__}; there is {', '.join([*found, NON_LOCKING])}"
        )
    return found[formulation]


def checked_formulation(word: object) -> str:
    """Return the word of a formulation; InputError if no element has it."""
    known = sorted({element.formulation for element in ELEMENTS.values()} | {NON_LOCKING})
    if not isinstance(word, str) or word not in known:
        hint = nearest(word, known) if isinstance(word, str) else ""
        raise InputError(f"formulation must be one of {', '.join(known)}; got {short(word)}.{hint}")
    return word


def is_nearly_incompressible(C: Array) -> bool:
    """Return whether elements need a projected dilatation for a C (6, 6): ν > 0.45 if it is isotropic.

    Otherwise by the bulk modulus against equal pressure, 1 / mᵀC⁻¹m, over the mean shear modulus: a material
    that is stiff along fibers alone changes its volume easily.

    >>> from kratos_lite import Isotropic3D
    >>> [is_nearly_incompressible(Isotropic3D(E=1.0, nu=nu).C) for nu in (0.3, 0.45, 0.46)]
    [False, False, True]
    """
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
