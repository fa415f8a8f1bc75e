"""Facets: boundary faces of straight cells that stand for a curved surface."""

from __future__ import annotations

import numpy as np

from kratos_lite.mesh.blocks import Block
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.typing import Array, Ints, Mask

ANGLES = (2.0, 40.0)
"""Degrees by which faces that stand for a curved surface turn from one to the next."""
STRAIGHT = 1e-3
"""Share of its length that the middle of a straight edge is off."""


def facets(mesh: Mesh) -> tuple[int, float]:
    """Return how many boundary faces seem to stand for a curved surface, and by how many degrees they turn.

    These have straight edges and meet two neighbors or more at small angles; along a fold of flat surfaces
    faces meet one.
    """
    edges, faces, normals = (
        [np.zeros((0, 2), dtype=np.int64)],
        [np.zeros(0, dtype=np.int64)],
        [np.zeros((0, 3))],
    )
    count = 0
    for block in mesh.boundary:
        if block.shape is None or not len(block):
            continue
        c = block.shape.corners
        corners, straight = block.nodes[:, :c].astype(np.int64), _straight(mesh, block)
        mine = count + np.arange(len(block))
        for i in range(c):
            edges.append(np.sort(corners[straight][:, [i, (i + 1) % c]], axis=1))
            faces.append(mine[straight])
        normals.append(_normals(mesh.points[corners]))
        count += len(block)
    of, face = np.concatenate(edges), np.concatenate(faces)
    if not len(of):
        return 0, 0.0
    one, other = _pairs(of, face)
    n = np.concatenate(normals)
    angle = np.degrees(np.arccos(np.clip((n[one] * n[other]).sum(axis=1), -1, 1)))
    small = (angle > ANGLES[0]) & (angle < ANGLES[1])
    turns = np.bincount(np.concatenate([one[small], other[small]]), minlength=count)
    found = int((turns > 1).sum())
    return found, round(float(np.median(angle[small])), 6) if found else 0.0


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


def _pairs(edges: Ints, faces: Ints) -> tuple[Ints, Ints]:
    """Return the faces on both sides of each edge that has two."""
    order = np.lexsort(edges.T)
    edges, faces = edges[order], faces[order]
    same = (edges[1:] == edges[:-1]).all(axis=1)
    return faces[:-1][same], faces[1:][same]
