"""Names: the shape that the name of an element or condition in a file means."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches

from kratos_lite.errors import nearest
from kratos_lite.shapes import SHAPES, Shape
from kratos_lite.shapes.faces import FACE_SHAPES, Line2, Line3, Point1

SOLIDS = {
    4: "Tetrahedron4", 10: "Tetrahedron10", 5: "Pyramid5", 13: "Pyramid13", 6: "Wedge6", 15: "Wedge15",
    8: "Hexahedron8", 20: "Hexahedron20", 27: "Hexahedron27",
}  # fmt: skip
"""Names of solid shapes by their number of nodes."""
POINT_ELEMENT = "NodalConcentratedElement3D1N"
LINES: dict[int, type[Shape]] = {2: Line2, 3: Line3}
IDLE = ("SurfaceCondition", "PointCondition", "LineCondition")
"""Names, up to their 3D, of conditions that are there for others to find: Kratos loads nothing by them."""
FACES = ("Load", "Face3D", "FacePressure", *IDLE)
"""Words in the names of conditions that can carry loads."""
LOADED = (
    "SurfaceLoadCondition", "LineLoadCondition", "PointLoadCondition", "Face", "FacePressure",
    "FaceLoadPressure", "SmallDisplacementSurfaceLoadCondition", "SmallDisplacementLineLoadCondition",
)  # fmt: skip
"""Names, up to their 3D, of those that carry the loads of a file."""
PRESTRESS = ("PRESTRESS", "INSITU_STRESS")
"""Names of the initial stress in files, which Kratos subtracts: σ = C ε - PRESTRESS_FACTOR · PRESTRESS."""
LIKELY, SURE = 0.8, 0.9
"""Likeness, as of difflib, from which on a word may be, or surely is, a slip of another."""
THIN = ("Shell", "Membrane", "Truss", "Beam", "Cable", "Spring", "Plate")
"""Words in the names of elements that are no solids."""


def count(name: str) -> int | None:
    """Return the number of nodes that a name such as ``…3D8N`` ends with."""
    match = re.search(r"3D(\d+)N?$", name)
    return int(match.group(1)) if match and len(match.group(1)) < 4 else None


def kratos_name(name: str) -> str:
    """Return the name by which Kratos 10 knows an element or condition that kratos_lite gives a meaning.

    Kratos has an ``Element3D8N`` too, but it is empty: it has no stiffness.

    >>> kratos_name("TotalLagrangian3D27N"), kratos_name("Face3D4"), kratos_name("Bar3D2N")
    ('SmallDisplacementElement3D27N', 'SmallDisplacementSurfaceLoadCondition3D4N', 'Bar3D2N')
    """
    nodes = count(name)
    family = name[: name.rfind("3D")]
    if family in ("KinematicLinear", "TotalLagrangian", "Element") and nodes in SOLIDS:
        return f"SmallDisplacementElement3D{nodes}N"
    if name == "BBar3D8N":
        return "SmallDisplacementBbarElement3D8N"
    if family in ("Face", "FacePressure") and nodes in FACE_SHAPES:
        return f"SmallDisplacementSurfaceLoadCondition3D{nodes}N"
    return name


def nearest_variable(name: str, known: Iterable[str]) -> str:
    """Return a hint like `errors.nearest`, but only for a likely misspelling.

    >>> nearest_variable("YOUNGS_MODULUS", ["YOUNG_MODULUS"]), nearest_variable("EMISSIVITY", ["VISCOSITY"])
    (' Did you mean YOUNG_MODULUS?', '')
    """
    return nearest(name, get_close_matches(name, list(known), cutoff=LIKELY))


def misspelt(name: str, known: Iterable[str]) -> str | None:
    """Return the word that a name surely means, which differs by a letter or two; digits are never slips.

    >>> misspelt("DISPLACMENT_X", ["DISPLACEMENT_X"]), misspelt("YOUNG_MODULUS_1", ["YOUNG_MODULUS"])
    ('DISPLACEMENT_X', None)
    """
    if any(letter.isdigit() for letter in name):
        return None
    word, words = name.upper(), list(known)
    exchanged = [other for other in words if sorted(other) == sorted(word)]
    close = get_close_matches(word, exchanged, 1, LIKELY) or get_close_matches(word, words, 1, SURE)
    return close[0] if close else None


def element_shape(name: str) -> type[Shape] | None:
    """Return the shape of an element name, or None for one that is no solid.

    >>> element_shape("SmallDisplacementElement3D8N").__name__
    'Hexahedron8'
    """
    nodes = count(name)
    return SHAPES[SOLIDS[nodes]] if nodes in SOLIDS and not any(word in name for word in THIN) else None


def condition_shape(name: str) -> type[Shape] | None:
    """Return the shape of a condition that can carry a load, or None.

    >>> condition_shape("SurfaceLoadCondition3D4N").__name__
    'Quadrilateral4'
    """
    nodes = count(name)
    if nodes is None or "Contact" in name or not any(word in name for word in FACES):
        return None
    if nodes == 1:
        return Point1
    return LINES.get(nodes) if "Line" in name else FACE_SHAPES.get(nodes) if nodes > 2 else None
