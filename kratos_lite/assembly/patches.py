"""Patches of elements around the corner nodes of a mesh, for the recovery of smooth fields.

The patch of a node inside the body are the elements around it.  A node on the surface takes those of its
nearest nodes inside, in which its own elements weigh more; where there are none, as in a mesh one element
thick, those of its neighbors with the most elements, unless it has half as many itself.  Among linear
hexahedra, whose stresses are good at one point alone, it takes the elements around these as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kratos_lite.assembly.polynomial_fit import Lists, distinct, integers, lists
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.blocks import NO_ROWS
from kratos_lite.mesh.topology import corners as corners_of
from kratos_lite.mesh.topology import faces_of
from kratos_lite.native import kernels
from kratos_lite.registry import remembered
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints, Mask

ENOUGH = 27
"""Elements of a patch that tell a polynomial of one degree more: three along each axis."""
DECAY = 4
"""Power of the distance, in radii of an element, with which its weight in such a patch falls."""


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of some elements, numbered 0 … m - 1."""

    elements: Lists  # those of each patch
    weights: Array  # of each of these, 1 for those that contain the node
    wide: Mask  # (p,) whether a patch has a second layer, and can tell a polynomial of one degree more
    of: Lists  # the patches whose mean counts at each node; none at nodes without elements


def patches(blocks: Sequence[Block], points: Array, outer: Mask, hanging: Ints, leaders: Lists) -> Patches:
    """Return the patches of blocks of elements."""
    corners = _corners(blocks)
    is_corner = np.zeros(len(outer), dtype=bool)
    is_corner[corners[corners >= 0]] = True
    is_corner[hanging] = False
    is_tied = np.bincount(leaders.owner, weights=is_corner[leaders.entries], minlength=len(leaders)) > 0
    is_corner[hanging[~is_tied]] = True
    hanging, leaders = hanging[is_tied], leaders.take(np.flatnonzero(is_tied))
    around, outer = _around(blocks, corners, is_corner), outer & is_corner
    inside = ~outer[around.owner]
    far = np.repeat([_far(block) for block in blocks], [len(block) for block in blocks])
    is_wide, owner, element, weights = _outside(points, around, corners, far, outer, is_corner)
    nodes = np.concatenate([around.owner[inside], owner])
    weights = np.concatenate([np.ones(int(inside.sum())), weights])
    number, n = np.cumsum(is_corner) - 1, int(is_corner.sum())
    order = lists(number[nodes], np.arange(len(nodes)), n)
    elements = Lists(order.start, np.concatenate([around.entries[inside], element])[order.entries])
    of = _patches_of_nodes(blocks, is_corner, number, hanging, leaders)
    return Patches(elements, weights[order.entries], is_wide[is_corner], of)


def _far(block: Block) -> float:
    """Return the weight of elements that do not contain the node; 0 where it falls with the distance."""
    if block.shape is None or (block.shape.degree == 1 and block.shape.cell != "hexahedron"):
        return 1.0
    if block.shape.degree == 1:
        return 0.0
    return 0.05 if block.shape.cell in ("hexahedron", "tetrahedron") else 0.5


def _outside(
    points: Array, around: Lists, corners: Ints, far: Array, outer: Mask, is_corner: Mask
) -> tuple[Mask, Ints, Ints, Array]:
    """Return which patches are wide, and node, element and weight of all pairs of those on the surface."""
    owner, element = _neighborhoods(around, corners, outer, is_corner)
    grows = outer.copy()
    grows[owner[far[element] > 0]] = False
    more = _second_layer(owner[grows[owner]], element[grows[owner]], around, corners, len(outer))
    is_wide = np.bincount(more[0], minlength=len(outer)) >= ENOUGH
    kept, added = ~is_wide[owner], is_wide[more[0]]
    owner = np.concatenate([owner[kept], more[0][added]])
    element = np.concatenate([element[kept], more[1][added]])
    weights = np.where(_contain(owner, element, corners), 1.0, far[element])
    near = np.flatnonzero(weights == 0)
    weights[near] = _decayed(points, owner[near], element[near], corners)
    return is_wide, owner, element, weights


def _second_layer(owner: Ints, element: Ints, around: Lists, corners: Ints, n: int) -> tuple[Ints, Ints]:
    """Return the pairs of node and element with the elements around those."""
    if module := kernels("recovery"):
        rows, near = module.grown(*map(integers, (owner, element, corners, around.start, around.entries)), n)
        return rows, near
    known = corners[element]
    pair, at = np.nonzero(known >= 0)
    owner, near, _ = distinct(owner[pair], known[pair, at], n)
    more = around.take(near)
    return distinct(owner[more.owner], more.entries, n)[:2]


def _decayed(points: Array, owner: Ints, element: Ints, corners: Ints) -> Array:
    """Return weights of linear hexahedra (k,) by their distance from a node each."""
    used = np.zeros(len(corners), dtype=bool)
    used[element] = True
    X = points[corners[used, :8]]
    center = X.mean(axis=1)
    radius = ((X - center[:, None]) ** 2).sum(axis=(1, 2)) / 8  # squared, as are the distances
    at, distance = (np.cumsum(used) - 1)[element], np.zeros(len(owner))
    for x, place in zip(center.T.copy(), points.T.copy(), strict=True):
        distance += (x[at] - place[owner]) ** 2
    ratio = np.minimum(1.0, radius[at] / distance)
    return np.asarray(ratio ** (DECAY // 2))


def outer_corners(cells: Mesh, material: Ints) -> tuple[Ints, Ints]:
    """Return material and corner node of the faces that no element of the same material (m,) shares."""
    faces = cells.all_faces
    alone, behind = np.ones(len(faces.element), dtype=bool), material[faces.element]
    same = behind[faces.one] == behind[faces.other]
    alone[faces.one[same]] = alone[faces.other[same]] = False
    materials, nodes, start = [NO_ROWS], [NO_ROWS], 0
    for block in cells.blocks:
        for face in faces_of(block):
            chosen = np.flatnonzero(alone[start : start + len(block)])
            picked = block.nodes[chosen][:, list(corners_of(face))]
            materials.append(np.repeat(behind[start + chosen], picked.shape[1]))
            nodes.append(picked.ravel().astype(np.int64))
            start += len(block)
    return np.concatenate(materials), np.concatenate(nodes)


def _corners(blocks: Sequence[Block]) -> Ints:
    """Return the corner nodes of all elements (m, c), filled up with -1."""
    counts = [block.shape.corners if block.shape else block.nodes.shape[1] for block in blocks]
    corners = np.full((sum(map(len, blocks)), max(counts, default=0)), -1)
    first = 0
    for block, c in zip(blocks, counts, strict=True):
        corners[first : first + len(block), :c] = block.nodes[:, :c]
        first += len(block)
    return corners


def _around(blocks: Sequence[Block], corners: Ints, is_corner: Mask) -> Lists:
    """Return the elements around each corner node, also those that have it in the middle of an edge."""
    at = np.flatnonzero((corners >= 0) & is_corner[corners])
    nodes, elements, first = [corners.ravel()[at]], [at // corners.shape[1]], 0
    for block in blocks:
        c = block.shape.corners if block.shape else block.nodes.shape[1]
        others = block.nodes[:, c:]
        row, column = np.nonzero(is_corner[others]) if others.size else (NO_ROWS, NO_ROWS)
        nodes.append(others[row, column].astype(np.int64))
        elements.append(first + row)
        first += len(block)
    return lists(np.concatenate(nodes), np.concatenate(elements), len(is_corner))


def _neighborhoods(around: Lists, corners: Ints, outer: Mask, is_corner: Mask) -> tuple[Ints, Ints]:
    """Return node and element of all pairs of the patches of nodes on the surface."""
    surface = np.flatnonzero(outer)
    if not len(surface):
        return surface, surface
    own = around.take(surface)
    node, element = surface[own.owner], own.entries
    near = corners[element]
    usable = (near >= 0) & is_corner[near]
    inner = usable & ~outer[near]
    # nodes inside count by the elements that they share, others by the elements around them
    at, c = np.flatnonzero(inner), corners.shape[1]
    host, center, count = distinct(node[at // c], near.ravel()[at], len(outer))
    best = np.zeros(len(outer), dtype=count.dtype)
    np.maximum.at(best, host, count)
    chosen = count == best[host]
    host, center = host[chosen], center[chosen]
    without = np.ones(len(outer), dtype=bool)
    without[host] = False
    at = np.flatnonzero(usable & without[node][:, None])
    alone, other, _ = distinct(node[at // c], near.ravel()[at], len(outer))
    size = around.lengths
    best = np.zeros(len(outer), dtype=np.int64)
    np.maximum.at(best, alone, size[other])
    enough = 2 * size[alone] > best[alone]
    chosen = np.where(enough, other == alone, size[other] == best[alone])
    host, center = np.concatenate([host, alone[chosen]]), np.concatenate([center, other[chosen]])
    patch = around.take(center)
    pairs = np.concatenate([host[patch.owner], node]), np.concatenate([patch.entries, element])
    return distinct(*pairs, len(outer))[:2]


def _contain(owner: Ints, element: Ints, corners: Ints) -> Mask:
    """Return a mask of the elements that have the node as a corner."""
    contain = np.zeros(len(owner), dtype=bool)
    for column in corners.T.copy():
        contain |= column[element] == owner
    return contain


def _patches_of_nodes(
    blocks: Sequence[Block], is_corner: Mask, number: Ints, hanging: Ints, leaders: Lists
) -> Lists:
    """Return the patches of each node: its own; else of those it depends on, or of its edge, face or cell."""
    owner, entries = [np.flatnonzero(is_corner)], [number[is_corner]]
    done = is_corner.copy()
    known = is_corner[leaders.entries]
    owner.append(hanging[leaders.owner[known]])
    entries.append(number[leaders.entries[known]])
    done[hanging] = True
    for block in blocks:
        for a, support in enumerate(_supports(block.shape, block.nodes.shape[1])):
            open_ = np.flatnonzero(~done[block.nodes[:, a]])
            if not len(open_):
                continue
            new, first = np.unique(block.nodes[open_, a], return_index=True)
            done[new] = True
            at = block.nodes[open_[first]][:, support]
            known = is_corner[at]
            owner.append(np.repeat(new, known.sum(axis=1)))
            entries.append(number[at[known]])
    return lists(np.concatenate(owner), np.concatenate(entries), len(is_corner))


@remembered
def _supports(shape: type[Shape] | None, n: int) -> list[list[int]]:
    """Return the corners of the edge, face or cell in which each of the n nodes of a cell lies."""
    if shape is None:
        return [[a] for a in range(n)]
    linear = shape.linear()
    if linear is None:
        return [[a] if a < shape.corners else list(range(shape.corners)) for a in range(n)]
    return [np.flatnonzero(np.abs(linear.N(xi)) > 1e-9).tolist() for xi in shape.nodes]
