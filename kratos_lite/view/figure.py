"""Figures of bodies: one or several side by side, with titles, rulers and a color bar."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from kratos_lite.mesh import with_rows
from kratos_lite.tabular import unit_name
from kratos_lite.typing import Array
from kratos_lite.view import canvas
from kratos_lite.view.facets import MANY, Facets, colored, depth_at, draw_facets, facets_of, outline
from kratos_lite.view.marks import dots, draw_marks
from kratos_lite.view.rulers import draw_rulers, draw_triad
from kratos_lite.view.scene import Options, Scene, Subject, drawn_points, place_text, scene_of

WIDE = 2.2
"""Width over height of a picture from which its color bar lies beneath."""
GAP = 0.45
"""Inches between panels; a title fits in."""


def figure_of(subjects: Sequence[Subject], options: Options) -> Any:
    """Return the figure of some subjects, side by side."""
    scene = scene_of(subjects, options)
    figure, panels, inch = compose(scene, options)
    for axes, subject in zip(panels, subjects, strict=True):
        _, facets = draw_body(axes, scene, subject, inch)
        draw_extremes(axes, scene, subject, facets)
    return figure


# ---- layout ----------------------------------------------------------------------------------------


def compose(scene: Scene, options: Options, title: str | None = None) -> tuple[Any, list[Any], float]:
    """Return the figure with all but the bodies, its panels, and how many m are an inch in them.

    A `title` takes the place of those of the subjects, as the longest one of an animation.
    """
    extent = scene.window[1] - scene.window[0]
    columns = _columns(len(scene.subjects), extent, options.size)
    counts = np.array([columns, -(-len(scene.subjects) // columns)])
    return fitted(extent, counts, options.size, lambda inch: _laid_out(scene, options, columns, inch, title))


def fitted(
    extent: Array, counts: Array, size: tuple[float, float], lay_out: Callable[[float], tuple[Any, list[Any]]]
) -> tuple[Any, list[Any], float]:
    """Return a figure of a size, its panels, and how many m are an inch in them.

    `lay_out` makes figure and panels for the m of an inch.  Texts keep their size: what they leave for the
    panels, `counts` across and down of `extent` m each, is known by laying out twice.
    """
    inside = whole = np.array(size, dtype=float)
    for _ in range(2):
        per_metre = float((np.maximum(inside, 0.2 * whole) / (extent * counts)).min())
        figure, panels = lay_out(1 / per_metre)
        inside = whole - (figure.get_size_inches() - per_metre * extent * counts)
    return figure, panels, 1 / per_metre


def _columns(count: int, extent: Array, size: tuple[float, float]) -> int:
    """Return the number of columns in which so many panels become largest."""

    def scale(columns: int) -> float:
        lines = -(-count // columns)
        return min((size[0] - 1) / columns / extent[0], (size[1] - 0.6 * lines) / lines / extent[1])

    return max(range(1, count + 1), key=scale)


def _laid_out(
    scene: Scene, options: Options, columns: int, inch: float, title: str | None
) -> tuple[Any, list[Any]]:
    """Return figure and axes; `inch` is that many m in the picture."""
    low, high = scene.window
    size = (high - low) / inch
    figure = canvas.empty((1, 1), layout=None)  # until all is there
    panels: list[Any] = []
    for _ in scene.subjects:
        axes = canvas.without_frame(canvas.axes_in_inches(figure, (0, 0), size))
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        panels.append(axes)
    # The rulers are those of the first panel of the last line, where they are in nobody's way.
    first = (len(panels) - 1) // columns * columns
    subject, has_rulers = scene.subjects[first], scene.zoom is None and not scene.subjects[first].moving
    if has_rulers:
        draw_rulers(panels[first], scene.rows, subject.mesh, drawn_points(scene, subject), inch)
    else:
        draw_triad(panels[first], scene.rows, scene.window, inch, units=subject.mesh.units)
    rise = max([0.0, *(float(max(line.get_ydata()) - high[1]) / inch for line in panels[first].lines)])
    most = options.size[0] / len(scene.subjects) ** 2
    lines = [texts(subject, most) if title is None else [] for subject in scene.subjects]
    for axes, subject, some in zip(panels, scene.subjects, lines, strict=True):
        canvas.entitle(axes, subject.title if title is None else title, some, rise)
    height = size[1] + rise + GAP + canvas.LINE / 72 * max(map(len, lines))
    step = np.array([max(size[0], *canvas.title_widths(panels)) + GAP, height])
    if has_rulers:
        step[0] = max(step[0], canvas.right_of(panels[first]) + GAP / 2)
    for number, axes in enumerate(panels):
        line, column = divmod(number, columns)
        canvas.move(axes, (column * step[0], -line * step[1]))
    if scene.colors is not None and not any(s.values and s.values.names for s in scene.subjects):
        _place_bar(figure, scene)
    _place_legend(figure, scene)
    _place_title(figure, options.title)
    canvas.fit(figure)
    return figure, panels


def _place_bar(figure: Any, scene: Scene) -> None:
    """Draw the color bar right of what is there, or beneath if that is wide."""
    (x0, y0), (x1, y1) = canvas.bounds(figure)
    upright = x1 - x0 < WIDE * (y1 - y0)
    if upright:
        length = min(max(0.7 * (y1 - y0), 1.8), 4.0)
        place, size = (x1 + 0.2, (y0 + y1 - length) / 2), (0.14, length)
    else:
        length = min(max(0.5 * (x1 - x0), 2.0), 4.0)
        place, size = ((x0 + x1 - length) / 2, y0 - 0.35), (length, 0.14)
    values = [subject.values for subject in scene.subjects if subject.values is not None]
    low, high = scene.colors.get_clim()
    below = any(v.numbers.min() < low for v in values if not v.log)
    above = any(v.numbers.max() > high for v in values)
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get((below, above), "neither")
    bar = canvas.axes_in_inches(figure, place, size)
    canvas.color_bar(bar, scene.colors, values[0].unit, extend, upright=upright)


def _place_legend(figure: Any, scene: Scene) -> None:
    """Draw what marks and colors stand for beneath what is there."""
    named = next((s.values.names for s in scene.subjects if s.values and s.values.names), ())
    entries = [("s", scene.colors.to_rgba(i), name) for i, name in enumerate(named)]
    entries += dict.fromkeys(entry for subject in scene.subjects for entry in subject.legend)
    if entries:
        (x0, y0), _ = canvas.bounds(figure)
        canvas.legend(canvas.axes_in_inches(figure, (x0, y0 - 0.25), (0.1, 0.1)), entries)


def _place_title(figure: Any, title: str) -> None:
    """Write the title above what is there."""
    if title:
        (x0, _), (x1, y1) = canvas.bounds(figure)
        style = {"transform": figure.dpi_scale_trans, "ha": "center", "va": "bottom", "size": 11}
        figure.text((x0 + x1) / 2, y1 + 0.12, title, **style)


def draw_body(
    axes: Any, scene: Scene, subject: Subject, inch: float, most: int = MANY
) -> tuple[list[Any], Facets]:
    """Draw one subject; return what was drawn, and its surface."""
    drawn = []
    deformed = subject.u is not None and subject.u.any() and not subject.moving
    if deformed or scene.plane is not None:
        ends = outline(subject.mesh)
        drawn.append(canvas.lines(axes, ends @ scene.rows[:2].T))
    values = None if subject.values is None else subject.values.numbers
    window = scene.window if scene.zoom is not None else None
    most *= 3 if scene.zoom is not None else 1  # many of them are not seen
    part = scene.part(subject)
    facets = facets_of(
        subject.mesh, scene.place(subject), values, scene.rows, scene.plane, most, window, inch / 72, part
    )
    colors = colored(facets, None if values is None else scene.colors)
    drawn.append(draw_facets(axes, scene.rows, facets, colors))
    if subject.marks is not None:
        drawn += draw_marks(axes, scene.rows, subject.marks, inch, facets=facets)
    for artist in drawn:
        artist.set_clip_on(scene.zoom is not None)
    return drawn, facets


# ---- the largest and the smallest value, in words and at their places --------------------------------------

SYMBOLS = (("▲", "^"), ("▼", "v"))
"""Of the largest and the smallest, in texts and in the picture."""
ROUNDING = 1e-12
"""Size of a value, beside the largest, up to which it is said as 0."""
LETTER = 0.07
"""Inches, width of a letter."""
PALE = 0.4
"""Strength of a mark whose place the body hides."""
BEHIND = 0.01
"""How far behind what is seen a place is hidden, of the size of the body."""


def extremes(subject: Subject) -> list[int]:
    """Return the rows of the largest and the smallest value; none of what has one value alone."""
    values = subject.values
    if values is None or values.names or not len(rows := subject.rows()):
        return []
    numbers = values.numbers[rows]
    return [int(rows[numbers.argmax()]), int(rows[numbers.argmin()])] if np.ptp(numbers) else []


def texts(subject: Subject, width: float) -> list[str]:
    """Return what is said of the extremes, with coordinates where a width in inches holds them."""
    mesh, values, long, brief = subject.mesh, subject.values, list[str](), list[str]()
    for row, (symbol, _) in zip(extremes(subject), SYMBOLS, strict=False):
        assert values is not None
        what, ids = ("node", mesh.node_ids) if subject.is_nodal else ("element", mesh.element_ids)
        value, largest = values.numbers[row], np.abs(values.numbers).max()
        number = canvas.number_text(value if abs(value) > ROUNDING * largest else 0.0, values.unit)
        X = _nodes(subject, mesh.points, row).mean(axis=0)
        where = f"{place_text(X)} {unit_name('m', mesh.units)}"
        long.append(f"{symbol} {number} {values.kind}".rstrip() + f" at {what} {ids[row]}, {where}")
        brief.append(f"{symbol} {number}, {what} {ids[row]}")
    return long if LETTER * max(map(len, long), default=0) < width else brief


def draw_extremes(axes: Any, scene: Scene, subject: Subject, facets: Facets) -> None:
    """Mark the extremes that no cut has taken away, pale where the body hides them."""
    for row, (_, marker) in zip(extremes(subject), SYMBOLS, strict=False):
        X = _nodes(subject, subject.mesh.points, row).mean(axis=0, keepdims=True)
        if scene.plane is None or scene.plane.distance(X)[0] <= 0:
            seen = _nodes(subject, scene.place(subject), row) @ scene.rows.T
            place = seen.mean(axis=0)[:2]
            behind = depth_at(facets, scene.rows, place) - seen[:, 2].max()
            strength = PALE if behind > BEHIND * np.ptp(subject.mesh.points, axis=0).max() else 1.0
            for drawn in dots(axes, place[None], marker, 8, "w", strength):
                drawn.set_clip_on(scene.zoom is not None)


def _nodes(subject: Subject, x: Array, row: int) -> Array:
    """Return the places (k, 3) of a node, or of the nodes of an element, among nodes at x (n, 3)."""
    if subject.is_nodal:
        return x[row : row + 1]
    blocks = with_rows(subject.mesh.blocks)
    return next(x[b.nodes[row - at.start]] for b, at in blocks if at.start <= row < at.stop)
