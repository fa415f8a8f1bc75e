"""Arguments of element methods: converted to floats, or refused with one error that says what is expected."""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.typing import Array
from kratos_lite.validation import finite, reals


def real(value: Any, what: str, tail: tuple[int, ...], cure: str = "", *, error: Any = InputError) -> Array:
    """Return real numbers (..., *tail) as floats, which need not be finite."""
    array = reals(value, what, error, cure=cure)
    if array.ndim < len(tail) or array.shape[array.ndim - len(tail) :] != tail:
        axes, more = ", ".join(["...", *map(str, tail)]), f"; {cure}" if cure else ""
        raise error(f"{what} must have shape ({axes}); got {array.shape}{more}")
    return array


def points(xi: Any) -> Array:
    """Return one point (3,) or many (..., 3) in reference coordinates."""
    return finite(real(xi, "points xi", (3,), "give one point (3,) or many (..., 3)"), "points xi")


def elasticity(C: Any, X: Array) -> Array:
    """Return C (6, 6) or (..., 6, 6) in Pa that fits elements placed at X (..., n, 3)."""
    what = "an elasticity matrix C"
    return finite(_fitting(real(C, what, (6, 6), "give the C of a material, material.C"), X, what), what)


def nodal(u: Any, X: Array, what: str = "displacements u") -> Array:
    """Return nodal values (..., n, 3) that fit elements placed at X (..., n, 3)."""
    n = X.shape[-2]
    return _fitting(real(u, what, (n, 3), f"reshape a flat array of {3 * n} to ({n}, 3)"), X, what)


def at_gauss(stress: Any, X: Array, g: int) -> Array:
    """Return stresses (..., g, 6) that fit elements placed at X (..., n, 3)."""
    values = real(stress, "a stress at Gauss points", (g, 6), f"there are {g} points of 6 components each")
    return _fitting(values, X, "a stress at Gauss points")


def _fitting(values: Array, X: Array, what: str) -> Array:
    """Return values (..., i, j) whose leading axes broadcast with those of X."""
    lead, own = X.shape[:-2], values.shape[:-2]
    if own in (lead, ()):
        return values
    try:
        np.broadcast_shapes(lead, own)
    except ValueError:
        raise InputError(
            f"{what} of shape {values.shape} does not fit: leading axes must be {lead}, those of the elements"
        ) from None
    return values


def density(rho: Any, X: Array) -> Array:
    """Return one density, or one for each element, in kg/m³."""
    values = real(rho, "a density", (), "give a number in kg/m³, or one for each element")
    if values.ndim and values.shape != X.shape[:-2]:
        raise InputError(
            f"a density must be one number or have shape {X.shape[:-2]}, one for each element; "
            f"got {values.shape}"
        )
    return values
