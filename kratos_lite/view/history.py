"""Pictures of an adaptive solution: reported error against unknowns, mesh by mesh."""

from __future__ import annotations

from typing import Any

from kratos_lite.typing import Array
from kratos_lite.view.canvas import label, new_log_plot

LINE, GOAL = "#2b6ca8", "#c8442b"


def history_figure(
    unknowns: Array,
    errors: Array,
    *,
    goal: float | None = None,
    of: str = "",
    title: str = "",
    size: tuple[float, float] = (6, 4),
) -> Any:
    """Return a figure of errors in percent against unknowns, both logarithmic, with the error asked for.

    Parameters
    ----------
    unknowns, errors : (k,) of each mesh; errors relative.
    goal : the error asked for, relative; drawn as a line across.
    of : what has the error.
    title : above the picture.
    size : width and height in inches, at 150 dots per inch.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    KratosLiteError
        matplotlib is missing.
    """
    figure, axes = new_log_plot(size)
    shown = errors > 0
    axes.plot(unknowns[shown], 100 * errors[shown], "o-", color=LINE, lw=1.8, ms=5, label="reported")
    if goal is not None:
        axes.axhline(100 * goal, color=GOAL, lw=1.2, ls=(0, (4, 3)), label="asked for", zorder=1)
    for number, (x, y) in enumerate(zip(unknowns[shown], 100 * errors[shown], strict=True), 1):
        axes.annotate(str(number), (x, y), (4, 4), textcoords="offset points", size=8, color="0.35")
    label(axes, "unknowns", f"error of {of} in %" if of else "error in %", title)
    return figure
