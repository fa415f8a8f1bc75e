"""Pictures of reference cells with node numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.shapes import Shape
from kratos_lite.typing import Array
from kratos_lite.validation import finite
from kratos_lite.view import canvas
from kratos_lite.view.camera import OBLIQUE


def element_figure(shape: type[Shape], points: ArrayLike | None = None) -> Any:
    """Return a figure of a reference cell with its node numbers (from 0), and Gauss points (g, d)."""
    figure = canvas.empty((5, 5))
    axes = canvas.without_frame(figure.add_subplot())
    d = shape.nodes.shape[1]
    view = OBLIQUE if d == 3 else np.eye(3)

    def flat(x: Array) -> Array:
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
        G = finite(points, f"points in a {shape.__name__}", ("g", d))
        axes.plot(*flat(G).T, "x", color="#c8442b", ms=8, mew=2, zorder=2)
    _triad(axes, X, flat(np.eye(d)))
    axes.set_title(shape.__name__, fontsize=11)
    axes.autoscale_view()
    return figure


def _triad(axes: Any, X: Array, directions: Array) -> None:
    """Draw the reference axes below and to the left of a cell."""
    length = 0.2 * np.ptp(X, axis=0).max()
    low = X.min(axis=0) - 1.2 * length
    for axis, name in zip(directions, "ξηζ", strict=False):
        arrow = {"arrowstyle": "-|>", "color": "0.3", "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", low + length * axis, low, arrowprops=arrow, annotation_clip=False)
        axes.text(*(low + 1.25 * length * axis), name, ha="center", va="center", style="italic", color="0.3")


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
