"""Curves: numbers against a length, in one picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kratos_lite.typing import Array
from kratos_lite.view.canvas import label, new_plot

STYLES = (("-", "#2b6ca8", 1.8), ((0, (5, 3)), "#c8442b", 1.4), ((0, (1, 2)), "0.35", 1.6))
"""Dashes, color and width of one curve after the other."""


def curves_figure(
    x: Array, curves: Mapping[str, Array], *, unit: str, title: str = "", size: tuple[float, float] = (6, 4)
) -> Any:
    """Return a figure of up to three curves (k,) by their labels, against a distance x (k,) in m.

    Parameters
    ----------
    x, curves : what is drawn; the first label is that of the axis, too.
    unit : of the curves.
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
    figure, axes = new_plot(size, "m", unit)
    for (name, values), (dashes, color, width) in zip(curves.items(), STYLES, strict=False):
        axes.plot(x, values, ls=dashes, color=color, lw=width, label=name)
    axes.margins(x=0)
    label(axes, "distance along the line", next(iter(curves)), title)
    return figure
