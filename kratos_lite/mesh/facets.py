"""Facets: boundary faces of straight cells that stand for a curved surface."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh.blocks import NO_ROWS, Block
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.mesh.topology import equal_sets
from kratos_lite.typing import Array, Mask

ANGLES = (2.0, 40.0)
"""Degrees by which faces that stand for a curved surface turn from one to the next."""
STRAIGHT = 1e-3
"""Fraction of its length that the middle of a straight edge is off."""


def facets(mesh: Mesh) -> tuple[int, float]:
    """Return how many boundary faces seem to stand for a curved surface, and by how many degrees they turn.

    These have straight edges and meet two neighbors or more at small angles; along a fold of flat surfaces
    faces meet one.
    """
    edges, faces, straight, normals = [], [NO_ROWS], [np.zeros(0, dtype=bool)], [np.zeros((0, 3))]
    count = 0
    for block in mesh.boundary:
        assert block.shape is not None
        c = block.shape.corners
        edges.append((block.nodes, [(i, (i + 1) % c) for i in range(c)]))
        faces.append(np.tile(count + np.arange(len(block)), c))
        straight.append(np.tile(_straight(mesh, block), c))
        normals.append(_normals(mesh.points[block.nodes[:, :c]]))
        count += len(block)
    first, second = equal_sets(edges)
    both = np.concatenate(straight)[first] & np.concatenate(straight)[second]
    one, other = (np.concatenate(faces)[edge[both]] for edge in (first, second))
    n = np.concatenate(normals)
    angle = np.degrees(np.arccos(np.clip((n[one] * n[other]).sum(axis=1), -1, 1)))
    small = (angle > ANGLES[0]) & (angle < ANGLES[1])
    turns = np.bincount(np.concatenate([one[small], other[small]]), minlength=count)
    curved = int((turns > 1).sum())
    return curved, round(float(np.median(angle[small])), 6) if curved else 0.0


def _straight(mesh: Mesh, block: Block) -> Mask:
    """Return which faces (m,) have straight edges."""
    shape, X = block.shape, mesh.points
    assert shape is not None
    c, straight = shape.corners, np.ones(len(block), dtype=bool)
    if len(shape.nodes) == c:
        return straight
    for i in range(c):
        a, b, m = (X[block.nodes[:, k]] for k in (i, (i + 1) % c, c + i))
        off, length = np.linalg.norm(m - (a + b) / 2, axis=1), np.linalg.norm(b - a, axis=1)
        straight &= off <= STRAIGHT * length
    return straight


def _normals(X: Array) -> Array:
    """Return the unit normals (m, 3) of faces with corners (m, c, 3)."""
    n = np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])
    if X.shape[1] == 4:
        n = np.cross(X[:, 2] - X[:, 0], X[:, 3] - X[:, 1])
    return n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
