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


def number(value: Any, what: str) -> float:
    """Return one finite real number as a float.

    >>> number(2, "a length")
    2.0
    """
    one = finite(value, what)
    if one.ndim:
        raise InputError(f"{what} must be one number; got {_short(value)}")
    return float(one)


def positive_step(dt: Any) -> float:
    """Return the step of a march in s.

    >>> positive_step(0.5)
    0.5
    """
    h = finite(dt, "a step")
    if h.ndim or not h > 0:
        raise InputError(f"a step must be one number of seconds > 0; got {_short(dt)}")
    if h * h < np.finfo(float).tiny:
        raise InputError(f"a step of {h:g} s is too short to compute with; take a longer one")
    return float(h)


def whole_number(value: Any, what: str, otherwise: str = "") -> int:
    """Return a whole number ≥ 1; `otherwise` tells what else the caller takes.

    >>> whole_number(3, "steps")
    3
    """
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{what} must be a whole number ≥ 1{otherwise}; got {_short(value)}")
    return int(value)


def flag(value: Any, what: str) -> bool:
    """Return True or False.

    >>> flag(True, "lumped")
    True
    """
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{what} must be True or False; got {_short(value)}")
    return bool(value)


def function_or_none(value: Any, must: str) -> None:
    """Raise InputError, which says what the value must be, for neither a function nor None.

    >>> function_or_none(print, "progress must be a function")
    """
    if value is not None and not callable(value):
        raise InputError(f"{must}; got {_short(value)}")


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 100 else text[:97] + "..."
