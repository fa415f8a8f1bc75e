"""Facets: boundary faces of straight cells that stand for a curved surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kratos_lite.mesh.blocks import NO_ROWS, Block, mask_of
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.mesh.topology import equal_sets
from kratos_lite.typing import Array, Ints, Mask

ANGLES = (2.0, 40.0)
"""Degrees by which faces that stand for a curved surface turn from one to the next."""
STRAIGHT = 1e-3
"""Fraction of its length that the middle of a straight edge is off."""


def facets(mesh: Mesh) -> tuple[int, float]:
    """Return how many boundary faces seem to stand for a curved surface, and their turn in degrees."""
    found = folds(mesh)
    (one, other), angle = found.faces.T, found.angle
    blocks = [block for block in mesh.boundary if block.shape is not None]
    straight = np.concatenate([np.zeros(0, dtype=bool), *[_straight(mesh, block) for block in blocks]])
    small = straight[one] & straight[other] & (angle > ANGLES[0]) & (angle < ANGLES[1])
    turns = np.bincount(np.concatenate([one[small], other[small]]), minlength=len(straight))
    curved = int((turns > 1).sum())
    return curved, round(float(np.median(angle[small])), 6) if curved else 0.0


def reentrant_nodes(mesh: Mesh) -> Mask:
    """Return the nodes (n,) on edges of the surface where the body has more than 180° and `ANGLES`."""
    found = folds(mesh)
    return mask_of(found.nodes[(found.angle > ANGLES[1]) & (found.ahead > -1e-6)], mesh.n_nodes)


@dataclass(frozen=True, eq=False)
class Folds:
    """Edges (k,) of the surface, and the two boundary faces that meet at each."""

    sides: Ints  # (k, 2) of these faces, by number through blocks, edges of a face, faces
    faces: Ints  # (k, 2), by number through blocks
    nodes: Ints  # (k, 2)
    angle: Array  # by which the normal turns, in degrees
    ahead: Array  # > 0 where the body has more than 180°


def folds(mesh: Mesh) -> Folds:
    """Return the edges of the surface."""
    edges, faces, ends, normals, centers = [], [NO_ROWS], [], [np.zeros((0, 3))], [np.zeros((0, 3))]
    for block in mesh.boundary:
        c, count = block.known_shape.corners, sum(map(len, normals))
        sides = [(i, (i + 1) % c) for i in range(c)]
        edges.append((block.nodes, sides))
        ends += [block.nodes[:, side] for side in sides]
        faces.append(np.tile(count + np.arange(len(block)), c))
        normals.append(unit_normals(mesh.points[block.nodes[:, :c]]))
        centers.append(mesh.points[block.nodes[:, :c]].mean(axis=1))
    pairs = np.stack(equal_sets(edges), axis=1)
    meet = np.concatenate(faces)[pairs]
    n, X = np.concatenate(normals)[meet], np.concatenate(centers)[meet]
    angle = np.degrees(np.arccos(np.clip((n[:, 0] * n[:, 1]).sum(axis=1), -1, 1)))
    step = X[:, 1] - X[:, 0]
    ahead = (n[:, 0] * step).sum(axis=1) / np.maximum(np.linalg.norm(step, axis=1), 1e-300)
    nodes = np.concatenate([np.zeros((0, 2), dtype=int), *ends])[pairs[:, 0]]
    return Folds(pairs, meet, nodes, angle, ahead)


def _straight(mesh: Mesh, block: Block) -> Mask:
    """Return which faces (m,) have straight edges."""
    shape, X = block.known_shape, mesh.points
    c, straight = shape.corners, np.ones(len(block), dtype=bool)
    if len(shape.nodes) == c:
        return straight
    for i in range(c):
        a, b, m = (X[block.nodes[:, k]] for k in (i, (i + 1) % c, c + i))
        off, length = np.linalg.norm(m - (a + b) / 2, axis=1), np.linalg.norm(b - a, axis=1)
        straight &= off <= STRAIGHT * length
    return straight


def unit_normals(X: Array) -> Array:
    """Return the unit normals (m, 3) of faces with 3 or 4 corners (m, c, 3)."""
    n = np.cross(X[:, 2] - X[:, 0], X[:, -1] - X[:, 1])
    return n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
