"""Patches of elements around the corner nodes of a mesh, for the recovery of smooth fields.

The patch of a node inside the body are the elements around it.  A node on the surface takes those of its
nearest nodes inside, in which its own elements weigh more; where there are none, as in a mesh one element
thick, those of its neighbors with the most elements, unless it has half as many itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kratos_lite.assembly.polynomial_fit import Lists, lists
from kratos_lite.mesh import Block
from kratos_lite.mesh.topology import Faces
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints, Mask, Rows

FAR = 0.5
"""Weight of the elements of a patch that do not contain its node."""
CANCELED = 0.1
"""Share of the area vectors of faces around a node that may be left at a node inside."""


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of some elements, numbered 0 … m - 1.

    Attributes
    ----------
    elements : those of each patch.
    weights : of each of these.
    of : the patches whose mean counts at each node; none at nodes without elements.
    """

    elements: Lists
    weights: Array
    of: Lists


@dataclass(frozen=True, eq=False)
class Hanging:
    """Nodes whose displacements other nodes interpolate.

    Attributes
    ----------
    nodes : their rows.
    masters : the nodes that interpolate each.
    weights : their shares.
    """

    nodes: Ints
    masters: Lists
    weights: Array


def patches(points: Array, blocks: Sequence[Block], hanging: Hanging | None = None) -> Patches:
    """Return the patches of blocks of elements, numbered through the blocks."""
    n, corners = len(points), _corners(blocks)
    is_corner = np.zeros(n, dtype=bool)
    is_corner[corners[corners >= 0]] = True
    if hanging is not None:
        is_corner[hanging.nodes] = False
    around = _around(blocks, corners, is_corner)
    outer = _outer(points, blocks, hanging) & is_corner
    number = np.cumsum(is_corner) - 1
    nodes = np.flatnonzero(is_corner)
    owner, element = around.owner, around.entries
    inside = ~outer[owner]
    far_owner, far = _neighborhoods(around, corners, outer, is_corner)
    near = np.ones(int(inside.sum()))
    far_weights = _weights(far_owner, far, corners)
    rows = np.concatenate([owner[inside], far_owner])
    order = np.argsort(rows, kind="stable")
    found = lists(number[rows], np.concatenate([element[inside], far]), len(nodes))
    weights = np.concatenate([near, far_weights])[order]
    return Patches(found, weights, _patches_of_nodes(n, blocks, is_corner, number, hanging))


def _cells(blocks: Sequence[Block]) -> list[tuple[Rows, type[Shape] | None]]:
    return [(block.nodes, block.shape) for block in blocks]


def _corners(blocks: Sequence[Block]) -> Rows:
    """Return the corner nodes of all elements (m, c), filled up with -1."""
    counts = [block.shape.corners if block.shape else block.nodes.shape[1] for block in blocks]
    found = np.full((sum(map(len, blocks)), max(counts, default=0)), -1)
    first = 0
    for block, c in zip(blocks, counts, strict=True):
        found[first : first + len(block), :c] = block.nodes[:, :c]
        first += len(block)
    return found


def _around(blocks: Sequence[Block], corners: Rows, is_corner: Mask) -> Lists:
    """Return the elements around each corner node, also those that have it in the middle of an edge."""
    element, column = np.nonzero(corners >= 0)
    nodes, elements, first = [corners[element, column]], [element], 0
    for block in blocks:
        c = block.shape.corners if block.shape else block.nodes.shape[1]
        rest = block.nodes[:, c:]
        row, at = np.nonzero(is_corner[rest])
        nodes.append(rest[row, at])
        elements.append(first + row)
        first += len(block)
    node, element = np.concatenate(nodes), np.concatenate(elements)
    known = is_corner[node]
    return lists(node[known], element[known], len(is_corner))


def _outer(points: Array, blocks: Sequence[Block], hanging: Hanging | None) -> Mask:
    """Return a mask of the corner nodes on the surface of the elements."""
    outer = np.zeros(len(points), dtype=bool)
    faces = [face for face in Faces(blocks).boundary if face.shape is not None]
    for face in faces:
        outer[face.nodes[:, : face.shape.corners]] = True
    if hanging is None or not len(hanging.nodes):
        return outer
    # Where a large face meets small ones, their area vectors cancel at the nodes that carry them.
    area, size = np.zeros_like(points), np.zeros(len(points))
    for face in faces:
        corners = face.nodes[:, : face.shape.corners]
        X = points[corners]
        ahead, back = (np.roll(X, shift, axis=1) - X for shift in (-1, 1))
        normal = np.cross(ahead, back) / 4
        for axis in range(3):
            area[:, axis] += np.bincount(corners.ravel(), normal[..., axis].ravel(), len(points))
        size += np.bincount(corners.ravel(), np.linalg.norm(normal, axis=-1).ravel(), len(points))
    slave = hanging.nodes[hanging.masters.owner]
    for axis in range(3):
        area[:, axis] += np.bincount(
            hanging.masters.entries, hanging.weights * area[slave, axis], len(points)
        )
    size += np.bincount(hanging.masters.entries, np.abs(hanging.weights) * size[slave], len(points))
    return outer & (np.linalg.norm(area, axis=1) > CANCELED * size)


def _neighborhoods(around: Lists, corners: Rows, outer: Mask, is_corner: Mask) -> tuple[Ints, Ints]:
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
    pair, at = np.nonzero(inner)
    codes, count = np.unique(node[pair] * len(outer) + near[pair, at], return_counts=True)
    chosen = _largest(codes // len(outer), count, len(outer))
    host, center = codes[chosen] // len(outer), codes[chosen] % len(outer)
    without = np.ones(len(outer), dtype=bool)
    without[host] = False
    pair, at = np.nonzero(usable & without[node][:, None])
    codes = np.unique(node[pair] * len(outer) + near[pair, at])
    alone, other = codes // len(outer), codes % len(outer)
    size = around.lengths
    best = np.zeros(len(outer), dtype=np.int64)
    np.maximum.at(best, alone, size[other])
    enough = 2 * size[alone] > best[alone]
    chosen = np.where(enough, other == alone, size[other] == best[alone])
    host, center = np.concatenate([host, alone[chosen]]), np.concatenate([center, other[chosen]])
    patch = around.take(center)
    found = np.concatenate([host[patch.owner] * len(corners) + patch.entries, node * len(corners) + element])
    found = np.unique(found)
    return found // len(corners), found % len(corners)


def _largest(owner: Ints, count: Ints, n: int) -> Mask:
    """Return a mask of the entries that have the largest count of their owner."""
    best = np.zeros(n, dtype=count.dtype)
    np.maximum.at(best, owner, count)
    return count == best[owner]


def _weights(owner: Ints, element: Ints, corners: Rows) -> Array:
    """Return 1 for elements that have the node as a corner, `FAR` for others."""
    return np.where((corners[element] == owner[:, None]).any(axis=1), 1.0, FAR)


def _patches_of_nodes(
    n: int, blocks: Sequence[Block], is_corner: Mask, number: Ints, hanging: Hanging | None
) -> Lists:
    """Return the patches of each node: its own; else those of its masters, or of its edge, face or cell."""
    owner, entries = [np.flatnonzero(is_corner)], [number[is_corner]]
    done = is_corner.copy()
    if hanging is not None:
        masters = hanging.masters
        known = is_corner[masters.entries]
        owner.append(hanging.nodes[masters.owner[known]])
        entries.append(number[masters.entries[known]])
        done[hanging.nodes] = True
    for block in blocks:
        for a, support in enumerate(_supports(block)):
            new, first = np.unique(block.nodes[:, a], return_index=True)
            new, first = new[~done[new]], first[~done[new]]
            done[new] = True
            at = block.nodes[first][:, support]
            known = is_corner[at]
            owner.append(np.repeat(new, known.sum(axis=1)))
            entries.append(number[at[known]])
    return lists(np.concatenate(owner), np.concatenate(entries), n)


def _supports(block: Block) -> list[list[int]]:
    """Return the corners of the edge, face or cell in which each node of a cell lies."""
    shape = block.shape
    if shape is None:
        return [[a] for a in range(block.nodes.shape[1])]
    linear = shape.linear()
    if linear is None:
        return [[a] if a < shape.corners else list(range(shape.corners)) for a in range(len(shape.nodes))]
    return [np.flatnonzero(np.abs(linear.N(xi)) > 1e-9).tolist() for xi in shape.nodes]
