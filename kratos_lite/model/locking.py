"""Locking forecast: elements that will come out too stiff, and the better choice by name.

A plain linear element bends by shearing: its energy exceeds that of bending by G/E (a/t)², with a its length
and t the thickness of the whole wall, however many lie through it.  Eight-node bricks whose sides taper are
stiff in bending whatever their strains are, if patches of them reproduce constant stress.

Sources: Hughes, The Finite Element Method (1987), ch. 4; MacNeal, IJNME 24 (1987) 1793.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, Kinds
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.formulations import NEAR_HALF, bulk_over_shear, formulations_of, is_of_library
from kratos_lite.elements.overridden_steps import MECHANICS
from kratos_lite.mesh import Faces, Mesh
from kratos_lite.model.opposite_faces import OppositeFaces, opposite_of
from kratos_lite.model.supports import Supports
from kratos_lite.model.walls import STIFF, Walls, shear_over_young, walls_of
from kratos_lite.typing import Array

TAPER = 2.0
"""Slope of the sides against each other, times length over thickness, that makes cells too stiff."""
QUADRATIC = {"tetrahedron": "3D10N", "wedge": "3D15N", "pyramid": "3D13N", "hexahedron": "3D20N"}


def check_locking(
    mesh: Mesh,
    groups: Sequence[ElementGroup],
    supports: Supports,
    faces: Faces,
    kinds: Kinds | None = None,
) -> list[str]:
    """Return a warning for each kind of elements that will lock, with the better choice.

    Over ranks, `kinds` are those of all.
    """
    kinds = groups if kinds is None else kinds
    warnings = [*_near_half(kinds), *_with_apex(kinds)]
    bending = [kind for kind in kinds if _has_two_sides(kind.element)]
    if bending:
        mine = [group for group in groups if _has_two_sides(group.element)]
        walls = walls_of(OppositeFaces(mesh, faces), mine, bending, supports.fixed)
        for element in dict.fromkeys(kind.element for kind in bending):
            warnings += _in_bending(mesh, element, [g for g in mine if g.element is element], walls)
    return warnings


# ---- by element and material ---------------------------------------------------------------------------


def _near_half(groups: Kinds) -> list[str]:
    """Warn of plain elements with ν near ½; ten-node tetrahedra have sound displacements."""
    found: dict[str, str] = {}
    for kind, C in ((group.element, group.material.C) for group in groups):
        plain = kind.inherits(*MECHANICS) and kind.formulation == "standard"
        if plain and kind.__name__ != "KinematicLinear3D10N" and bulk_over_shear(C) > NEAR_HALF:
            found[kind.__name__] = better_element(kind, "BBar")
    if not found:
        return []
    names, better = ", ".join(sorted(found)), ", ".join(sorted(set(found.values())))
    return [f"Poisson's ratio lies so near 0.5 that {names} may lock (come out far too stiff); take {better}"]


def _with_apex(groups: Kinds) -> list[str]:
    """Warn of linear tetrahedra, and of linear pyramids unless they are few, between other elements."""
    counts: dict[type[KinematicLinear], int] = {}
    for group in groups:
        if is_of_library(group.element) and len(group.element.nodes) in (4, 5):
            counts[group.element] = counts.get(group.element, 0) + len(group)
    half = sum(map(len, groups)) / 2
    return [
        f"{kind.__name__} locks in bending (comes out far too stiff); take KinematicLinear"
        f"{QUADRATIC[kind.shape.cell]}"
        for kind, count in counts.items()
        if kind.shape.cell == "tetrahedron" or count > half
    ]


def better_element(kind: type[KinematicLinear], family: str = "KinematicLinear") -> str:
    """Return the name of the element to take in place of one that locks."""
    known = formulations_of(kind.shape)
    if "enhanced" in known:
        return known["enhanced"].__name__
    family = "KinematicLinear" if kind.shape.cell == "tetrahedron" else family
    linear = len(kind.nodes) == kind.shape.corners
    return f"{family}{QUADRATIC[kind.shape.cell]}" if linear else known["b_bar"].__name__


# ---- in bending ----------------------------------------------------------------------------------------


def _has_two_sides(kind: type[KinematicLinear]) -> bool:
    """Return whether an element is a linear brick or wedge of the library."""
    return is_of_library(kind) and len(kind.nodes) == kind.shape.corners and max(opposite_of(kind.shape)) > 0


def _in_bending(
    mesh: Mesh, kind: type[KinematicLinear], groups: Sequence[ElementGroup], walls: Walls
) -> list[str]:
    """Return the warning about elements of one kind in walls that may bend."""
    modulus = np.full(mesh.n_elements, np.nan)
    for group in groups:
        modulus[group.rows] = shear_over_young(group.material.C)
    walls = walls.take(~np.isnan(modulus[walls.element]))
    ratio, name = walls.length / walls.thickness, kind.__name__
    if kind.formulation == "enhanced":
        most, place = _worst(mesh, walls, walls.taper * ratio)
        if not most > TAPER:
            return []
        cure = "take KinematicLinear3D20N or KinematicLinear3D27N, or cells with parallel sides"
        return [
            f"{name} with sides that taper, {place}, is too stiff in bending as all of 8 nodes are; {cure}"
        ]
    if kind.formulation == "b_bar":
        most, place = _worst(mesh, walls, np.where(walls.layers == 1, ratio, 0.0))
        if most > 0:
            wrong = "far too easily in short cells, too stiffly in long ones"
            better = better_element(kind)
            return [f"{name} alone through a thickness, {place}, may bend {wrong}; take {better}"]
    most, place = _worst(mesh, walls, modulus[walls.element] * ratio**2)
    if most > STIFF:
        more = f"{1 + most:.2g} times too stiff in bending"
        return [f"{name} may come out {more}, {place}; take {better_element(kind)}"]
    return []


def _worst(mesh: Mesh, walls: Walls, size: Array) -> tuple[float, str]:
    """Return the largest of the sizes of walls, 0 without any, and the place of the first that has it."""
    mine = None
    if len(size):
        worst = int(np.argmax(size))
        element = walls.element[worst]
        text = (
            f"such as element {mesh.element_ids[element]} ({walls.length[worst]:.3g} m long, "
            f"{walls.layers[worst]} of them through the thickness of {walls.thickness[worst]:.3g} m)"
        )
        mine = -float(size[worst]), int(walls.side[worst]), int(mesh.element_ids[element]), text
    found = [one for one in mesh.ranks.gather(mine) if one is not None]
    most, _, _, place = min(found, default=(0.0, 0, 0, ""))
    return -most, place
