"""Walls: what lies behind the outer faces of elements, up to the outer face opposite; those that may bend."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup, Kinds
from kratos_lite.mesh import NO_ROWS, Mesh, with_rows
from kratos_lite.mesh.shared_faces import SharedFaces, places_of
from kratos_lite.model.connected_bodies import bodies_of_elements, extents
from kratos_lite.model.opposite_faces import OppositeFaces, opposite_of
from kratos_lite.records import names_of, record
from kratos_lite.typing import Array, Ints, Mask

STIFF = 0.1
"""Excess of the stiffness in bending from which it is forecast."""
SLENDER = 4.0
"""Extent of a mesh, in thicknesses of a wall, from which the wall may bend."""
LAYERS = 64
"""Elements through a wall that are counted."""


@record
class Walls:
    """Outer faces of elements, and the wall behind each: up to the outer face opposite.

    Attributes
    ----------
    element : (k,) row of the element of the face.
    side : (k,) a number for its block and which face of the cell it is, ascending.
    thickness : (k,) m.
    layers : (k,) number of elements through the wall.
    length : (k,) m, of the element within the wall.
    taper : (k,) slope of its sides against each other.
    """

    element: Ints
    side: Ints
    thickness: Array
    layers: Ints
    length: Array
    taper: Array

    def take(self, chosen: Mask | Ints) -> Walls:
        """Return some of the walls."""
        return Walls(*(getattr(self, name)[chosen] for name in names_of(type(self))))


def shear_over_young(C: Array) -> float:
    """Return the mean shear modulus over the mean of Young's moduli of a C (6, 6)."""
    try:
        return float(C.diagonal()[3:].mean() * np.linalg.inv(C).diagonal()[:3].mean())
    except np.linalg.LinAlgError:
        return 0.0


def walls_of(across: OppositeFaces, groups: Sequence[ElementGroup], kinds: Kinds, fixed: Mask) -> Walls:
    """Return the walls that may bend, behind the outer faces of elements.

    Walls whose sides are held along their normal cannot; nor can those that are thick beside the mesh.
    """
    mesh = across.mesh
    looked_at = np.zeros(mesh.n_elements, dtype=bool)
    for group in groups:
        looked_at[group.rows] = True
    element = across.faces.element
    start = np.flatnonzero((across.mate < 0) & (across.opposite >= 0) & looked_at[element] & across.kept)
    most = _sizes(across)[element[start]] / SLENDER
    thin = _steps(across, start) <= most
    start, most = start[thin], most[thin]
    free = ~_held(mesh, across.corners(start), fixed)
    start, most = start[free], most[free]
    length, taper = _extents(across, start)
    most_shear = max(shear_over_young(kind.material.C) for kind in kinds)
    limit = np.minimum(most, length.max(axis=1, initial=0.0) * np.sqrt(max(most_shear / STIFF, 1.0)))
    thickness, layers, kept = _through(across, start, limit, fixed)
    alone = _alone(across, start) & (length < SLENDER * thickness[:, None])
    length = np.where(alone, 0.0, length)
    rows, longest = np.arange(len(start)), length.argmax(axis=1)
    side = np.zeros(len(start), dtype=np.int64)
    for at, number, face, _ in _of_faces(across, start):
        side[at] = 8 * number + face
    walls = Walls(element[start], side, thickness, layers, length[rows, longest], taper[rows, longest])
    return walls.take(kept & (walls.length > 0))


def _sizes(across: OppositeFaces) -> Array:
    """Return the extent in m of the body, joined by faces, that each element belongs to."""
    mesh = across.mesh
    body, count = bodies_of_elements(mesh, across.faces)
    if count == 1:
        low, high = mesh.extent
        return np.full(len(body), (high - low).max())
    node, group = [NO_ROWS], [NO_ROWS]
    for block, rows in with_rows(mesh.blocks):
        node.append(block.nodes.ravel().astype(np.int64))
        group.append(np.repeat(body[rows], block.nodes.shape[1]))
    low, high = extents(mesh, np.concatenate(node), np.concatenate(group), count)
    size: Array = (high - low).max(axis=1)[body]
    return size


def _steps(across: OppositeFaces, face: Ints) -> Array:
    """Return the distances (k,) in m from faces to those opposite in the same element."""
    return np.linalg.norm(across.centers(across.opposite[face]) - across.centers(face), axis=1)


def _through(across: OppositeFaces, start: Ints, limit: Array, fixed: Mask) -> tuple[Array, Ints, Mask]:
    """Return thickness and layers of the walls behind outer faces, and which of them may bend.

    Those thicker than a limit may not, nor those that end at a held face.
    """
    walk = _Walk(np.arange(len(start)), start, np.zeros(len(start)), np.zeros(len(start), dtype=int), limit)
    if across.shared is None:
        done, _ = _walked(across, walk)
    else:
        done = _walked_over_ranks(across, across.shared, walk, fixed)
    thickness, layers, kept = (
        np.zeros(len(start)),
        np.zeros(len(start), dtype=int),
        np.zeros(len(start), bool),
    )
    thickness[done.origin], layers[done.origin] = done.thickness, done.layers
    kept[done.origin] = True if across.shared else ~_held(across.mesh, across.corners(done.face), fixed)
    return thickness, layers, kept


@record
class _Walk:
    """Ways through walls, from face to face: where each began, where it is, and how far it has come."""

    origin: Ints
    face: Ints
    thickness: Array
    layers: Ints
    limit: Array

    def take(self, chosen: Mask | Ints) -> _Walk:
        return _Walk(*(getattr(self, name)[chosen] for name in names_of(type(self))))


def _walked(across: OppositeFaces, walk: _Walk) -> tuple[_Walk, _Walk]:
    """Follow ways that enter elements by a face: return those that end at an outer face, within its limit.

    And those that come to a face behind which another rank may have an element.
    """
    ended, lost = [walk.take(NO_ROWS)], [walk.take(NO_ROWS)]
    unknown = None if across.shared is None else (across.mate < 0) & ~across.shared.kept
    while len(walk.face):
        beyond = across.opposite[walk.face]
        thickness = walk.thickness + _steps(across, walk.face)
        walk = _Walk(walk.origin, beyond, thickness, walk.layers + 1, walk.limit)
        walk = walk.take(walk.thickness <= walk.limit)
        following = across.mate[walk.face]
        end = following < 0
        if unknown is not None:
            lost.append(walk.take(unknown[walk.face]))
            end &= ~unknown[walk.face]
        ended.append(walk.take(end))
        walk = _entered(across, walk)
    return _joined(ended), _joined(lost)


def _entered(across: OppositeFaces, walk: _Walk) -> _Walk:
    """Return the ways that can go on through the next element, by its face."""
    walk = walk.take((across.mate[walk.face] >= 0) & (walk.layers < LAYERS))
    walk = _Walk(walk.origin, across.mate[walk.face], walk.thickness, walk.layers, walk.limit)
    return walk.take(across.opposite[walk.face] >= 0)


def _joined(walks: list[_Walk]) -> _Walk:
    return _Walk(*(np.concatenate([getattr(one, name) for one in walks]) for name in names_of(_Walk)))


def _walked_over_ranks(across: OppositeFaces, shared: SharedFaces, walk: _Walk, fixed: Mask) -> _Walk:
    """Return the ways from here that end at an outer face that is not held, on whatever rank.

    A way that comes to a face which another rank keeps goes on there, with the rank where it began.
    """
    ranks, home = shared.ranks, np.full(len(walk.face), shared.ranks.rank)
    found = [walk.take(NO_ROWS)]
    walk.origin = walk.origin * ranks.size + home
    while ranks.any(len(walk.face) > 0):
        ended, lost = _walked(across, walk)
        ended = ended.take(~_held(across.mesh, across.corners(ended.face), fixed))
        home = ended.origin % ranks.size
        found.append(_sent(shared, home, ended))
        keys, to = shared.keys[lost.face], shared.keepers[lost.face]
        here = np.concatenate(ranks.send(to, keys))
        walk = _sent(shared, to, lost)
        walk.face = places_of(here, shared.keys)
        at_end = walk.take(across.mate[walk.face] < 0)
        at_end = at_end.take(~_held(across.mesh, across.corners(at_end.face), fixed))
        found.append(_sent(shared, at_end.origin % ranks.size, at_end))
        walk = _entered(across, walk)
    mine = _joined(found)
    mine.origin = mine.origin // ranks.size
    return mine


def _sent(shared: SharedFaces, to: Ints, walk: _Walk) -> _Walk:
    """Send ways to ranks, and return those that come."""
    return _Walk(*(np.concatenate(shared.ranks.send(to, getattr(walk, n))) for n in names_of(_Walk)))


def _held(mesh: Mesh, corners: Ints, fixed: Mask) -> Mask:
    """Return whether all corners (k, 4) of faces are fixed along their normal, or in all components."""
    X, every = mesh.points[corners], fixed[corners].all(axis=1)
    normal = np.abs(np.cross(X[:, 2] - X[:, 0], X[:, 3] - X[:, 1]))
    main = normal > 0.99 * np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(np.all(every, axis=1) | np.any(every & main, axis=1))


def _alone(across: OppositeFaces, start: Ints) -> Mask:
    """Return whether elements of faces have no neighbor along each of the two axes in the wall, (k, 2)."""
    found, outer = np.zeros((len(start), 2), dtype=bool), across.outer
    for at, number, face, cells in _of_faces(across, start):
        for k, pair in enumerate(_sides(across, number, face)):
            ends = outer[across.number(number, np.array(pair)[:, None], cells)]
            found[at, k] = np.all(ends, axis=0)
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
