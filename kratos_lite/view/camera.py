"""Camera: where one looks from, and how points in space lie in the picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.errors import InputError, nearest
from kratos_lite.typing import Array
from kratos_lite.validation import finite, short

View: TypeAlias = "str | Sequence[float]"
"""A name of `VIEWS`, azimuth and elevation in degrees, or the direction towards the viewer."""
OBLIQUE: Array = np.array([[0.90, 0.43, 0], [-0.13, 0.27, 0.954], [0.41, -0.86, 0.30]])
"""No two corners of a cube fall on one another."""
VIEWS: dict[str, Sequence[float]] = {
    "iso": (1, -1, 1),
    **{f"{'xyz'[i]}{sign}": np.eye(3)[i] * float(f"{sign}1") for i in range(3) for sign in "-+"},
}
"""Directions towards the viewer: ``x+`` looks at the side x+ of a box."""
SLENDER = 3.0
"""Length over width of a body from which one looks at it more and more from the side."""


def rows_of(view: View | None, X: Array) -> Array:
    """Return right, up and towards the viewer as rows (3, 3); without a view, one for points (n, 3) m."""
    if view is None:
        return _rows(_side_of(np.ptp(X, axis=0)))
    if isinstance(view, str):
        if view not in VIEWS:
            raise InputError(
                f"view must be one of {', '.join(VIEWS)}, angles or a direction; got {view!r}."
                f"{nearest(view, list(VIEWS), 1)}"
            )
        return _rows(np.asarray(VIEWS[view], dtype=float))
    numbers = finite(view, "a view")
    if numbers.shape == (2,):
        azimuth, elevation = np.radians(numbers)
        if not abs(elevation) <= np.pi / 2:
            raise InputError(f"the elevation of a view lies from -90 to 90 degrees; got {short(view)}")
        flat = np.array([np.cos(azimuth), np.sin(azimuth)])
        return _rows(np.append(np.cos(elevation) * flat, np.sin(elevation)), flat)
    if numbers.shape != (3,) or not numbers.any():
        raise InputError(
            f"a view is one of {', '.join(VIEWS)}, (azimuth, elevation) in degrees or a direction (x, y, z) "
            f"towards the viewer; got {short(view)}"
        )
    return _rows(numbers)


def _rows(towards: Array, flat: Array | None = None) -> Array:
    """Return the rows of a direction towards the viewer; z is up, seen along z it is y or `flat`."""
    towards = towards / np.linalg.norm(towards)
    up = np.array([0.0, 0.0, 1.0])
    if np.hypot(*towards[:2]) < 1e-6:
        up = np.array([0.0, 1.0, 0.0]) if flat is None else -np.sign(towards[2]) * np.append(flat, 0.0)
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(towards, right), towards]) + 0.0


def _side_of(sides: Array) -> Array:
    """Return the direction from which a body of these side lengths is well seen."""
    # It is isometric, but a long and thin body along x or y is seen more from its side, so that it lies
    # across the picture.
    x, y, z = sides
    across = max(min(x, y), z)
    slenderness = max(x, y) / across if across > 0 else np.inf
    fraction = min(1.0, SLENDER / slenderness)
    off, elevation = np.pi / 4 * fraction, np.arctan(1 / np.sqrt(2)) * (0.4 + 0.6 * fraction)
    azimuth = off - np.pi / 2 if x >= y else -off
    flat = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
    return np.append(flat, np.sin(elevation))


def box_corners(low: Array, high: Array) -> Array:
    """Return the corners (8, 3) of a box, x slowest."""
    return np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )


def window_of(points: Any) -> tuple[Array, Array]:
    """Return lower left and upper right of points (n, 2), never without area."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(float((high - low).max()), 1e-12 * float(np.abs(points).max()), 1e-300)
    thin = np.maximum(0.004 * size - (high - low), 0.0) / 2
    return low - thin - 0.002 * size, high + thin + 0.002 * size
