"""Pictures of bodies: the surface in isometric view, deformed and colored."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.errors import InputError
from kratos_lite.mesh import Block, Mesh
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import finite
from kratos_lite.view.canvas import color_bar, colors_of, lines, new_figure, polygons

ISOMETRIC: Array = np.array([[1, 1, 0], [-1, 1, 2], [1, -1, 1]]) / np.sqrt([[2], [6], [3]])
"""Rows: right, up and towards the viewer."""
PLAIN = (0.62, 0.72, 0.84)
"""Color of a body without values."""
LIGHT: Array = np.array([0.35, -0.65, 0.67])
UNITS = {
    "STRESS": "Pa",
    "PRESSURE": "Pa",
    "DISPLACEMENT": "m",
    "REACTION": "N",
    "FORCE": "N",
    "TEMPERATURE": "K",
    "ENERGY NORM": "√J",
}
MANY = 20000
"""Faces from which their edges are no longer drawn, and facets to aim at."""


def surface_figure(
    mesh: Mesh,
    displacement: ArrayLike | None = None,
    values: ArrayLike | None = None,
    *,
    title: str = "",
    unit: str | None = None,
    scale: float | None = None,
    size: tuple[float, float] = (8, 6),
) -> Any:
    """Return a figure of the surface of a body, deformed and colored, in isometric view.

    Parameters
    ----------
    mesh : points in m and element blocks.
    displacement : (n, 3) m; the undeformed edges are drawn thin.
    values : (n,) numbers on the nodes that color the surface.
    title : first line above the picture.
    unit : of `values`, at the color bar; found from the title if it names a variable that we know.
    scale : factor on the displacement; by default at least 1, the largest being a tenth of the body.
    size : largest width and height in inches, at 150 dots per inch.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        The mesh has no surface, an array has the wrong shape or gaps.
    KratosLiteError
        matplotlib is missing.
    """
    figure, axes = new_figure(size)
    if not mesh.boundary:
        raise InputError("there is nothing to draw: the mesh has no element of a known shape")
    X = mesh.points
    if displacement is not None:
        u = finite(displacement, "displacement", (mesh.n_nodes, 3))
        scale = _exaggeration(X, u) if scale is None else scale
        title = f"{title}\ndeformation × {scale:g}".strip()
        lines(axes, _outline(mesh))
        X = X + scale * u
    field = None if values is None else finite(values, "values", (mesh.n_nodes,))
    colors = _paint(axes, mesh.boundary, X, field)
    _rulers(axes, mesh.points, X)
    if colors is not None:
        if unit is None:
            unit = next((unit for word, unit in UNITS.items() if word in title.upper()), "")
        color_bar(figure, axes, colors, unit)
    axes.set_title(title, fontsize=11)
    return figure


def _exaggeration(X: Array, u: Array) -> float:
    """Return 1, 2 or 5 times a power of ten, at least 1, that makes the displacement a tenth of the body."""
    largest = np.linalg.norm(u, axis=1).max()
    if largest == 0:
        return 1.0
    wanted = 0.1 * np.linalg.norm(np.ptp(X, axis=0)) / largest
    if wanted < 1:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1, 2, 5) if step * power <= wanted * (1 + 1e-9)))


def _facets(cell: str, n: int) -> tuple[Array, Ints]:
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


def _rim(shape: type[Shape], n: int) -> Array:
    """Return the pieces of the edges of a reference face, (edges · n, 2, 2)."""
    t = np.linspace(0, 1, n + 1)[:, None]
    pieces = [(1 - t) * shape.nodes[a] + t * shape.nodes[b] for a, b in shape.edges]
    return np.array([pair for line in pieces for pair in pairwise(line)])


def visible(block: Block, X: Array, field: Array, n: int) -> tuple[Array, Array, Array, Array]:
    """Return of the facets that face the viewer: corners, light, value; and the edges of their faces."""
    assert block.shape is not None
    xi, corners = _facets(block.shape.cell, n)
    N = block.shape.N(xi)
    P = np.einsum("pa,mad->mpd", N, X[block.nodes])[:, corners].reshape(-1, 4, 3)
    normal = np.cross(P[:, 2] - P[:, 0], P[:, 3] - P[:, 1] + P[:, 2] - P[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    front = normal @ ISOMETRIC[2] > 0
    light = 0.86 + 0.14 * np.clip(normal[front] @ LIGHT, 0, 1)
    value = (field[block.nodes] @ N[corners].mean(axis=1).T).ravel()[front]
    facing = front.reshape(len(block), -1).any(axis=1)
    rim = np.einsum("spa,mad->mspd", block.shape.N(_rim(block.shape, n)), X[block.nodes[facing]])
    return P[front], light, value, rim.reshape(-1, 2, 3)


def _paint(axes: Any, boundary: list[Block], X: Array, field: Array | None) -> Any:
    """Draw facets and element edges from back to front; return what the color bar shows."""
    n, edged = fineness(sum(map(len, boundary)))
    drawn = [visible(block, X, np.zeros(len(X)) if field is None else field, n) for block in boundary]
    P, light, value, E = (np.concatenate(arrays) for arrays in zip(*drawn, strict=True))
    shown, colors = (None, np.tile([*PLAIN, 1], (len(P), 1))) if field is None else colors_of(value)
    colors[:, :3] *= light[:, None]
    draw_facets(axes, P, colors, E if edged else E[:0])
    return shown


def fineness(count: int) -> tuple[int, bool]:
    """Return into how many parts an edge of each of so many faces is cut, and whether edges are drawn."""
    return int(np.clip(np.sqrt(MANY / max(count, 1)), 1, 16)), count < MANY


def draw_facets(
    axes: Any, P: Array, colors: Array, E: Array, ink: ArrayLike = (0.1, 0.1, 0.15, 0.55)
) -> None:
    """Draw facets (m, 4, 3) in colors (m, 4) and edges (k, 2, 3) in ink from back to front."""
    E = E[:, [0, 1, 1, 0]]
    near = P @ ISOMETRIC[2]
    # An edge lies on top of the facets beside it, however these lean.
    above = (near.max(axis=1) - near.mean(axis=1)).max() if len(P) else 0.0
    order = np.argsort(
        np.concatenate([near.mean(axis=1), E.mean(axis=1) @ ISOMETRIC[2] + above]), kind="stable"
    )
    both = np.vstack([colors, np.tile(ink, (len(E), 1))])[order]
    widths = np.repeat([0.4, 0.5], [len(P), len(E)])[order]
    polygons(axes, np.concatenate([P, E])[order] @ ISOMETRIC[:2].T, both, widths)


def _outline(mesh: Mesh) -> Array:
    """Return the sharp edges of the undeformed body, (m, 2, 2) in the picture."""
    pairs, normals = [], []
    for block in mesh.boundary:
        assert block.shape is not None
        X = mesh.points[block.nodes]
        normal = np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        for edge in block.shape.edges:
            pairs.append(np.sort(block.nodes[:, list(edge)], axis=1))
            normals.append(normal)
    unique, which, counts = np.unique(np.vstack(pairs), axis=0, return_inverse=True, return_counts=True)
    mean = np.zeros((len(unique), 3))
    np.add.at(mean, which.ravel(), np.vstack(normals))
    # Two unit normals at an angle a add up to a length of 2 cos(a/2).
    sharp = (counts == 2) & (np.linalg.norm(mean, axis=1) < 2 * np.cos(np.radians(15)))
    return mesh.points[unique[sharp]] @ ISOMETRIC[:2].T


def _rulers(axes: Any, X: Array, moved: Array) -> None:
    """Draw the extent of the body along x, y and z beside its lower and left edges, clear of `moved`."""
    low, high = X.min(axis=0), X.max(axis=0)
    rounding = 1e-12 * np.abs([low, high]).max()
    beyond = max(0.0, float((low - moved.min(axis=0)).max()), float((moved.max(axis=0) - high).max()))
    away = 0.06 * np.linalg.norm(high - low) + beyond
    starts = [low, [high[0], low[1], low[2]], low]
    sides = [(-0.5, -0.87), (0.5, -0.87), (-1.0, 0.0)]
    anchors = [("right", "top"), ("left", "top"), ("right", "center")]
    for i, (start, side, (ha, va)) in enumerate(zip(starts, sides, anchors, strict=True)):
        end = np.array(start)
        end[i] = high[i]
        line = np.array([start, end]) @ ISOMETRIC[:2].T + away * np.array(side)
        axes.plot(*line.T, color="0.35", lw=0.8, marker=".", ms=4)
        ends = [0.0 if abs(place) < rounding else place for place in (low[i], high[i])]
        text = f"{'xyz'[i]}  {ends[0]:.4g} … {ends[1]:.4g} m"
        axes.text(
            *(line.mean(axis=0) + 0.3 * away * np.array(side)), text, ha=ha, va=va, size=9, color="0.25"
        )
