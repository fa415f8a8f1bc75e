"""Facets: the surface of a body as small flat polygons and the edges of its elements, cut if wanted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from kratos_lite.mesh import Block, Mesh, mask_of, with_rows
from kratos_lite.mesh.facets import folds
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints, Mask, Numbers
from kratos_lite.view.canvas import polygons
from kratos_lite.view.plane import Plane, clip_facets, clip_lines, cut_cells, cut_facets

PLAIN = (0.62, 0.72, 0.84)
"""Color of a body without values."""
LIGHT: Array = np.array([-0.4, 0.5, 0.77])
"""Where light comes from, to the right, upwards and towards the viewer."""
AMBIENT = 0.45
"""Brightness of what is turned away from it."""
LINE, SHARP, PART = range(3)
"""Kinds of edges: between elements, where faces meet at an angle, and around a part."""
INK: Array = np.array([(0.1, 0.1, 0.15, 0.75, 0.45), (0.1, 0.1, 0.15, 0.9, 0.9), (0.78, 0.27, 0.17, 1, 1.8)])
"""Red, green, blue, strength and width in points of each kind."""
FADE = (2.5, 6.0)
"""Points between lines of the mesh up to which they are not drawn, and from which they are in full."""
ANGLE = 30.0
"""Degrees by which faces meet at a sharp edge."""
MANY = 20000
"""Facets to aim at."""
EDGE_ON = 1e-9
"""Cosine between normal and view of a facet that is seen from the side."""
FINEST, SHADES, CURVE = 40, 8, 6
"""Parts of an edge at most, with and without values that vary along it; of a curved line."""


@dataclass(eq=False)
class Facets:
    """What of a body is seen."""

    corners: Array  # (m, 4, 3) m, in their places; triangles repeat a corner
    light: Array  # (m,) brightness, 0 … 1
    values: Array  # (m,)
    edges: Array  # (k, 2, 3) m, pieces of edges of elements
    ink: Array  # (k, 5), as `INK` has it, of each


@dataclass(frozen=True, eq=False)
class _Body:
    """A body, and how it is seen."""

    mesh: Mesh
    x: Array  # (n, 3) m, where its nodes are
    values: Array | None
    rows: Array  # of the camera
    plane: Plane | None
    n: int  # parts of an edge
    point: float  # m of a point, 1/72 inch, in the picture


def facets_of(
    mesh: Mesh,
    x: Array,
    values: Array | None,
    rows: Array,
    plane: Plane | None = None,
    most: int = MANY,
    window: tuple[Array, Array] | None = None,
    point: float = 0.0,
    part: Mask | None = None,
) -> Facets:
    """Return what is seen of a body with nodes at x (n, 3) m in a window, in about `most` facets.

    `point` is that many m in the picture; a part, given by its nodes (n,), is outlined.
    """
    seen = [_inside(block, x, rows, window) for block in mesh.boundary]
    n = fineness(sum(map(np.count_nonzero, seen)), most)
    if values is None or len(values) != mesh.n_nodes:
        n = min(n, SHADES)  # as fine as shape and order in depth need
    body = _Body(mesh, x, values, rows, plane, n, point)
    blocks = zip(mesh.boundary, seen, kinds_of_edges(mesh, part), strict=True)
    parts = [_of_block(body, block.take(at), kinds[at]) for block, at, kinds in blocks]
    if plane is not None:
        solids = [(b, at) for b, at in with_rows(mesh.blocks) if b.shape is not None and b.shape.faces]
        parts += [_of_cut(body, plane, block, at.start) for block, at in solids]
    return Facets(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def _inside(block: Block, x: Array, rows: Array, window: tuple[Array, Array] | None) -> Mask:
    """Return which faces may be seen in a window."""
    if window is None:
        return np.ones(len(block), dtype=bool)
    flat = (x @ rows[:2].T)[block.nodes]
    low, high = flat.min(axis=1), flat.max(axis=1)
    margin = 0.25 * (high - low)  # a curved face reaches beyond its nodes by less
    return np.asarray(((high + margin >= window[0]) & (low - margin <= window[1])).all(axis=1))


def fineness(count: int, most: int = MANY) -> int:
    """Return into how many parts an edge of each of so many faces is cut."""
    return int(np.clip(np.sqrt(most / max(count, 1)), 1, FINEST))


def _of_block(body: _Body, block: Block, kinds: Ints) -> tuple[Array, Array, Array, Array, Array]:
    """Return corners, light, value, edges and ink of the faces of one shape that face the viewer."""
    shape, x, rows, plane = block.known_shape, body.x, body.rows, body.plane
    xi, corners = grid(shape.cell, body.n)
    N = shape.N(xi)
    P = np.einsum("pa,mad->mpd", N, x[block.nodes])[:, corners].reshape(-1, 4, 3)
    normal = _normals(P)
    front = normal @ rows[2] > EDGE_ON
    light = lit(normal[front], rows)
    value = _values(block.nodes, block.ids, body, N[corners].mean(axis=1))[front]
    facing = front.reshape(len(block), len(corners)).any(axis=1)
    edges, beyond, ink = _edges(body, block, kinds, facing)
    if plane is None:
        return P[front], light, value, edges, ink
    d = (plane.distance(body.mesh.points)[block.nodes] @ N.T)[:, corners].reshape(-1, 4)
    section = cut_facets(P, d)
    P, kept = clip_facets(P[front], d[front])
    edges, whole = clip_lines(edges, beyond)
    inks = np.concatenate([ink[whole], np.tile(INK[SHARP], (len(section), 1))])
    return P, light[kept], value[kept], np.concatenate([edges, section]), inks


def _edges(body: _Body, block: Block, kinds: Ints, facing: Mask) -> tuple[Array, Array, Array]:
    """Return pieces (k, 2, 3) of edges of faces, how far they lie beyond the plane (k, 2), and their ink."""
    shape = block.known_shape
    strength = _strength(body, block.nodes[:, : shape.corners])[:, None]
    shown = facing[:, None] & ((strength > 0) | (kinds != LINE))
    one, other = block.nodes[:, np.array(shape.edges)][shown].astype(np.int64).T
    number = np.minimum(one, other) * body.mesh.n_nodes + np.maximum(one, other)
    shown[shown] = mask_of(np.unique(number, return_index=True)[1], len(number))  # each edge once
    some = shown.any(axis=1)  # of large meshes few
    nodes, kinds = block.nodes[some], kinds[some]
    N, ink = shape.N(rim(shape, body.n)), INK[kinds]
    ink[..., 3] *= np.where(kinds == LINE, strength[some], 1.0)
    pieces = np.repeat(shown[some], body.n, axis=1)
    edges = np.einsum("spa,mad->mspd", N, body.x[nodes])[pieces]
    beyond = np.zeros((len(edges), 2))
    if body.plane is not None:
        beyond = np.einsum("spa,ma->msp", N, body.plane.distance(body.mesh.points)[nodes])[pieces]
    return edges, beyond, np.repeat(ink, body.n, axis=1)[pieces]


def _strength(body: _Body, corners: Numbers) -> Array:
    """Return the strength (m,) of edges of faces by their corners (m, c): 0 where these would be dense."""
    flat = (body.x @ body.rows[:2].T)[corners]
    a, b = flat[:, 2] - flat[:, 0], flat[:, -1] - flat[:, 1]
    sides = np.linalg.norm(flat - np.roll(flat, 1, axis=1), axis=2)
    height = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / np.maximum(sides.max(axis=1), 1e-300)
    apart = height * (1 if corners.shape[1] == 3 else 0.5)
    none, full = (points * body.point for points in FADE)
    return np.asarray(np.clip((apart - none) / max(full - none, 1e-300), 0, 1))


def _of_cut(body: _Body, plane: Plane, block: Block, start: int) -> tuple[Array, Array, Array, Array, Array]:
    """Return corners, light, value, edges and ink of the section through the cells of a block."""
    mesh, values, rows = body.mesh, body.values, body.rows
    per_cell = values is not None and len(values) == mesh.n_elements != mesh.n_nodes
    nodal = np.column_stack([body.x, np.zeros(mesh.n_nodes) if values is None or per_cell else values])
    cells, corners, edges = cut_cells(block, plane.distance(mesh.points), nodal)
    P, E = corners[..., :3], edges[..., :3]
    value = values[start + cells] if per_cell and values is not None else corners[..., 3].mean(axis=1)
    normal = _normals(P)
    normal *= np.where(normal @ rows[2] < 0, -1.0, 1.0)[:, None]
    return P, lit(normal, rows), value, E, np.tile(INK[LINE], (len(E), 1))


def _values(nodes: Numbers, parents: Ints, body: _Body, N: Array) -> Array:
    """Return a value for each facet; N (f, k) at the middles of the facets of a face."""
    if body.values is None:
        return np.zeros(len(nodes) * len(N))
    if len(body.values) == body.mesh.n_nodes:
        return (body.values[nodes] @ N.T).ravel()
    return np.repeat(body.values[parents], len(N))


def _normals(P: Array) -> Array:
    normal = np.cross(P[:, 2] - P[:, 0], P[:, 3] - P[:, 1] + P[:, 2] - P[:, 1])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)


def lit(normal: Array, rows: Array) -> Array:
    """Return the brightness (m,), 0 … 1, of facets with unit normals (m, 3)."""
    towards = normal @ (LIGHT @ rows) / np.linalg.norm(LIGHT)
    return AMBIENT + (1 - AMBIENT) * (1 + towards) / 2


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


def draw_facets(axes: Any, rows: Array, facets: Facets, colors: Array, strength: float = 1.0) -> Any:
    """Draw facets in colors (m, 4) and their edges from back to front."""
    P, E = facets.corners, facets.edges[:, [0, 1, 1, 0]]
    near = P @ rows[2]
    # An edge lies on top of the facets beside it, however these lean.
    above = (near.max(axis=1) - near.mean(axis=1)).max() if len(P) else 0.0
    order = np.argsort(np.concatenate([near.mean(axis=1), E.mean(axis=1) @ rows[2] + above]), kind="stable")
    both = np.vstack([colors, facets.ink[:, :4] * (1, 1, 1, strength)])[order]
    widths = np.concatenate([np.full(len(P), INK[LINE, 4]), facets.ink[:, 4]])[order]
    return polygons(axes, np.concatenate([P, E])[order] @ rows[:2].T, both, widths)


def depth_at(facets: Facets, rows: Array, place: Array) -> float:
    """Return the coordinate to the viewer of the nearest facet at a place (2,) of the picture, or -inf."""
    P = facets.corners @ rows.T - [*place, 0.0]
    a, b = P[..., :2], np.roll(P[..., :2], -1, axis=1)
    side = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    touching = 1e-9 * np.abs(np.ptp(P, axis=1)).max(axis=1, keepdims=True) ** 2
    P = P[(side >= -touching).all(axis=1) | (side <= touching).all(axis=1)]
    normal = np.cross(P[:, 2] - P[:, 0], P[:, 3] - P[:, 1])
    flat = np.abs(normal[:, 2]) > EDGE_ON * np.linalg.norm(normal, axis=1)
    P, normal = P[flat], normal[flat]
    return float(((normal * P.mean(axis=1)).sum(axis=1) / normal[:, 2]).max(initial=-np.inf))


def behind(facets: Facets, places: Array, rows: Array) -> Mask:
    """Return which places (k, 3) m a body hides."""
    return np.array([depth_at(facets, rows, x[:2]) > x[2] for x in places @ rows.T], dtype=bool)


def colored(facets: Facets, colors: Any = None, strength: float = 1.0) -> Array:
    """Return colors (m, 4) of facets under light, of their values or plain, mixed with white if weak."""
    rgba = np.tile([*PLAIN, 1.0], (len(facets.light), 1)) if colors is None else colors.to_rgba(facets.values)
    rgba[:, :3] = 1 - strength * (1 - rgba[:, :3] * facets.light[:, None])
    return rgba


# ---- edges -----------------------------------------------------------------------------------------


def kinds_of_edges(mesh: Mesh, part: Mask | None = None) -> list[Ints]:
    """Return the kinds (m, e) of the edges of boundary faces, block by block, around a part of nodes (n,)."""
    found, marked = folds(mesh), []
    if part is not None:
        faces = np.concatenate([part[block.nodes].all(axis=1) for block in mesh.boundary])[found.faces]
        marked.append((found.sides[faces[:, 0] != faces[:, 1]], PART))
    return _by_block(mesh, [(found.sides[found.angle > ANGLE], SHARP), *marked])


def _by_block(mesh: Mesh, marked: Sequence[tuple[Ints, int]]) -> list[Ints]:
    """Return a number (m, e) for each side of boundary faces, that of the last sides among which it is."""
    counts = [len(block) * block.known_shape.corners for block in mesh.boundary]
    every = np.zeros(sum(counts), dtype=np.int64)
    for sides, kind in marked:
        every[sides] = kind
    each = np.split(every, np.cumsum(counts)[:-1])
    return [some.reshape(-1, len(block)).T for some, block in zip(each, mesh.boundary, strict=True)]


def outline(mesh: Mesh) -> Array:
    """Return the sharp edges of the undeformed body in straight pieces, (m, 2, 3) m."""
    found = folds(mesh)
    once, lines = [(found.sides[found.angle > ANGLE, 0], SHARP)], [np.zeros((0, 2, 3))]
    for block, kinds in zip(mesh.boundary, _by_block(mesh, once), strict=True):
        shape = block.known_shape
        n = 1 if len(shape.nodes) == shape.corners else CURVE
        N = shape.N(rim(shape, n)).reshape(shape.corners, n, 2, -1)
        face, side = np.nonzero(kinds)
        lines.append(np.einsum("kspa,kad->kspd", N[side], mesh.points[block.nodes[face]]).reshape(-1, 2, 3))
    return np.concatenate(lines)


def sharp_edges(mesh: Mesh) -> Ints:
    """Return the edges along which faces of the undeformed body meet at an angle, (m, 2) rows of nodes."""
    found = folds(mesh)
    return found.nodes[found.angle > ANGLE]
