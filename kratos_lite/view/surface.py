"""Pictures: a body in isometric view, deformed and coloured, and reference cells with node numbers."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.errors import InputError, KratosLiteError
from kratos_lite.io.output import write_whole
from kratos_lite.mesh import Block, Floats, Mesh
from kratos_lite.shapes import Shape

ISOMETRIC: Floats = np.array([[1, 1, 0], [-1, 1, 2], [1, -1, 1]]) / np.sqrt([[2], [6], [3]])
"""Rows: right, up and towards the viewer."""
OBLIQUE: Floats = np.array([[0.90, 0.43, 0], [-0.13, 0.27, 0.954], [0.41, -0.86, 0.30]])
"""As `ISOMETRIC`, for cells: no two corners of a cube fall on one another."""
PLAIN = (0.62, 0.72, 0.84)
"""Colour of a body without values."""
LIGHT: Floats = np.array([0.35, -0.65, 0.67])
UNITS = {
    "STRESS": "Pa",
    "PRESSURE": "Pa",
    "DISPLACEMENT": "m",
    "REACTION": "N",
    "FORCE": "N",
    "TEMPERATURE": "K",
}
MANY = 20000
"""Faces from which their edges are no longer drawn, and facets to aim at."""


def picture(
    path: str | Path,
    mesh: Mesh,
    displacement: ArrayLike | None = None,
    values: ArrayLike | None = None,
    *,
    title: str = "",
    unit: str | None = None,
    scale: float | None = None,
    size: tuple[float, float] = (8, 6),
) -> None:
    """Draw the surface of a body, deformed and coloured, in isometric view.

    Parameters
    ----------
    path : picture to write; .png, .pdf or .svg.
    mesh : points in m and element blocks.
    displacement : (n, 3) m; the undeformed edges are drawn thin.
    values : (n,) numbers on the nodes that colour the surface.
    title : first line above the picture.
    unit : of `values`, at the colour bar; found from the title if it names a variable that we know.
    scale : factor on the displacement; by default at least 1, the largest being a tenth of the body.
    size : largest width and height in inches, at 150 dots per inch.

    Raises
    ------
    InputError
        The mesh has no surface, an array has the wrong shape or gaps, or the file cannot be written.
    KratosLiteError
        matplotlib is missing.

    Examples
    --------
    >>> from kratos_lite.shapes import Hexahedron8
    >>> cube = Block("cube", np.arange(8)[None], np.array([1]), np.array([1]), Hexahedron8)
    >>> mesh = Mesh(Hexahedron8.nodes, [cube])
    >>> picture(getfixture("tmp_path") / "cube.png", mesh, values=mesh.points[:, 0], title="x", unit="m")
    """
    figure, axes = _figure(size)
    if not mesh.boundary:
        raise InputError("there is nothing to draw: the mesh has no element of a known shape")
    X = mesh.points
    if displacement is not None:
        u = _numbers("displacement", displacement, (mesh.n_nodes, 3))
        scale = _exaggeration(X, u) if scale is None else scale
        title = f"{title}\ndeformation × {scale:g}".strip()
        axes.add_collection(_outline(mesh))
        X = X + scale * u
    field = None if values is None else _numbers("values", values, (mesh.n_nodes,))
    colours = _paint(axes, mesh.boundary, X, field)
    _rulers(axes, mesh.points, X)
    if colours is not None:
        if unit is None:
            unit = next((unit for word, unit in UNITS.items() if word in title.upper()), "")
        _bar(figure, axes, colours, unit)
    axes.set_title(title, fontsize=11)
    _save(path, figure)


def element_picture(path: str | Path, shape: type[Shape], points: ArrayLike | None = None) -> None:
    """Draw a reference cell with its node numbers (from 0), and Gauss points as crosses.

    Parameters
    ----------
    path : picture to write; .png, .pdf or .svg.
    shape : the cell.
    points : (g, d) reference coordinates to mark.

    Raises
    ------
    InputError
        `points` has the wrong shape, or the file cannot be written.
    KratosLiteError
        matplotlib is missing.

    Examples
    --------
    >>> from kratos_lite.shapes import Wedge15
    >>> element_picture(getfixture("tmp_path") / "wedge.png", Wedge15)
    """
    figure, axes = _figure((5, 5))
    d = shape.nodes.shape[1]
    view = OBLIQUE if d == 3 else np.eye(3)

    def flat(x: Floats) -> Floats:
        return np.pad(x, ((0, 0), (0, 3 - d))) @ view[:2].T

    X = flat(shape.nodes)
    hidden = _hidden_edges(shape)
    for edge in shape.edges or (() if d == 0 else ((0, 1),)):
        style = {"ls": (0, (4, 3)), "color": "0.6"} if frozenset(edge) in hidden else {"color": "0.15"}
        axes.plot(*X[list(edge)].T, lw=1.5, zorder=1, **style)
    for a, x in enumerate(X):
        corner = a < shape.corners
        box = {"boxstyle": "circle,pad=0.28", "fc": "#23538f" if corner else "white", "ec": "#23538f"}
        axes.text(
            *x, a, ha="center", va="center", size=9, color="w" if corner else "#23538f", bbox=box, zorder=3
        )
    if points is not None:
        G = np.asarray(points, dtype=float)
        if G.ndim != 2 or G.shape[1] != d:
            raise InputError(f"points must have shape (g, {d}) for {shape.__name__}; got {G.shape}")
        axes.plot(*flat(G).T, "x", color="#c8442b", ms=8, mew=2, zorder=2)
    _triad(axes, X, flat(np.eye(d)))
    axes.set_title(shape.__name__, fontsize=11)
    axes.autoscale_view()
    _save(path, figure)


def _triad(axes: Any, X: Floats, directions: Floats) -> None:
    """Draw the reference axes below and to the left of a cell."""
    length = 0.2 * np.ptp(X, axis=0).max()
    low = X.min(axis=0) - 1.2 * length
    for axis, name in zip(directions, "rst", strict=False):
        arrow = {"arrowstyle": "-|>", "color": "0.3", "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", low + length * axis, low, arrowprops=arrow, annotation_clip=False)
        axes.text(*(low + 1.25 * length * axis), name, ha="center", va="center", style="italic", color="0.3")


def _canvas() -> Any:
    """Return the canvas class that draws without a screen."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
    except ImportError as error:
        raise KratosLiteError("pictures need matplotlib: pip install kratos-lite[view]") from error
    return FigureCanvasAgg


def _figure(size: tuple[float, float]) -> tuple[Any, Any]:
    """Return a figure that needs no screen, and axes without frame in which a metre is a metre."""
    canvas = _canvas()
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, dpi=150, layout="constrained")
    canvas(figure)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.axis("off")
    return figure, axes


def check_picture_target(path: str | Path) -> str:
    """Return the format of a picture; InputError for one that cannot be written."""
    kind = Path(path).suffix[1:].lower() or "png"
    known = _canvas().get_supported_filetypes()
    if kind not in known:
        raise InputError(
            f"{path}: pictures cannot be written as .{kind}; known are {' '.join(sorted(known))}"
        )
    return kind


def _save(path: str | Path, figure: Any) -> None:
    kind = check_picture_target(path)
    write_whole(path, lambda file: figure.savefig(file, format=kind, bbox_inches="tight", pad_inches=0.1))


def _numbers(name: str, given: ArrayLike, shape: tuple[int, ...]) -> Floats:
    array = np.asarray(given, dtype=float)
    if array.shape != shape:
        raise InputError(f"{name} must have shape {shape}; got {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{name} must be finite; got {array[~np.isfinite(array)][0]}")
    return array


def _exaggeration(X: Floats, u: Floats) -> float:
    """Return 1, 2 or 5 times a power of ten, at least 1, that makes the displacement a tenth of the body."""
    largest = np.linalg.norm(u, axis=1).max()
    if largest == 0:
        return 1.0
    wanted = 0.1 * np.linalg.norm(np.ptp(X, axis=0)) / largest
    if wanted < 1:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1, 2, 5) if step * power <= wanted * (1 + 1e-9)))


def _facets(cell: str, n: int) -> tuple[Floats, NDArray[np.intp]]:
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


def _rim(shape: type[Shape], n: int) -> Floats:
    """Return the pieces of the edges of a reference face, (edges · n, 2, 2)."""
    t = np.linspace(0, 1, n + 1)[:, None]
    lines = [(1 - t) * shape.nodes[a] + t * shape.nodes[b] for a, b in shape.edges]
    return np.array([pair for line in lines for pair in pairwise(line)])


def _visible(block: Block, X: Floats, field: Floats, n: int) -> tuple[Floats, Floats, Floats, Floats]:
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


def _colours(value: Floats) -> tuple[Any, Floats]:
    """Return the scale of the colour bar and the colour of each value."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    low, high = (float(value.min()), float(value.max())) if len(value) else (0.0, 1.0)
    if high - low <= 1e-6 * max(abs(low), abs(high)):  # a constant is shown in the middle of the scale
        half = 0.5 * max(abs(low), abs(high)) or 1.0
        low, high = low - half, high + half
    shown = ScalarMappable(Normalize(low, high), colormaps["viridis"])
    return shown, np.asarray(shown.to_rgba(value))


def _bar(figure: Any, axes: Any, colours: Any, unit: str) -> None:
    """Draw the colour bar with one prefix for all its numbers."""
    from matplotlib.ticker import EngFormatter, FuncFormatter

    power = int(np.clip(3 * np.floor(np.log10(max(map(abs, colours.get_clim()))) / 3), -24, 24))
    shown = FuncFormatter(lambda value, _: f"{value / 10.0**power:g}")
    bar = figure.colorbar(colours, ax=axes, shrink=0.7, pad=0.03, aspect=25, format=shown)
    prefix = EngFormatter.ENG_PREFIXES[power]
    bar.set_label(prefix + unit if unit else f"× 1e{power}" if power else "")
    bar.outline.set_visible(False)


def _paint(axes: Any, boundary: list[Block], X: Floats, field: Floats | None) -> Any:
    """Draw facets and element edges from back to front; return what the colour bar shows."""
    from matplotlib.collections import PolyCollection

    count = sum(map(len, boundary))
    n = int(np.clip(np.sqrt(MANY / count), 1, 16))
    drawn = [_visible(block, X, np.zeros(len(X)) if field is None else field, n) for block in boundary]
    P, light, value, E = (np.concatenate(arrays) for arrays in zip(*drawn, strict=True))
    shown, colours = (None, np.tile([*PLAIN, 1], (len(P), 1))) if field is None else _colours(value)
    colours[:, :3] *= light[:, None]
    E = E[: len(E) if count < MANY else 0, [0, 1, 1, 0]]
    near = P @ ISOMETRIC[2]
    # An edge lies on top of the facets beside it, however these lean.
    above = (near.max(axis=1) - near.mean(axis=1)).max() if len(P) else 0.0
    order = np.argsort(
        np.concatenate([near.mean(axis=1), E.mean(axis=1) @ ISOMETRIC[2] + above]), kind="stable"
    )
    ink = np.vstack([colours, np.tile([0.1, 0.1, 0.15, 0.55], (len(E), 1))])[order]
    widths = np.repeat([0.4, 0.5], [len(P), len(E)])[order]
    flat: Any = np.concatenate([P, E])[order] @ ISOMETRIC[:2].T
    axes.add_collection(PolyCollection(flat, facecolors=ink, edgecolors=ink, linewidths=widths, zorder=2))
    return shown


def _outline(mesh: Mesh) -> Any:
    """Return the sharp edges of the undeformed body as thin lines."""
    from matplotlib.collections import LineCollection

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
    lines = mesh.points[unique[sharp]] @ ISOMETRIC[:2].T
    return LineCollection(lines, colors="0.55", linewidths=0.8, zorder=1)


def _rulers(axes: Any, X: Floats, moved: Floats) -> None:
    """Draw the extent of the body along x, y and z beside its lower and left edges, clear of `moved`."""
    low, high = X.min(axis=0), X.max(axis=0)
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
        text = f"{'xyz'[i]}  {low[i]:.4g} … {high[i]:.4g} m"
        axes.text(
            *(line.mean(axis=0) + 0.3 * away * np.array(side)), text, ha=ha, va=va, size=9, color="0.25"
        )


def _hidden_edges(shape: type[Shape]) -> set[frozenset[int]]:
    """Return the edges that touch no face turned to the viewer."""
    sides: dict[frozenset[int], bool] = {}
    for face in shape.faces:
        corners = [a for a in face if a < shape.corners]
        X = shape.nodes[corners]
        seen = bool(np.cross(X[1] - X[0], X[2] - X[0]) @ OBLIQUE[2] > 0)
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            sides[frozenset((a, b))] = sides.get(frozenset((a, b)), False) or seen
    return {edge for edge, seen in sides.items() if not seen}
