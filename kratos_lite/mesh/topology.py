"""Topology: the faces on the boundary of a mesh, and cells that are turned inside out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kratos_lite.mesh.blocks import Block, Ints, with_rows
from kratos_lite.shapes import FACE_SHAPES, Shape


def boundary(blocks: Sequence[Block], n_nodes: int) -> list[Block]:
    """Return the faces that belong to one element only, outward, one block per face shape.

    ``ids`` holds the row of the parent element.
    """
    by_size: dict[int, list[tuple[NDArray[np.int32], Ints]]] = {}
    for block, at in with_rows(blocks):
        parents = np.arange(at.start, at.stop)
        for face in block.shape.faces if block.shape is not None else ():
            by_size.setdefault(len(face), []).append((block.nodes[:, list(face)], parents))
    faces = []
    for size, groups in by_size.items():
        parents = np.concatenate([p for _, p in groups])
        nodes = np.vstack([f for f, _ in groups])
        shape = FACE_SHAPES[size]
        faces.append(Block(shape.__name__, nodes, parents, 0 * parents, shape))
    single = _occurs_once([_key(block, n_nodes) for block in faces])
    kept = [block.take(mask) for block, mask in zip(faces, single, strict=True)]
    return [block for block in kept if len(block)]


def _key(block: Block, n_nodes: int) -> NDArray[np.int64]:
    """Return two numbers (2, m) that name the corners of each face, whatever their order."""
    assert block.shape is not None
    corners = np.sort(block.nodes[:, : block.shape.corners].astype(np.int64), axis=1)
    if corners.shape[1] == 3:
        corners = np.column_stack([corners, np.full(len(corners), n_nodes)])
    a, b, c, d = corners.T
    return np.stack([a * (n_nodes + 1) + b, c * (n_nodes + 1) + d])


def _occurs_once(keys: list[NDArray[np.int64]]) -> list[NDArray[np.bool_]]:
    """Return for each group of keys (2, m) which of them occur once in all groups together."""
    if not keys:
        return []
    every = np.hstack(keys)
    order = np.lexsort(every)
    ordered = every[:, order]
    same = (ordered[:, 1:] == ordered[:, :-1]).all(axis=0)
    once = np.ones(every.shape[1], dtype=bool)
    once[order[1:][same]] = False
    once[order[:-1][same]] = False
    return np.split(once, np.cumsum([k.shape[1] for k in keys])[:-1])


def outward_signs(boundary: Sequence[Block], block: Block) -> NDArray[np.float64]:
    """Return +1 for faces whose nodes run counter-clockwise from outside, -1 for others, 0 inside."""
    assert block.shape is not None
    c = block.shape.corners
    outside = [b.nodes[:, :c] for b in boundary if b.shape is not None and b.shape.corners == c]
    known = np.vstack([np.zeros((0, c), dtype=np.int32), *outside])
    corners = block.nodes[:, :c]
    both = np.sort(np.vstack([known, corners]), axis=1)
    _, key = np.unique(both, axis=0, return_inverse=True)
    key = key.ravel()
    owner = np.full(key.max(initial=-1) + 1, -1)
    owner[key[: len(known)]] = np.arange(len(known))
    match = owner[key[len(known) :]]
    signs = np.zeros(len(block))
    on = np.flatnonzero(match >= 0)
    mate = known[match[on]]
    start = np.argmax(mate == corners[on, :1], axis=1)
    following = np.take_along_axis(mate, ((start + 1) % c)[:, None], axis=1)[:, 0]
    signs[on] = np.where(following == corners[on, 1], 1.0, -1.0)
    return signs


def mirror(shape: type[Shape]) -> Ints:
    """Return the node order that turns a cell inside out: its reflection in r = s, or r = 0.

    >>> from kratos_lite.shapes import Tetrahedron4
    >>> mirror(Tetrahedron4).tolist()
    [0, 2, 1, 3]
    """
    swapped = shape.nodes[:, [1, 0, 2]]
    distance = np.abs(swapped[:, None, :] - shape.nodes[None, :, :]).max(axis=2)
    return np.asarray(distance.argmin(axis=1))


def inside_out(block: Block, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return a mask of the cells with det J < 0 at their centroid."""
    if block.shape is None or block.shape.nodes.shape[1] != 3:
        return np.zeros(len(block), dtype=bool)
    centre = block.shape.nodes[: block.shape.corners].mean(axis=0)
    J = np.swapaxes(points[block.nodes], 1, 2) @ block.shape.dN(centre)
    return np.asarray(np.linalg.det(J) < 0)
