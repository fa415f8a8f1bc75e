"""Patches of elements around the corner nodes of a mesh, for the recovery of smooth fields.

The patch of a node inside the body are the elements around it.  A node on the surface takes those of its
nearest nodes inside, in which its own elements weigh more; where there are none, as in a mesh one element
thick, those of its neighbors with the most elements, unless it has half as many itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly.polynomial_fit import Lists, distinct, lists
from kratos_lite.mesh import Block
from kratos_lite.mesh.blocks import NO_ROWS
from kratos_lite.mesh.cells import Cells
from kratos_lite.mesh.topology import corners as corners_of
from kratos_lite.mesh.topology import faces_of
from kratos_lite.records import record
from kratos_lite.registry import remembered
from kratos_lite.shapes import Shape
from kratos_lite.typing import Ints, Mask


@record(frozen=True, eq=False)
class Patches:
    """Patches of some elements, numbered 0 … m - 1.

    Attributes
    ----------
    elements : those of each patch.
    own : whether each of these contains the node.
    of : the patches whose mean counts at each node; none at nodes without elements.
    """

    elements: Lists
    own: Mask
    of: Lists


def patches(blocks: Sequence[Block], outer: Mask, hanging: Ints, masters: Lists) -> Patches:
    """Return the patches of blocks of elements.

    Parameters
    ----------
    blocks : the elements, numbered through the blocks.
    outer : (n,) whether a node is a corner of a face on the surface.
    hanging : nodes that others interpolate.
    masters : those of each.
    """
    corners = _corners(blocks)
    is_corner = np.zeros(len(outer), dtype=bool)
    is_corner[corners[corners >= 0]] = True
    is_corner[hanging] = False
    held = np.bincount(masters.owner, weights=is_corner[masters.entries], minlength=len(masters)) > 0
    is_corner[hanging[~held]] = True
    hanging, masters = hanging[held], masters.take(np.flatnonzero(held))
    around, outer = _around(blocks, corners, is_corner), outer & is_corner
    inside = ~outer[around.owner]
    wide_owner, wide = _neighborhoods(around, corners, outer, is_corner)
    number, rows = np.cumsum(is_corner) - 1, np.concatenate([around.owner[inside], wide_owner])
    own = np.concatenate([inside[inside], _contain(wide_owner, wide, corners)])
    entries = 2 * np.concatenate([around.entries[inside], wide]) + own
    found = lists(number[rows], entries, int(is_corner.sum()))
    elements = Lists(found.start, found.entries // 2)
    return Patches(
        elements, found.entries % 2 > 0, _patches_of_nodes(blocks, is_corner, number, hanging, masters)
    )


def outer_corners(cells: Cells, kind: Ints) -> tuple[Ints, Ints]:
    """Return kind and corner node of the faces that no element of the same kind (m,) shares."""
    faces = cells.all_faces
    alone, kinds = np.ones(len(faces.element), dtype=bool), kind[faces.element]
    same = kinds[faces.one] == kinds[faces.other]
    alone[faces.one[same]] = alone[faces.other[same]] = False
    found, nodes, start = [NO_ROWS], [NO_ROWS], 0
    for block in cells.blocks:
        for face in faces_of(block):
            chosen = np.flatnonzero(alone[start : start + len(block)])
            picked = block.nodes[chosen][:, list(corners_of(face))]
            found.append(np.repeat(kinds[start + chosen], picked.shape[1]))
            nodes.append(picked.ravel().astype(np.int64))
            start += len(block)
    return np.concatenate(found), np.concatenate(nodes)


def _corners(blocks: Sequence[Block]) -> Ints:
    """Return the corner nodes of all elements (m, c), filled up with -1."""
    counts = [block.shape.corners if block.shape else block.nodes.shape[1] for block in blocks]
    found = np.full((sum(map(len, blocks)), max(counts, default=0)), -1)
    first = 0
    for block, c in zip(blocks, counts, strict=True):
        found[first : first + len(block), :c] = block.nodes[:, :c]
        first += len(block)
    return found


def _around(blocks: Sequence[Block], corners: Ints, is_corner: Mask) -> Lists:
    """Return the elements around each corner node, also those that have it in the middle of an edge."""
    at = np.flatnonzero((corners >= 0) & is_corner[corners])
    nodes, elements, first = [corners.ravel()[at]], [at // corners.shape[1]], 0
    for block in blocks:
        c = block.shape.corners if block.shape else block.nodes.shape[1]
        rest = block.nodes[:, c:]
        row, column = np.nonzero(is_corner[rest]) if rest.size else (NO_ROWS, NO_ROWS)
        nodes.append(rest[row, column].astype(np.int64))
        elements.append(first + row)
        first += len(block)
    return lists(np.concatenate(nodes), np.concatenate(elements), len(is_corner))


def _neighborhoods(around: Lists, corners: Ints, outer: Mask, is_corner: Mask) -> tuple[Ints, Ints]:
    """Return node and element of all pairs of the patches of nodes on the surface."""
    rows = np.flatnonzero(outer)
    if not len(rows):
        return rows, rows
    own = around.take(rows)
    node, element = rows[own.owner], own.entries
    near = corners[element]
    usable = (near >= 0) & is_corner[near]
    inner = usable & ~outer[near]
    # nodes inside count by the elements that they share, others by the elements around them
    at, c = np.flatnonzero(inner), corners.shape[1]
    host, center, count = distinct(node[at // c], near.ravel()[at], len(outer))
    chosen = _largest(host, count, len(outer))
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


def _largest(owner: Ints, count: Ints, n: int) -> Mask:
    """Return a mask of the entries that have the largest count of their owner."""
    best = np.zeros(n, dtype=count.dtype)
    np.maximum.at(best, owner, count)
    return count == best[owner]


def _contain(owner: Ints, element: Ints, corners: Ints) -> Mask:
    """Return a mask of the elements that have the node as a corner."""
    found = np.zeros(len(owner), dtype=bool)
    for column in corners.T.copy():
        found |= column[element] == owner
    return found


def _patches_of_nodes(
    blocks: Sequence[Block], is_corner: Mask, number: Ints, hanging: Ints, masters: Lists
) -> Lists:
    """Return the patches of each node: its own; else those of its masters, or of its edge, face or cell."""
    owner, entries = [np.flatnonzero(is_corner)], [number[is_corner]]
    done = is_corner.copy()
    known = is_corner[masters.entries]
    owner.append(hanging[masters.owner[known]])
    entries.append(number[masters.entries[known]])
    done[hanging] = True
    for block in blocks:
        for a, support in enumerate(_supports(block)):
            left = np.flatnonzero(~done[block.nodes[:, a]])
            if not len(left):
                continue
            new, first = np.unique(block.nodes[left, a], return_index=True)
            done[new] = True
            at = block.nodes[left[first]][:, support]
            known = is_corner[at]
            owner.append(np.repeat(new, known.sum(axis=1)))
            entries.append(number[at[known]])
    return lists(np.concatenate(owner), np.concatenate(entries), len(is_corner))


def _supports(block: Block) -> list[list[int]]:
    """Return the corners of the edge, face or cell in which each node of a cell lies."""
    if block.shape is None:
        return [[a] for a in range(block.nodes.shape[1])]
    return _supports_in(block.shape)


@remembered
def _supports_in(shape: type[Shape]) -> list[list[int]]:
    linear = shape.linear()
    if linear is None:
        return [[a] if a < shape.corners else list(range(shape.corners)) for a in range(len(shape.nodes))]
    return [np.flatnonzero(np.abs(linear.N(xi)) > 1e-9).tolist() for xi in shape.nodes]
