"""Topology: how faces lie on the boundary of a mesh, and cells that are turned inside out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kratos_lite.mesh.blocks import Block
from kratos_lite.shapes import Shape
from kratos_lite.typing import Ints


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
    center = block.shape.nodes[: block.shape.corners].mean(axis=0)
    J = np.swapaxes(points[block.nodes], 1, 2) @ block.shape.dN(center)
    return np.asarray(np.linalg.det(J) < 0)
