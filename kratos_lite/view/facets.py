"""Facets: the surface of a body as small flat polygons and the edges of its elements, cut if wanted."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.mesh import Block, Mesh, with_rows
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints, Numbers
from kratos_lite.view.canvas import polygons
from kratos_lite.view.plane import Plane, clip_facets, clip_lines, cut_cells

PLAIN = (0.62, 0.72, 0.84)
"""Color of a body without values."""
LIGHT: Array = np.array([0.35, -0.65, 0.67])
INK = (0.1, 0.1, 0.15, 0.55)
MANY = 20000
"""Faces from which their edges are no longer drawn, and facets to aim at."""
EDGE_ON = 1e-9
"""Cosine between normal and view of a facet that is seen from the side."""
FINEST, SHADES = 40, 8
"""Parts of an edge at most, with and without values that vary along it."""


@dataclass(eq=False)
class Facets:
    """What of a body is seen."""

    corners: Array  # (m, 4, 3) m, in their places; triangles repeat a corner
    light: Array  # (m,) brightness, 0 … 1
    values: Array  # (m,)
    edges: Array  # (k, 2, 3) m, pieces of edges of elements


def facets_of(
    mesh: Mesh,
    x: Array,
    values: Array | None,
    rows: Array,
    plane: Plane | None = None,
    most: int = MANY,
    window: tuple[Array, Array] | None = None,
) -> Facets:
    """Return what is seen of a body with nodes at x (n, 3) m in a window, in about `most` facets."""
    faces = [_inside(block, x, rows, window) for block in mesh.boundary]
    n, edged = fineness(sum(map(len, faces)), most)
    if values is None or len(values) != mesh.n_nodes:
        n = min(n, SHADES)  # as fine as shape and order in depth need
    parts = [_of_block(block, mesh, x, values, rows, plane, n) for block in faces]
    if plane is not None:
        solids = [(b, at) for b, at in with_rows(mesh.blocks) if b.shape is not None and b.shape.faces]
        parts += [_of_cut(block, at.start, mesh, x, values, rows, plane) for block, at in solids]
    corners, light, value, edges = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return Facets(corners, light, value, edges if edged else edges[:0])


def _inside(block: Block, x: Array, rows: Array, window: tuple[Array, Array] | None) -> Block:
    """Return the faces that may be seen in a window."""
    if window is None:
        return block
    flat = (x @ rows[:2].T)[block.nodes]
    low, high = flat.min(axis=1), flat.max(axis=1)
    margin = 0.25 * (high - low)  # a curved face reaches beyond its nodes by less
    return block.take(((high + margin >= window[0]) & (low - margin <= window[1])).all(axis=1))


def fineness(count: int, most: int = MANY) -> tuple[int, bool]:
    """Return into how many parts an edge of each of so many faces is cut, and whether edges are drawn."""
    return int(np.clip(np.sqrt(most / max(count, 1)), 1, FINEST)), count < MANY


def _of_block(
    block: Block, mesh: Mesh, x: Array, values: Array | None, rows: Array, plane: Plane | None, n: int
) -> tuple[Array, Array, Array, Array]:
    """Return corners, light, value and edges of the faces of one shape that face the viewer."""
    assert block.shape is not None
    xi, corners = grid(block.shape.cell, n)
    N = block.shape.N(xi)
    P = np.einsum("pa,mad->mpd", N, x[block.nodes])[:, corners].reshape(-1, 4, 3)
    normal = _normals(P)
    front = normal @ rows[2] > EDGE_ON
    light = _light(normal[front])
    value = _values(block.nodes, block.ids, mesh, values, N[corners].mean(axis=1))[front]
    facing = front.reshape(len(block), len(corners)).any(axis=1)
    N_rim = block.shape.N(rim(block.shape, n))
    E = np.einsum("spa,mad->mspd", N_rim, x[block.nodes[facing]]).reshape(-1, 2, 3)
    P = P[front]
    if plane is not None:
        distance = plane.distance(mesh.points)
        d = (distance[block.nodes] @ N.T)[:, corners].reshape(-1, 4)[front]
        P, kept = clip_facets(P, d)
        light, value = light[kept], value[kept]
        E = clip_lines(E, np.einsum("spa,ma->msp", N_rim, distance[block.nodes[facing]]).reshape(-1, 2))
    return P, light, value, E


def _of_cut(
    block: Block, start: int, mesh: Mesh, x: Array, values: Array | None, rows: Array, plane: Plane
) -> tuple[Array, Array, Array, Array]:
    """Return corners, light, value and edges of the section through the cells of a block."""
    per_cell = values is not None and len(values) == mesh.n_elements != mesh.n_nodes
    nodal = np.column_stack([x, np.zeros(mesh.n_nodes) if values is None or per_cell else values])
    cells, corners, edges = cut_cells(block, plane.distance(mesh.points), nodal)
    P, E = corners[..., :3], edges[..., :3]
    value = values[start + cells] if per_cell and values is not None else corners[..., 3].mean(axis=1)
    normal = _normals(P)
    normal *= np.where(normal @ rows[2] < 0, -1.0, 1.0)[:, None]
    return P, _light(normal), value, E


def _values(nodes: Numbers, parents: Ints, mesh: Mesh, values: Array | None, N: Array) -> Array:
    """Return a value for each facet; N (f, k) at the middles of the facets of a face."""
    if values is None:
        return np.zeros(len(nodes) * len(N))
    if len(values) == mesh.n_nodes:
        return (values[nodes] @ N.T).ravel()
    return np.repeat(values[parents], len(N))


def _normals(P: Array) -> Array:
    normal = np.cross(P[:, 2] - P[:, 0], P[:, 3] - P[:, 1] + P[:, 2] - P[:, 1])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)


def _light(normal: Array) -> Array:
    return 0.86 + 0.14 * np.clip(normal @ LIGHT, 0, 1)


def grid(cell: str, n: int) -> tuple[Array, Ints]:
    """Return grid points on a reference face, and the corners of its n² facets."""
    steps = np.linspace(0, 1, n + 1)
    grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    i, j = (k.ravel() for k in np.meshgrid(range(n), range(n), indexing="ij"))
    a, b, c, d = (i * (n + 1) + j, (i + 1) * (n + 1) + j, (i + 1) * (n + 1) + j + 1, i * (n + 1) + j + 1)
    if cell == "quadrilateral":
        return 2 * grid - 1, np.stack([a, b, c, d], axis=-1)
    lower, upper = i + j < n, i + j < n - 1
    # A triangle as a quadrilateral with a repeated corner: one array holds both.
    return grid, np.vstack([np.stack([a, b, d, d], -1)[lower], np.stack([b, c, d, d], -1)[upper]])


def rim(shape: type[Shape], n: int) -> Array:
    """Return the pieces of the edges of a reference face, (edges · n, 2, 2)."""
    t = np.linspace(0, 1, n + 1)[:, None]
    pieces = [(1 - t) * shape.nodes[a] + t * shape.nodes[b] for a, b in shape.edges]
    return np.array([pair for line in pieces for pair in pairwise(line)])


def draw_facets(axes: Any, rows: Array, facets: Facets, colors: Array, ink: ArrayLike = INK) -> Any:
    """Draw facets in colors (m, 4) and their edges in ink from back to front."""
    P, E = facets.corners, facets.edges[:, [0, 1, 1, 0]]
    near = P @ rows[2]
    # An edge lies on top of the facets beside it, however these lean.
    above = (near.max(axis=1) - near.mean(axis=1)).max() if len(P) else 0.0
    order = np.argsort(np.concatenate([near.mean(axis=1), E.mean(axis=1) @ rows[2] + above]), kind="stable")
    both = np.vstack([colors, np.tile(ink, (len(E), 1))])[order]
    return polygons(axes, np.concatenate([P, E])[order] @ rows[:2].T, both)


def colored(facets: Facets, colors: Any = None, strength: float = 1.0) -> Array:
    """Return colors (m, 4) of facets under light, of their values or plain, mixed with white if weak."""
    rgba = np.tile([*PLAIN, 1.0], (len(facets.light), 1)) if colors is None else colors.to_rgba(facets.values)
    rgba[:, :3] = 1 - strength * (1 - rgba[:, :3] * facets.light[:, None])
    return rgba


def outline(mesh: Mesh) -> Array:
    """Return the sharp edges of the undeformed body in straight pieces, (m, 2, 3) m."""
    rows, m = _sharp(mesh)
    a, b = np.moveaxis(mesh.points[rows], 1, 0)
    t = np.linspace(0, 1, 7 if (m != (a + b) / 2).any() else 2)[:, None, None]
    curves = a * (1 - t) * (1 - 2 * t) + 4 * m * t * (1 - t) + b * t * (2 * t - 1)
    return np.stack([curves[:-1], curves[1:]], axis=2).reshape(-1, 2, 3)


def sharp_edges(mesh: Mesh) -> Ints:
    """Return the edges along which faces of the undeformed body meet at an angle, (m, 2) rows of nodes."""
    return _sharp(mesh)[0]


def _sharp(mesh: Mesh) -> tuple[Ints, Array]:
    """Return sharp edges (m, 2) as rows of nodes, and their middles (m, 3) m."""
    pairs, middles, normals = [], [], []
    for block in mesh.boundary:
        assert block.shape is not None
        X = mesh.points[block.nodes]
        normal = np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        for number, edge in enumerate(block.shape.edges, block.shape.corners):
            pairs.append(np.sort(block.nodes[:, list(edge)], axis=1))
            straight = len(block.shape.nodes) == block.shape.corners
            middles.append(X[:, list(edge)].mean(axis=1) if straight else X[:, number])
            normals.append(normal)
    unique, first, which, counts = np.unique(
        np.vstack(pairs), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    mean = np.zeros((len(unique), 3))
    np.add.at(mean, which.ravel(), np.vstack(normals))
    # Two unit normals at an angle a add up to a length of 2 cos(a/2).
    sharp = (counts == 2) & (np.linalg.norm(mean, axis=1) < 2 * np.cos(np.radians(15)))
    return np.asarray(unique[sharp]), np.concatenate(middles)[first[sharp]]
