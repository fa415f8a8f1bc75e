"""Compiled steps of rigid and pseudo-rigid bodies, one or many, and what both kinds of them share."""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite import native
from kratos_lite.errors import SolveError
from kratos_lite.typing import Array


def compiled(name: str, *arguments: Any) -> Any:
    """Return what a compiled function returns, NotImplemented without it or where arrays do not fit."""
    motion = native.kernels("motion")
    if motion is None:
        return NotImplemented
    try:
        return getattr(motion, name)(*arguments)
    except TypeError:  # how the bindings refuse arrays that are not C-contiguous float64: NumPy takes those
        return NotImplemented


def failure(name: str, q: Array, body: int, h: float, why: str, step: int | None = None) -> SolveError:
    """Return the error of a body, counted through all leading axes, whose step failed."""
    place = tuple(int(i) for i in np.unravel_index(body, q.shape[:-1]))
    whose = f" of body {place[0] if len(place) == 1 else place}" if place else ""
    when = "" if step is None else f" number {step + 1}"
    return SolveError(f"{name}: step{when}{whose}, h = {h:g} s, failed: {why}; use a shorter step")


NO_NEWTON = "Newton's method found no velocity at its end"
TOO_FAST = "its velocity grew beyond all numbers"
