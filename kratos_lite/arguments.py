"""Arguments: numbers from the caller, checked before they reach any arithmetic."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite.errors import InputError


def finite(value: Any, what: str) -> NDArray[np.float64]:
    """Return a finite real number or array of them as floats.

    Raises InputError that says what the value is for.

    >>> finite([1, 2], "a force")
    array([1., 2.])
    """
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "buifO":
            raise TypeError
        array = array.astype(float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what} must be made of real numbers; got {_short(value)}") from None
    if not np.isfinite(array).all():
        raise InputError(f"{what} must be finite; got {_short(value)}")
    return array


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 100 else text[:97] + "..."
