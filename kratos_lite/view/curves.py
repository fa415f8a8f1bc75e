"""Curves: numbers along a line, and the errors of an adaptive solution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from kratos_lite.typing import Array
from kratos_lite.view.canvas import label, new_plot

BLUE, RED = "#2b6ca8", "#c8442b"
STYLES = (("-", BLUE, 1.8), ((0, (5, 3)), RED, 1.4), ((0, (1, 2)), "0.35", 1.6))
"""Dashes, color and width of one curve after the other."""


def line_figure(
    x: Array, curves: Mapping[str, Array], units: Sequence[str], title: str, size: tuple[float, float]
) -> Any:
    """Return a figure of up to three curves (k,) by their labels, against a distance x (k,)."""
    figure, axes = new_plot(size, *units)
    for (name, values), (dashes, color, width) in zip(curves.items(), STYLES, strict=False):
        axes.plot(x, values, ls=dashes, color=color, lw=width, label=name)
    axes.margins(x=0)
    axes.locator_params("x", nbins=5)  # numbers with units need place
    label(axes, "distance along the line", next(iter(curves)), title)
    return figure


def study_figure(
    x: Array,
    values: Array,
    ends: tuple[float, float, float],
    unit: str,
    labels: tuple[str, str],
    size: tuple[float, float],
) -> Any:
    """Return a figure of values (k,) against unknowns (k,), of their limit and the ends of its band.

    The labels are those of the limit and of the values.
    """
    figure, axes = new_plot(size, "", unit, log="x")
    axes.plot(x, values, "o-", color=BLUE, lw=1.8, ms=5, label="values")
    axes.axhline(ends[0], color=RED, lw=1.2, ls=(0, (4, 3)), label=labels[0], zorder=1)
    axes.axhspan(*ends[1:], color=RED, alpha=0.1, lw=0, zorder=0)
    label(axes, "unknowns", labels[1], "")
    return figure


def response_figure(frequencies: Array, amplitudes: Array, unit: str, of: str) -> Any:
    """Return a figure of amplitudes (f,), in a unit, against frequencies (f,) in rad/s."""
    figure, axes = new_plot((6, 4), "", unit, log="xy")
    axes.plot(frequencies, amplitudes, color=BLUE, lw=1.8)
    label(axes, "frequency in rad/s", of, "")
    return figure


def convergence_figure(
    unknowns: Array, errors: Array, goal: float | None, of: str, title: str, size: tuple[float, float]
) -> Any:
    """Return a figure of relative errors (k,) of a quantity against unknowns (k,), and of its goal."""
    figure, axes = new_plot(size, "", "", log="xy")
    unknowns, percent = unknowns[errors > 0], 100 * errors[errors > 0]
    axes.plot(unknowns, percent, "o-", color=BLUE, lw=1.8, ms=5, label="reported")
    if goal is not None:
        axes.axhline(100 * goal, color=RED, lw=1.2, ls=(0, (4, 3)), label="requested", zorder=1)
    for number, point in enumerate(zip(unknowns, percent, strict=True), 1):
        axes.annotate(str(number), point, (4, 4), textcoords="offset points", size=8, color="0.35")
    label(axes, "unknowns", f"error of {of} in %" if of else "error in %", title)
    return figure
