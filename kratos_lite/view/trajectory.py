"""Pictures of trajectories: positions of a body along its path, and curves against time beneath."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array
from kratos_lite.view import canvas
from kratos_lite.view.camera import View, rows_of, window_of
from kratos_lite.view.facets import MANY, colored, draw_facets, facets_of
from kratos_lite.view.figure import fitted
from kratos_lite.view.marks import Marks, draw_marks
from kratos_lite.view.rulers import draw_triad

FADED = 0.25
"""Strength of the colors of the first position; the last has 1."""
PATH = "#c8442b"
CURVES = (4.0, 1.3)
"""Least width, and height, of the curves in inches."""


@dataclass(frozen=True, eq=False)
class Path:
    """A body along its path."""

    mesh: Mesh  # the elements
    positions: Sequence[Array]  # of the nodes, each (n, 3) in m, in the order of time
    marks: Sequence[Marks]  # what holds the body in each position
    centers: Array  # (k, 3) m, path of the mass center
    times: Array  # (k,) s
    curves: Mapping[str, Array]  # (k,) energies in J by name


def trajectory_figure(path: Path, view: View | None, title: str, size: tuple[float, float]) -> Any:
    """Return a figure of positions of a body, later ones stronger, and of its curves against time."""
    if not path.mesh.boundary or not len(path.positions):
        raise InputError("there is nothing to draw: no position, or no element of a known shape")
    everything = np.concatenate([*path.positions, path.centers, *(marks.points() for marks in path.marks)])
    rows = rows_of("iso" if view is None else view, everything)
    window = window_of(everything @ rows[:2].T)
    figure, (axes,), inch = fitted(
        window[1] - window[0], np.ones(2), size, lambda inch: _laid_out(path, rows, window, inch, title)
    )
    strengths = np.linspace(1, FADED, len(path.positions))[::-1].tolist()
    for strength, x, marks in zip(strengths, path.positions, path.marks, strict=True):
        facets = facets_of(path.mesh, x, None, rows, most=MANY // len(path.positions), point=inch / 72)
        draw_facets(axes, rows, facets, colored(facets, strength=strength), strength).set_clip_on(False)
        draw_marks(axes, rows, marks, inch, strength)
    axes.plot(*(path.centers @ rows[:2].T).T, color=PATH, lw=1.2, zorder=3)
    axes.plot(*(path.centers[[0, -1]] @ rows[:2].T).T, ".", color=PATH, ms=6, zorder=3)
    return figure


def _laid_out(
    path: Path, rows: Array, window: tuple[Array, Array], inch: float, title: str
) -> tuple[Any, list[Any]]:
    """Return the figure with all but the body; `inch` is that many m in the picture."""
    figure = canvas.empty((1, 1), layout=None)  # until all is there
    size = (window[1] - window[0]) / inch
    axes = canvas.without_frame(canvas.axes_in_inches(figure, (0, 0), size))
    axes.set(xlim=(window[0][0], window[1][0]), ylim=(window[0][1], window[1][1]))
    axes.set_title(title, fontsize=11, pad=8)
    _label_times(axes, rows, path, 0.05 * float((window[1] - window[0]).max()))
    draw_triad(axes, rows, window, inch, 0.2)
    if len(path.times) > 1 and path.curves:
        (_, low), _ = canvas.bounds(figure)
        width = max(size[0], CURVES[0])
        place = ((size[0] - width) / 2, low - CURVES[1] - 0.15)
        below = canvas.axes_for_curves(figure, place, (width, CURVES[1]))
        _draw_curves(below, path.times, path.curves)
    canvas.fit(figure)
    return figure, [axes]


def _draw_curves(below: Any, times: Array, curves: Mapping[str, Array]) -> None:
    """Draw curves against time; a sum is dashed, as it may lie on one of its parts."""
    for name, values in curves.items():
        style = {"ls": (0, (4, 3)), "color": "0.15", "lw": 1.2} if name == "sum" else {"lw": 1.8}
        below.plot(times, values, label=name, **style)
    below.set_xlabel("time in s")
    below.set_ylabel("energy in J")
    below.legend(fontsize=9, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _label_times(axes: Any, rows: Array, path: Path, near: float) -> None:
    """Write the times of the first and the last position beneath them; as one text if these are one."""
    ends = [x @ rows[:2].T for x in (path.positions[0], path.positions[-1])]
    feet, texts = [x[x[:, 1].argmin()] for x in ends], [f"{path.times[i]:.3g} s" for i in (0, -1)]
    if np.abs(ends[0] - ends[1]).max() < near:
        feet, texts = feet[1:], [" and ".join(dict.fromkeys(texts))]
    style = {"textcoords": "offset points", "ha": "center", "va": "top", "size": 9, "zorder": 6}
    box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0}
    for foot, text in zip(feet, texts, strict=True):
        axes.annotate(text, foot, (0, -4), bbox=box, annotation_clip=False, **style)
