"""Meshes of the scenes, and nodal forces of loads that vary in space."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import kratos_lite as kl
from benchmarks import fields
from kratos_lite.elements.surface import area_vectors, face_rule
from kratos_lite.elements.tables import tabulate
from kratos_lite.mesh.generators import SPLITS, raise_order
from kratos_lite.quadrature import rule_for

Array = NDArray[np.float64]


def element(kind: str) -> str:
    """Return the name of an element kind.

    >>> element("8N")
    'KinematicLinear3D8N'
    """
    return f"KinematicLinear3D{kind}"


def split(points: Array, bricks: NDArray[np.int32], kind: str) -> kl.Mesh:
    """Return bricks (m, 8) split into elements of one kind with straight edges."""
    shape = kl.ELEMENTS[element(kind)].shape
    pieces = np.array(SPLITS[shape.cell])
    points, nodes = raise_order(points, bricks[:, pieces].reshape(-1, pieces.shape[1]), shape)
    m = len(nodes)
    block = kl.Block(
        element(kind), nodes.astype(np.int32), np.arange(1, m + 1), np.ones(m, dtype=np.int64), shape
    )
    return kl.Mesh(points, [block])


def merged(pieces: list[tuple[Array, NDArray[np.int32]]]) -> tuple[Array, NDArray[np.int32]]:
    """Return bricks of several pieces as one mesh: nodes at one place become one node."""
    starts = np.cumsum([0, *(len(points) for points, _ in pieces)])
    points = np.vstack([points for points, _ in pieces])
    bricks = np.vstack([bricks + start for (_, bricks), start in zip(pieces, starts, strict=False)])
    _, first, same = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    return points[first], same.ravel()[bricks].astype(np.int32)


def octant(n: int, kind: str, outer: Callable[[Array], Array], linear: bool) -> kl.Mesh:
    """Return the space between the unit sphere and an outer surface, x y z ≥ 0, in three blocks of n³ bricks.

    `outer` takes directions (m, 3) to the outer surface.  Nodes of quadratic elements lie on the curved
    surfaces, those of linear ones at the same corners.
    """
    grid = kl.box(cells=(n, n, n), element=element("8N" if linear else "27N"))
    s, t, r = grid.points.T
    pieces = []
    center, edges = np.ones(3), np.array([[1, 1, 0], [0, 1, 1], [1, 0, 1]])
    for k in range(3):
        pole, a, b = np.roll([1.0, 0, 0], k), edges[k], edges[(k + 2) % 3]
        flat = np.outer((1 - s) * (1 - t), pole) + np.outer(s * (1 - t), a)
        flat += np.outer((1 - s) * t, b) + np.outer(s * t, center)
        inner = flat / np.linalg.norm(flat, axis=1, keepdims=True)
        pieces.append((inner + r[:, None] * (outer(flat) - inner), grid.blocks[0].nodes))
    if linear:
        return split(*merged(pieces), kind)
    points, bricks = merged(pieces)
    return _curved(points, bricks, kind)


def _curved(points: Array, bricks: NDArray[np.int32], kind: str) -> kl.Mesh:
    """Return quadratic elements whose nodes are those of 27-node bricks (m, 27)."""
    shape = kl.ELEMENTS[element(kind)].shape
    reference = kl.ELEMENTS[element("27N")].shape.nodes
    pieces = np.array(SPLITS[shape.cell])
    places = []
    for cell in pieces:  # where in the brick the nodes of each piece lie
        unit, nodes = raise_order(reference[:8], cell[None], shape)
        places.append([int(np.abs(reference - x).sum(axis=1).argmin()) for x in unit[nodes[0]]])
    nodes = bricks[:, np.array(places)].reshape(-1, len(shape.nodes))
    used, renumbered = np.unique(nodes, return_inverse=True)
    m = len(nodes)
    nodes = renumbered.reshape(nodes.shape).astype(np.int32)
    block = kl.Block(element(kind), nodes, np.arange(1, m + 1), np.ones(m, dtype=np.int64), shape)
    return kl.Mesh(points[used], [block])


def on_plane(mesh: kl.Mesh, axis: int, value: float) -> NDArray[np.bool_]:
    """Return a mask of the nodes with coordinate `value` along an axis."""
    return np.abs(mesh.points[:, axis] - value) < 1e-9


# ---- loads that vary -------------------------------------------------------------------------------


def body_forces(mesh: kl.Mesh, force: fields.Field) -> Array:
    """Return ∫ N b dV as nodal forces (n, 3), with b known everywhere, by a rule of degree 8."""
    (block,) = mesh.blocks
    kind = kl.ELEMENTS[block.name]
    rule = rule_for(kind.shape.cell, 8)
    N, _ = tabulate(kind.shape, rule)
    total = np.zeros_like(mesh.points)
    for start in range(0, len(block), 2000):
        nodes = block.nodes[start : start + 2000]
        placed = kind(mesh.points[nodes], rule)
        share = N.T @ (force(N @ mesh.points[nodes]) * placed.dV[..., None])
        np.add.at(total, nodes, share)
    return total


def face_forces(mesh: kl.Mesh, where: NDArray[np.bool_], traction: fields.Field) -> Array:
    """Return ∫ N t dA over the boundary faces among nodes, as nodal forces (n, 3)."""
    total = np.zeros_like(mesh.points)
    for faces in mesh.faces(where):
        rule = face_rule(faces.shape)
        N, _ = tabulate(faces.shape, rule)
        X = mesh.points[faces.nodes]
        area = np.linalg.norm(area_vectors(faces.shape, X, rule), axis=-1)
        np.add.at(total, faces.nodes, N.T @ (traction(N @ X) * area[..., None]))
    return total
