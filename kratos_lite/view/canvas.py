"""Canvas: all that needs matplotlib; figures without a screen, polygons, lines and color bars."""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.errors import KratosLiteError
from kratos_lite.typing import Array


def _canvas() -> Any:
    """Return the canvas class that draws without a screen."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
    except ImportError as error:
        raise KratosLiteError("pictures need matplotlib: pip install kratos-lite[view]") from error
    return FigureCanvasAgg


def _empty(size: tuple[float, float]) -> Any:
    """Return a figure that needs no screen."""
    canvas = _canvas()
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, dpi=150, layout="constrained")
    canvas(figure)
    return figure


def _without_frame(axes: Any) -> Any:
    axes.set_aspect("equal")
    axes.axis("off")
    return axes


def new_figure(size: tuple[float, float]) -> tuple[Any, Any]:
    """Return a figure that needs no screen, and axes without frame in which a metre is a metre."""
    figure = _empty(size)
    return figure, _without_frame(figure.add_subplot())


def new_figure_with_curves(size: tuple[float, float]) -> tuple[Any, Any, Any]:
    """Return a figure with axes as those of `new_figure`, and beneath them axes for curves."""
    figure = _empty(size)
    upper, lower = figure.subplots(2, 1, height_ratios=[3, 1])
    lower.spines[["top", "right"]].set_visible(False)
    lower.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4), useMathText=True)
    return figure, _without_frame(upper), lower


def new_log_plot(size: tuple[float, float]) -> tuple[Any, Any]:
    """Return a figure with axes for curves alone, both logarithmic."""
    figure = _empty(size)
    from matplotlib.ticker import LogLocator

    axes = figure.add_subplot(xscale="log", yscale="log")
    axes.spines[["top", "right"]].set_visible(False)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(lambda value, _: f"{value:g}")
        axis.set_minor_formatter(lambda value, _: "")
    return figure, axes


def file_types() -> list[str]:
    """Return the endings of files that a figure can be saved as, without the dot."""
    return sorted(_canvas().get_supported_filetypes())


def colors_of(value: Array) -> tuple[Any, Array]:
    """Return the scale of the color bar and the color of each value."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    low, high = (float(value.min()), float(value.max())) if len(value) else (0.0, 1.0)
    if high - low <= 1e-6 * max(abs(low), abs(high)):  # a constant is shown in the middle of the scale
        half = 0.5 * max(abs(low), abs(high)) or 1.0
        low, high = low - half, high + half
    shown = ScalarMappable(Normalize(low, high), colormaps["viridis"])
    return shown, shown.to_rgba(value)


def color_bar(figure: Any, axes: Any, colors: Any, unit: str) -> None:
    """Draw the color bar with one prefix for all its numbers."""
    from matplotlib.ticker import EngFormatter, FuncFormatter

    power = int(np.clip(3 * np.floor(np.log10(max(map(abs, colors.get_clim()))) / 3), -24, 24))
    shown = FuncFormatter(lambda value, _: f"{value / 10.0**power:g}")
    bar = figure.colorbar(colors, ax=axes, shrink=0.7, pad=0.03, aspect=25, format=shown)
    prefix = EngFormatter.ENG_PREFIXES[power]
    bar.set_label(prefix + unit if unit else f"× 1e{power}" if power else "")
    bar.outline.set_visible(False)


def polygons(axes: Any, corners: Array, colors: Array, widths: Array) -> None:
    """Draw flat polygons (m, k, 2) in their order, each edged in its own color (m, 4)."""
    from matplotlib.collections import PolyCollection

    flat: Any = corners
    axes.add_collection(
        PolyCollection(flat, facecolors=colors, edgecolors=colors, linewidths=widths, zorder=2)
    )


def lines(axes: Any, ends: Array, color: str = "0.55", width: float = 0.8) -> None:
    """Draw thin lines (m, 2, 2) behind everything else."""
    from matplotlib.collections import LineCollection

    pieces: Any = ends
    axes.add_collection(LineCollection(pieces, colors=color, linewidths=width, zorder=1))
