"""Canvas: all that needs matplotlib; figures without a screen, polygons, lines and color bars."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.atomic import replacing
from kratos_lite.errors import InputError, KratosLiteError, installing
from kratos_lite.registry import remembered
from kratos_lite.typing import Array
from kratos_lite.validation import finite, path_of, short

DPI = 150
"""Dots per inch."""
LARGEST = 100
"""Width and height of a figure in inches."""
LINE = 13
"""Points from line to line beneath a title."""
PALETTE = ("#9eb8d6", "#e0b56a", "#8fbf9a", "#d59a9a", "#b8a3d1", "#c9c9c9", "#7fb8bf", "#c7c06b")
"""Colors of materials, one after the other."""
PREFIXED = ("m", "Pa", "N", "J", "J/m³", "m/s", "m/s²", "N m", "Hz")
"""Units that take prefixes, such as MPa; numbers in others stay with a power of ten."""


def _canvas() -> Any:
    """Return the canvas class that draws without a screen."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
    except ImportError as error:
        raise KratosLiteError(f"pictures need matplotlib: {installing('view')}") from error
    return FigureCanvasAgg


@remembered
def _figure_class() -> Any:
    """Return a class of figures that a notebook shows, also where nobody has imported pyplot."""
    from matplotlib.figure import Figure

    class Picture(Figure):
        """A figure that needs no screen."""

        def _repr_png_(self) -> bytes:
            file = BytesIO()
            self.savefig(file, format="png")
            return file.getvalue()

    return Picture


def empty(size: tuple[float, float], layout: str | None = "constrained") -> Any:
    """Return a figure without axes; its size in inches."""
    canvas = _canvas()
    figure = _figure_class()(figsize=size, dpi=DPI, layout=layout)
    canvas(figure)
    return figure


def without_frame(axes: Any) -> Any:
    """Return axes, now without ticks, in which a metre to the right is one upwards."""
    axes.set_aspect("equal")
    axes.axis("off")
    for axis in (axes.xaxis, axes.yaxis):  # else the place of a title takes the sizes of ticks that are off
        axis.set_visible(False)
    return axes


def axes_for_curves(figure: Any, place: Any, size: Any) -> Any:
    """Return new axes for curves, with their lower left corner and size in inches."""
    axes = axes_in_inches(figure, place, size)
    axes.spines[["top", "right"]].set_visible(False)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4), useMathText=True)
    return axes


def new_plot(size: tuple[float, float], *units: str, log: str = "") -> tuple[Any, Any]:
    """Return a figure with axes for curves alone, numbers with prefixes of their units, if any.

    `log` names the axes with a logarithmic scale, such as ``"xy"``.
    """
    figure = empty(size)
    from matplotlib.ticker import EngFormatter

    scales = ["log" if name in log else "linear" for name in "xy"]
    axes = figure.add_subplot(xscale=scales[0], yscale=scales[1])
    axes.spines[["top", "right"]].set_visible(False)
    for axis, unit, scale in zip((axes.xaxis, axes.yaxis), units, scales, strict=True):
        axis.set_major_formatter(EngFormatter(unit) if unit in PREFIXED else f"{{x:g}} {unit}".rstrip())
        if scale == "log":
            axis.set_minor_formatter("")
    return figure, axes


FEW_POWERS = 1e3
"""Largest to smallest number of a logarithmic axis up to which numbers stand between powers of ten."""


def label(axes: Any, x: str, y: str, title: str) -> None:
    """Write what axes for curves show, over a grid; a legend where there are several curves."""
    from matplotlib.ticker import LogLocator

    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            low, high = axis.get_view_interval()
            axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < FEW_POWERS * low else (1,)))
    axes.grid(True, color="0.92", lw=0.8)
    axes.set_axisbelow(True)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if len(axes.lines) > 1:
        axes.legend(fontsize=9, frameon=False)
    axes.set_title(title, fontsize=11)


def axes_in_inches(figure: Any, place: Any, size: Any) -> Any:
    """Return new axes with their lower left corner and size in inches."""
    width, height = figure.get_size_inches()
    return figure.add_axes((place[0] / width, place[1] / height, size[0] / width, size[1] / height))


def move(axes: Any, place: Any) -> None:
    """Move axes with their lower left corner to a place in inches."""
    box, (width, height) = axes.get_position(original=True), axes.figure.get_size_inches()
    axes.set_position((place[0] / width, place[1] / height, box.width, box.height))


def right_of(axes: Any) -> float:
    """Return how far axes and their texts reach to the right of their left side, in inches."""
    reach = axes.get_tightbbox(axes.figure.canvas.get_renderer()).x1 - axes.get_window_extent().x0
    return float(reach) / DPI


def entitle(axes: Any, title: str, lines: Sequence[str], rise: float = 0.0) -> None:
    """Write a title above axes and what rises so many inches above them, and small lines beneath it."""
    axes.set_title(title, fontsize=11, pad=8 + 72 * rise + LINE * len(lines))
    if lines:
        style = {"xycoords": "axes fraction", "textcoords": "offset points", "size": 9, "color": "0.25"}
        axes.annotate("\n".join(lines), (0.5, 1), (0, 6 + 72 * rise), ha="center", va="bottom", **style)


def title_widths(panels: list[Any]) -> list[float]:
    """Return the widths of the titles of axes, and of the lines beneath them, in inches."""
    texts = [text for axes in panels for text in (axes.title, *axes.texts)]
    return [float(text.get_window_extent().width) / DPI for text in texts]


def bounds(figure: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return lower left and upper right in inches of all that a figure shows."""
    box = figure.get_tightbbox(figure.canvas.get_renderer())
    return (box.x0, box.y0), (box.x1, box.y1)


def fit(figure: Any, margin: float = 0.1) -> None:
    """Make a figure as large as what it shows."""
    (x0, y0), (x1, y1) = bounds(figure)
    old, corner = figure.get_size_inches(), np.array([x0 - margin, y0 - margin])
    new = np.ceil((np.array([x1 + margin, y1 + margin]) - corner) * DPI) / DPI
    for axes in figure.axes:
        box = axes.get_position(original=True)
        place, size = np.array(box.p0) * old - corner, np.array(box.size) * old
        axes.set_position([*(place / new), *(size / new)])
    for text in figure.texts:
        text.set_position(np.array(text.get_position()) - corner)
    figure.set_size_inches(new)


def pixels(figure: Any) -> Any:
    """Return a figure as an array (height, width, 3) uint8, a copy."""
    figure.canvas.draw()
    return np.array(figure.canvas.buffer_rgba())[..., :3]


def checked_size(size: Any) -> tuple[float, float] | None:
    """Return the width and height in inches that were given, if any."""
    if size is None:
        return None
    width, height = finite(size, "size, width and height in inches,", (2,)).tolist()
    if not (0 < width <= LARGEST and 0 < height <= LARGEST):
        raise InputError(f"size: width and height are > 0 and up to {LARGEST} inches; got {short(size)}")
    return width, height


# ---- files -----------------------------------------------------------------------------------------


def file_types() -> list[str]:
    """Return the endings of files that a figure can be saved as, without the dot."""
    return sorted(_canvas().get_supported_filetypes())


def check_picture(path: str | Path) -> str:
    """Return the type of a picture; raise, before any work is done, for one that cannot be written."""
    kind, known = path_of(path).suffix[1:].lower(), file_types()
    if not kind:
        raise InputError(f"{path}: give the picture an ending that says its format, such as .png")
    if kind not in known:
        raise InputError(f"{path}: pictures cannot be written as .{kind}; known are {' '.join(known)}")
    return kind


def saved(figure: Any, path: str | Path | None) -> Any:
    """Return a figure, which is written if there is a path, as a whole or not at all."""
    if path is not None:
        kind = check_picture(path)
        with replacing(path) as temporary:
            figure.savefig(temporary, format=kind)
    return figure


# ---- colors ----------------------------------------------------------------------------------------


def color_scale(low: float, high: float, *, log: bool = False) -> Any:
    """Return what gives numbers from low to high their colors; a constant is in the middle."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize

    if high - low <= 1e-6 * max(abs(low), abs(high)):
        half = 0.5 * max(abs(low), abs(high)) or 1.0
        low, high = (low / 2, 2 * high) if log else (low - half, high + half)
    norm = LogNorm(low, high, clip=True) if log else Normalize(low, high)
    return ScalarMappable(norm, colormaps["viridis"])


def color_bar(axes: Any, colors: Any, unit: str, extend: str, *, upright: bool) -> None:
    """Fill axes with the color bar: one prefix for all numbers, and pointed where values lie beyond."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import EngFormatter, FuncFormatter, LogLocator

    low, high = colors.get_clim()
    power = _power(max(abs(low), abs(high)))
    power = 0 if power == -3 and unit not in PREFIXED else power
    shown = FuncFormatter(lambda value, _: f"{round(value / 10.0**power, 9) + 0.0:g}")
    way = "vertical" if upright else "horizontal"
    bar = axes.figure.colorbar(colors, cax=axes, orientation=way, format=shown, extend=extend)
    if isinstance(colors.norm, LogNorm):
        bar.set_ticks(LogLocator(subs=(1, 2, 5)))
        bar.minorticks_off()
    bar.ax.tick_params(labelsize=9)
    if power and unit not in PREFIXED:
        bar.set_label(f"× 1e{power} {unit}".rstrip())
    else:
        bar.set_label(EngFormatter.ENG_PREFIXES[power] + unit)
    bar.outline.set_visible(False)


def number_text(value: float, unit: str) -> str:
    """Return a number to four digits with its unit, which has a prefix if it takes one."""
    from matplotlib.ticker import EngFormatter

    power = _power(value) if unit in PREFIXED else 0
    return f"{value / 10.0**power:.4g} {EngFormatter.ENG_PREFIXES[power]}{unit}".rstrip()


def _power(size: float) -> int:
    """Return the power of ten of the prefix for numbers up to a size."""
    return int(np.clip(3 * np.floor(np.log10(abs(size)) / 3), -24, 24)) if size else 0


def categories(count: int) -> Any:
    """Return what gives 0 … count - 1 their colors."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    some = [PALETTE[i % len(PALETTE)] for i in range(count)]
    return ScalarMappable(Normalize(-0.5, count - 0.5), ListedColormap(some))


def legend(axes: Any, entries: Sequence[tuple[str, Any, str]]) -> None:
    """Fill axes with a legend of markers, colors and texts that hangs down from their upper left corner."""
    from matplotlib.lines import Line2D

    lines = [Line2D([], [], ls="", marker=marker, color=color, label=text) for marker, color, text in entries]
    style: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0, 1), "borderaxespad": 0.0}
    without_frame(axes).legend(handles=lines, frameon=False, fontsize=8, handletextpad=0.2, **style)


# ---- what is drawn ---------------------------------------------------------------------------------


def shaded(color: str, light: Array) -> Array:
    """Return a color under light (m,), (m, 4)."""
    from matplotlib.colors import to_rgb

    return np.column_stack([light[:, None] * to_rgb(color), np.ones(len(light))])


def polygons(axes: Any, corners: Array, colors: Array, widths: Any = 0.45, zorder: float = 2) -> Any:
    """Draw flat polygons (m, k, 2) in their order, each edged in its own color (m, 4)."""
    from matplotlib.collections import PolyCollection

    flat: Any = corners
    style: Any = {"facecolors": colors, "edgecolors": colors, "zorder": zorder}
    drawn = axes.add_collection(PolyCollection(flat, **style), autolim=False)
    drawn.set_linewidth(widths)  # once: where it is made, matplotlib takes widths and dashes one by one twice
    return drawn


def lines(axes: Any, ends: Array) -> Any:
    """Draw thin lines (m, 2, 2) behind everything else."""
    from matplotlib.collections import LineCollection

    pieces: Any = ends
    return axes.add_collection(LineCollection(pieces, colors="0.55", linewidths=0.8, zorder=1), autolim=False)
