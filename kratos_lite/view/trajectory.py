"""Pictures of trajectories: positions of a body along its path, and curves against time beneath."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array
from kratos_lite.view.camera import View, rows_of
from kratos_lite.view.canvas import new_figure, new_figure_with_curves
from kratos_lite.view.facets import INK, MANY, colored, draw_facets, facets_of
from kratos_lite.view.rulers import rounded

FADED = 0.25
"""Strength of the colors of the first position; the last has 1."""
PATH = "#c8442b"


def trajectory_figure(
    mesh: Mesh,
    positions: Sequence[Array],
    centers: Array,
    times: Array,
    curves: Mapping[str, Array],
    *,
    view: View | None = None,
    title: str = "",
    unit: str = "J",
    size: tuple[float, float] = (8, 8),
) -> Any:
    """Return a figure of positions of a body in isometric view, later ones stronger, and of curves.

    The first and the last position have their times beneath them; a triad of axes shows directions and scale.
    The curves, against time, are beneath; one time alone has none.

    Parameters
    ----------
    mesh : the elements.
    positions : of the nodes, each (n, 3) in m, in the order of time.
    centers : (k, 3) m, path of the mass center.
    times : (k,) s.
    curves : (k,) numbers against time by name.
    view : where one looks from, as for `kratos_lite.plot`.
    title : above the picture.
    unit : of the curves.
    size : largest width and height in inches, at 150 dots per inch.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        There is nothing to draw.
    KratosLiteError
        matplotlib is missing.
    """
    if not mesh.boundary or not len(positions):
        raise InputError("there is nothing to draw: no position, or no element of a known shape")
    figure, axes, below = new_figure_with_curves(size) if len(times) > 1 else (*new_figure(size), None)
    everything = np.concatenate([*positions, centers])
    rows = rows_of("iso" if view is None else view, everything)
    for strength, x in zip(np.linspace(FADED, 1, len(positions)), positions, strict=True):
        _body(axes, mesh, rows, x, float(strength) if len(positions) > 1 else 1.0, MANY // len(positions))
    axes.plot(*(centers @ rows[:2].T).T, color=PATH, lw=1.2, zorder=3)
    axes.plot(*(centers[[0, -1]] @ rows[:2].T).T, ".", color=PATH, ms=6, zorder=3)
    corners = everything @ rows[:2].T
    axes.update_datalim(corners)
    _label_times(axes, rows, positions, times, 0.05 * float(np.ptp(corners, axis=0).max()))
    _triad(axes, rows, corners)
    axes.autoscale_view()
    axes.set_title(title, fontsize=11)
    if below is not None:
        _draw_curves(below, times, curves, unit)
    return figure


def _draw_curves(below: Any, times: Array, curves: Mapping[str, Array], unit: str) -> None:
    """Draw curves against time; a sum is dashed, as it may lie on one of its parts."""
    for name, values in curves.items():
        style = {"ls": (0, (4, 3)), "color": "0.15", "lw": 1.2} if name == "sum" else {"lw": 1.8}
        below.plot(times, values, label=name, **style)
    below.set_xlabel("time in s")
    below.set_ylabel(unit)
    if curves:
        below.legend(fontsize=9, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _label_times(axes: Any, rows: Array, positions: Sequence[Array], times: Array, near: float) -> None:
    """Write the times of the first and the last position beneath them; as one text if these are one."""
    ends = [x @ rows[:2].T for x in (positions[0], positions[-1])]
    feet, texts = [x[x[:, 1].argmin()] for x in ends], [f"{times[i]:.3g} s" for i in (0, -1)]
    if np.abs(ends[0] - ends[1]).max() < near:
        feet, texts = feet[1:], [" and ".join(dict.fromkeys(texts))]
    box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0}
    for foot, text in zip(feet, texts, strict=True):
        axes.annotate(
            text, foot, (0, -4), textcoords="offset points", ha="center", va="top", size=9, bbox=box, zorder=4
        )


def _triad(axes: Any, rows: Array, drawn: Array) -> None:
    """Draw the three axes, of one length that is written to them, left of and below what is drawn."""
    (left, low), extent = drawn.min(axis=0), float(np.ptp(drawn, axis=0).max())
    length = rounded(0.2 * extent)
    start = np.array([left - 1.1 * length, low + 0.41 * length])
    for name, along in zip("xyz", rows[:2].T, strict=True):
        axes.plot(*np.array([start, start + length * along]).T, color="0.35", lw=1.0, zorder=3)
        axes.text(*(start + 1.18 * length * along), name, ha="center", va="center", size=9, color="0.25")
    axes.text(*(start - (0, 0.5 * length)), f"{length:g} m", ha="center", va="top", size=9, color="0.25")


def _body(axes: Any, mesh: Mesh, rows: Array, x: Array, strength: float, most: int) -> None:
    """Draw one position over those before it, its colors mixed with white."""
    facets = facets_of(mesh, x, None, rows, most=most)
    draw_facets(axes, rows, facets, colored(facets, strength=strength), (*INK[:3], INK[3] * strength))
