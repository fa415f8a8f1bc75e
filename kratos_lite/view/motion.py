"""Pictures of motions: positions of a body along its path, and curves against time beneath."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.mesh import Floats, Mesh
from kratos_lite.view.canvas import new_figure_with_curves, save_figure
from kratos_lite.view.surface import ISOMETRIC, PLAIN, draw, fineness, visible

FADED = 0.25
"""Strength of the colours of the first position; the last has 1."""
PATH = "#c8442b"


def motion_picture(
    path: str | Path,
    mesh: Mesh,
    positions: Sequence[Floats],
    centers: Floats,
    times: Floats,
    curves: Mapping[str, Floats],
    *,
    title: str = "",
    unit: str = "J",
    size: tuple[float, float] = (8, 8),
) -> None:
    """Draw positions of a body in one isometric view, later ones stronger, and curves against time.

    Parameters
    ----------
    path : picture to write; .png, .pdf or .svg.
    mesh : the elements.
    positions : of the nodes, each (n, 3) in m, in the order of time.
    centers : (k, 3) m, path of the mass centre.
    times : (k,) s.
    curves : (k,) numbers against time by name.
    title : above the picture.
    unit : of the curves.
    size : largest width and height in inches, at 150 dots per inch.

    Raises
    ------
    InputError
        There is nothing to draw, or the file cannot be written.
    KratosLiteError
        matplotlib is missing.
    """
    if not mesh.boundary or not len(positions):
        raise InputError("there is nothing to draw: no position, or no element of a known shape")
    figure, axes, below = new_figure_with_curves(size)
    n, edged = fineness(len(positions) * sum(map(len, mesh.boundary)))
    for strength, x in zip(np.linspace(FADED, 1, len(positions)), positions, strict=True):
        _body(axes, mesh, x, float(strength) if len(positions) > 1 else 1.0, n, edged)
    axes.plot(*(centers @ ISOMETRIC[:2].T).T, color=PATH, lw=1.2, zorder=3)
    axes.plot(*(centers[[0, -1]] @ ISOMETRIC[:2].T).T, ".", color=PATH, ms=6, zorder=3)
    axes.autoscale_view()
    axes.set_title(title, fontsize=11)
    for name, values in curves.items():
        below.plot(times, values, lw=1.4, label=name)
    below.set_xlabel("time in s")
    below.set_ylabel(unit)
    if curves:
        below.legend(fontsize=9, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    save_figure(path, figure)


def _body(axes: Any, mesh: Mesh, x: Floats, strength: float, n: int, edged: bool) -> None:
    """Draw one position over those before it, its colours mixed with white."""
    drawn = [visible(block, x, np.zeros(len(x)), n) for block in mesh.boundary]
    P, light, _, E = (np.concatenate(arrays) for arrays in zip(*drawn, strict=True))
    colours = np.ones((len(P), 4))
    colours[:, :3] -= strength * (1 - np.array(PLAIN) * light[:, None])
    ink = np.array([0.1, 0.1, 0.15, 0.55 * strength])
    draw(axes, P, colours, E if edged else E[:0], ink)
