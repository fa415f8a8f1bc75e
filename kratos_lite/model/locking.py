"""Locking forecast: elements that will come out too stiff, and the better choice by name.

A plain linear element bends by shearing: its energy exceeds that of bending by G/E (a/t)², with a its length
and t the thickness of the whole wall, however many lie through it.  Eight-node bricks whose sides taper are
stiff in bending whatever their strains are, if patches of them reproduce constant stress.

Sources: Hughes, The Finite Element Method (1987), ch. 4; MacNeal, IJNME 24 (1987) 1793.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.elements import KinematicLinear
from kratos_lite.elements.formulations import NEAR_HALF, bulk_over_shear, formulations_of, is_of_library
from kratos_lite.elements.overridden_steps import MECHANICS
from kratos_lite.mesh import NO_ROWS, Faces, Mesh, components, with_rows
from kratos_lite.model.opposite_faces import OppositeFaces, opposite_of
from kratos_lite.model.supports import Supports
from kratos_lite.records import names_of, record
from kratos_lite.typing import Array, Ints, Mask

STIFF = 0.1
"""Excess of the stiffness in bending from which it is forecast."""
SLENDER = 4.0
"""Extent of a mesh, in thicknesses of a wall, from which the wall may bend."""
TAPER = 2.0
"""Slope of the sides against each other, times length over thickness, that makes cells too stiff."""
LAYERS = 64
"""Elements through a wall that are counted."""
NOTHING = np.zeros(0)
QUADRATIC = {"tetrahedron": "3D10N", "wedge": "3D15N", "pyramid": "3D13N", "hexahedron": "3D20N"}


def check_locking(mesh: Mesh, groups: Sequence[ElementGroup], supports: Supports, faces: Faces) -> list[str]:
    """Return a warning for each kind of elements that will lock, with the better choice."""
    warnings = [*_near_half(groups), *_with_apex(groups)]
    bending = [group for group in groups if _has_two_sides(group.element)]
    if bending:
        walls = _walls(OppositeFaces(mesh, faces), bending, supports.fixed)
        for kind in dict.fromkeys(group.element for group in bending):
            warnings += _in_bending(mesh, kind, [g for g in bending if g.element is kind], walls)
    return warnings


# ---- by element and material ---------------------------------------------------------------------------


def _near_half(groups: Sequence[ElementGroup]) -> list[str]:
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


def _with_apex(groups: Sequence[ElementGroup]) -> list[str]:
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


@record
class Walls:
    """Outer faces of elements, and the wall behind each: up to the outer face opposite.

    Attributes
    ----------
    element : (k,) row of the element of the face.
    thickness : (k,) m.
    layers : (k,) number of elements through the wall.
    length : (k,) m, of the element within the wall.
    taper : (k,) slope of its sides against each other.
    """

    element: Ints
    thickness: Array
    layers: Ints
    length: Array
    taper: Array

    def take(self, chosen: Mask | Ints) -> Walls:
        """Return some of the walls."""
        return Walls(*(getattr(self, name)[chosen] for name in names_of(type(self))))


def _has_two_sides(kind: type[KinematicLinear]) -> bool:
    """Return whether an element is a linear brick or wedge of the library."""
    return is_of_library(kind) and len(kind.nodes) == kind.shape.corners and max(opposite_of(kind.shape)) > 0


def _in_bending(
    mesh: Mesh, kind: type[KinematicLinear], groups: Sequence[ElementGroup], walls: Walls
) -> list[str]:
    """Return the warning about elements of one kind in walls that may bend."""
    modulus = np.full(mesh.n_elements, np.nan)
    for group in groups:
        modulus[group.rows] = _shear_over_young(group.material.C)
    walls = walls.take(~np.isnan(modulus[walls.element]))
    ratio, name = walls.length / walls.thickness, kind.__name__
    if kind.formulation == "enhanced":
        tapered = walls.taper * ratio
        if not (tapered > TAPER).any():
            return []
        place = _place(mesh, walls, tapered)
        cure = "take KinematicLinear3D20N or KinematicLinear3D27N, or cells with parallel sides"
        return [
            f"{name} with sides that taper, {place}, is too stiff in bending as all of 8 nodes are; {cure}"
        ]
    single = walls.layers == 1
    if kind.formulation == "b_bar" and single.any():
        place, better = _place(mesh, walls, np.where(single, ratio, 0.0)), better_element(kind)
        wrong = "far too easily in short cells, too stiffly in long ones"
        return [f"{name} alone through a thickness, {place}, may bend {wrong}; take {better}"]
    excess = modulus[walls.element] * ratio**2
    if (excess > STIFF).any():
        place, most = _place(mesh, walls, excess), 1 + float(excess.max())
        return [
            f"{name} may come out {most:.2g} times too stiff in bending, {place}; take {better_element(kind)}"
        ]
    return []


def _place(mesh: Mesh, walls: Walls, size: Array) -> str:
    """Return the place of the worst of some walls."""
    worst = int(np.argmax(size))
    return (
        f"such as element {mesh.element_ids[walls.element[worst]]} ({walls.length[worst]:.3g} m long, "
        f"{walls.layers[worst]} of them through the thickness of {walls.thickness[worst]:.3g} m)"
    )


def _shear_over_young(C: Array) -> float:
    """Return the mean shear modulus over the mean of Young's moduli of a C (6, 6)."""
    try:
        return float(C.diagonal()[3:].mean() * np.linalg.inv(C).diagonal()[:3].mean())
    except np.linalg.LinAlgError:
        return 0.0


def _walls(across: OppositeFaces, groups: Sequence[ElementGroup], fixed: Mask) -> Walls:
    """Return the walls that may bend, behind the outer faces of elements.

    Walls whose sides are held along their normal cannot; nor can those that are thick beside the mesh.
    """
    mesh = across.mesh
    looked_at = np.zeros(mesh.n_elements, dtype=bool)
    for group in groups:
        looked_at[group.rows] = True
    element = across.faces.element
    start = np.flatnonzero((across.mate < 0) & (across.opposite >= 0) & looked_at[element])
    most = _sizes(across)[element[start]] / SLENDER
    thin = _steps(across, start) <= most
    start, most = start[thin], most[thin]
    if not len(start):
        return Walls(NO_ROWS, NOTHING, NO_ROWS, NOTHING, NOTHING)
    free = ~_held(mesh, across.corners(start), fixed)
    start, most = start[free], most[free]
    length, taper = _extents(across, start)
    most_shear = max(_shear_over_young(group.material.C) for group in groups)
    limit = np.minimum(most, length.max(axis=1, initial=0.0) * np.sqrt(max(most_shear / STIFF, 1.0)))
    thickness, layers, end = _thickness(across, start, limit)
    kept = end >= 0
    kept[kept] = ~_held(mesh, across.corners(end[kept]), fixed)
    alone = _alone(across, start) & (length < SLENDER * thickness[:, None])
    length = np.where(alone, 0.0, length)
    rows, longest = np.arange(len(start)), length.argmax(axis=1)
    walls = Walls(element[start], thickness, layers, length[rows, longest], taper[rows, longest])
    return walls.take(kept & (walls.length > 0))


def _sizes(across: OppositeFaces) -> Array:
    """Return the extent in m of the body, joined by faces, that each element belongs to."""
    faces, points = across.faces, across.mesh.points
    joined = np.stack([faces.element[faces.one], faces.element[faces.other]], axis=1)
    body = components(across.mesh.n_elements, joined)
    if not body.any():
        return np.full(len(body), np.ptp(points, axis=0).max())
    low, high = np.full((len(body), 3), np.inf), np.full((len(body), 3), -np.inf)
    for block, rows in with_rows(across.mesh.blocks):
        X = points[block.nodes]
        np.minimum.at(low, body[rows], X.min(axis=1))
        np.maximum.at(high, body[rows], X.max(axis=1))
    size: Array = (high - low).max(axis=1)[body]
    return size


def _steps(across: OppositeFaces, face: Ints) -> Array:
    """Return the distances (k,) in m from faces to those opposite in the same element."""
    return np.linalg.norm(across.centers(across.opposite[face]) - across.centers(face), axis=1)


def _thickness(across: OppositeFaces, start: Ints, limit: Array) -> tuple[Array, Ints, Ints]:
    """Return thickness, layers and the outer face opposite of outer faces; -1 for those beyond a limit."""
    thickness, layers, end = np.zeros(len(start)), np.zeros(len(start), dtype=int), np.full(len(start), -1)
    open_, face = np.arange(len(start)), start
    for _ in range(LAYERS):
        beyond = across.opposite[face]
        thickness[open_] += _steps(across, face)
        layers[open_] += 1
        thin = thickness[open_] <= limit[open_]
        following = across.mate[beyond]
        done = thin & (following < 0)
        end[open_[done]] = beyond[done]
        go_on = thin & (following >= 0)
        go_on[go_on] = across.opposite[following[go_on]] >= 0
        open_, face = open_[go_on], following[go_on]
        if not len(open_):
            break
    return thickness, layers, end


def _held(mesh: Mesh, corners: Ints, fixed: Mask) -> Mask:
    """Return whether all corners (k, 4) of faces are fixed along their normal, or in all components."""
    X, every = mesh.points[corners], fixed[corners].all(axis=1)
    normal = np.abs(np.cross(X[:, 2] - X[:, 0], X[:, 3] - X[:, 1]))
    main = normal > 0.99 * np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(np.all(every, axis=1) | np.any(every & main, axis=1))


def _alone(across: OppositeFaces, start: Ints) -> Mask:
    """Return whether elements of faces have no neighbor along each of the two axes in the wall, (k, 2)."""
    found = np.zeros((len(start), 2), dtype=bool)
    for at, number, face, cells in _of_faces(across, start):
        for k, pair in enumerate(_sides(across, number, face)):
            ends = across.mate[across.number(number, np.array(pair)[:, None], cells)]
            found[at, k] = np.all(ends < 0, axis=0)
    return found


def _extents(across: OppositeFaces, start: Ints) -> tuple[Array, Array]:
    """Return the lengths (k, 2) of the elements of faces along two axes in the wall, and their tapers."""
    length, taper = np.zeros((len(start), 2)), np.zeros((len(start), 2))
    points = across.mesh.points
    for at, number, face, cells in _of_faces(across, start):
        block = across.mesh.blocks[number]
        assert block.shape is not None
        faces, X = block.shape.faces, points[block.nodes[cells]]
        if block.shape.cell == "wedge":
            edges = X[:, list(faces[face])] - np.roll(X[:, list(faces[face])], 1, axis=1)
            length[at, 0] = np.linalg.norm(edges, axis=2).max(axis=1)
            continue
        through = X[:, list(faces[opposite_of(block.shape)[face]])].mean(axis=1) - X[
            :, list(faces[face])
        ].mean(axis=1)
        xi = block.shape.nodes
        normal = xi[list(faces[face])].mean(axis=0)
        for k, pair in enumerate(_sides(across, number, face)):
            axis = xi[list(faces[pair[1]])].mean(axis=0)
            along = np.einsum("kni,n->ki", X, xi @ axis) / 4
            twist = np.einsum("kni,n->ki", X, (xi @ axis) * (xi @ normal)) / 4
            length[at, k] = np.linalg.norm(along, axis=1)
            slope = np.abs((twist * along).sum(axis=1)) / np.maximum(length[at, k], 1e-300)
            taper[at, k] = slope / np.maximum(np.linalg.norm(through, axis=1), 1e-300)
    return length, taper


def _sides(across: OppositeFaces, number: int, face: int) -> list[tuple[int, int]]:
    """Return the two pairs of opposite faces of a brick that stand beside a face; none for a wedge."""
    shape = across.mesh.blocks[number].shape
    assert shape is not None
    pairs = [(i, j) for i, j in enumerate(opposite_of(shape)) if i < j]
    return [pair for pair in pairs if face not in pair] if shape.cell == "hexahedron" else []


def _of_faces(across: OppositeFaces, chosen: Ints) -> list[tuple[Ints, int, int, Ints]]:
    """Return places in `chosen`, number of the block, face of the cell and cells."""
    found, start = [], 0
    for number, (block, _) in enumerate(with_rows(across.mesh.blocks)):
        for face in range(len(block.shape.faces) if block.shape else 0):
            at = np.flatnonzero((chosen >= start) & (chosen < start + len(block)))
            if len(at):
                found.append((at, number, face, chosen[at] - start))
            start += len(block)
    return found
