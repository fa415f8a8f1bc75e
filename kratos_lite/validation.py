"""Validation: what a caller gives, checked before it reaches any arithmetic.

Each function returns the checked value, or raises one error that says what was expected and what was
found.  `what` names the value in the message: ``finite(x, "a force", (3,))``.

=====================  =============================================================
to check               write
=====================  =============================================================
an array               ``finite(value, what, (3,))``, ``finite(value, what, ("n", 3))``
a number               ``number(value, what)``, with ``above=``, ``least=``, ``below=``
a whole number         ``whole_number(value, what)``, with ``least=``, ``most=``
whole numbers          ``whole_numbers(value, what, ("n",))``, with ``size=`` for rows of something
one of some names      ``choice(value, what, names)``
True or False          ``flag(value, what)``
a function or None     ``function_or_none(value, what)``
what one gives         ``of_places(function, X, what)``
an instance            ``instance(value, what, cls)``
=====================  =============================================================
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable
from os import PathLike
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np

from kratos_lite.errors import InputError, KratosLiteError, nearest
from kratos_lite.typing import Array, Numbers

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

T = TypeVar("T")
AnyArray = TypeVar("AnyArray", bound="NDArray[Any]")
Axes: TypeAlias = "tuple[int | str, ...]"
"""A shape: lengths of axes, or words for any length."""
Error: TypeAlias = type[KratosLiteError]
LARGEST = 1e50
"""Size of the largest number that is taken, so that products of some of them are finite."""
MOST = 1e11
"""Numbers of an array at most."""


def finite(value: Any, what: str, shape: Axes | None = None, *, error: Error = InputError) -> Array:
    """Return finite real numbers as floats, of a shape such as (3,) or ("n", 3).

    A word stands for any length, "..." at the start for any leading axes.
    """
    array = reals(value, what, error, copy=True)
    if shape is not None and not _has(array.shape, shape):
        raise error(f"{what} must have shape ({_axes(shape)}); got {array.shape}")
    fits = np.abs(array) <= LARGEST
    if not fits.all():
        first = tuple(map(int, np.argwhere(~fits)[0]))
        wanted = f"at most {LARGEST:g} in size" if math.isfinite(array[first]) else "finite"
        found = f"{float(array[first])} at {list(first)}" if array.size > 9 else short(value)
        raise error(f"{what} must be {wanted}; got {found}")
    return array


def reals(value: Any, what: str, error: Error = InputError, *, cure: str = "", copy: bool = False) -> Array:
    """Return real numbers as floats; they need not be finite, as results may not be."""
    try:
        array = np.asarray(value)
        if array.dtype == np.float64 and array.size <= MOST:  # most are, and soon done
            return array.copy("K") if copy else array
        if array.dtype.kind not in "buifO" or (array.dtype == object and None in array.ravel().tolist()):
            raise TypeError
        with np.errstate(all="ignore"):  # what is too large for a float becomes infinite
            array = array.astype(float, copy=copy) if array.size <= MOST else array
    except (TypeError, ValueError, OverflowError):
        text = f"{what} must be made of real numbers; got {short(value)}"
        raise error(f"{text}; {cure}" if cure else text) from None
    _check_size(array, what, error)
    return array


def whole_numbers(
    value: Any,
    what: str,
    shape: Axes | None = None,
    *,
    size: int | None = None,
    dtype: type[np.signedinteger[Any]] = np.int64,
    error: Error = InputError,
) -> Numbers:
    """Return an array of whole numbers, such as rows and ids; an empty list is one, too."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        array = np.asarray(None)
    _check_size(array, what, error)
    unlike = array.dtype.kind not in "iu" and (array.size or array.dtype.kind != "f")
    if unlike or (shape is not None and not _has(array.shape, shape)):
        axes = "" if shape is None else f" of shape ({_axes(shape)})"
        found = short(value) if unlike else f"shape {array.shape}"
        raise error(f"{what} must be whole numbers{axes}; got {found}")
    if size is None and array.dtype == dtype:
        return array
    low, high = (int(array.min()), int(array.max())) if array.size else (0, -1)
    if size is not None and not 0 <= low <= high + 1 <= size:
        found = f"{low}" if low == high else f"{low} … {high}"
        raise error(f"{what} must lie in 0 … {size - 1}; got {found}")
    ends = np.iinfo(dtype)
    if low < ends.min or high > ends.max:
        raise error(f"{what} must be below 2^{ends.bits - 1}; got {high}")
    return array.astype(dtype, copy=False)


def _check_size(array: AnyArray, what: str, error: Error) -> None:
    """Raise an error for an array that claims more numbers than any memory holds."""
    if array.size > MOST:
        raise error(f"{what} must have at most {MOST:g} numbers; got shape {array.shape}")


def read_only(array: AnyArray) -> AnyArray:
    """Return an array that nobody can change: itself if it is one, else a copy."""
    if array.flags.writeable or not array.flags.owndata:
        array = array.copy()
        array.flags.writeable = False
    return array


def _axes(shape: Axes) -> str:
    return ", ".join(map(str, shape)) + ("," if len(shape) == 1 else "")


def _has(found: tuple[int, ...], wanted: Axes) -> bool:
    if wanted[:1] == ("...",):  # any leading axes
        found, wanted = found[max(len(found) - len(wanted) + 1, 0) :], wanted[1:]
    fits = (isinstance(w, str) or w == n for n, w in zip(found, wanted, strict=False))
    return len(found) == len(wanted) and all(fits)


def number(
    value: Any,
    what: str,
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
    unit: str = "",
    error: Error = InputError,
) -> float:
    """Return one finite real number > `above`, ≥ `least` and < `below`, each if given, as a float."""
    array = finite(value, what, error=error)
    x = float(array) if not array.ndim else math.nan
    bounds = {">": (above, operator.gt), "≥": (least, operator.ge), "<": (below, operator.lt)}
    limits = {f"{sign} {end:g}": holds(x, end) for sign, (end, holds) in bounds.items() if end is not None}
    if array.ndim or not all(limits.values()):
        wanted = " ".join(["one number", " and ".join(limits)]).strip() + (f", in {unit}" if unit else "")
        raise error(f"{what} must be {wanted}; got {short(value)}")
    return x


def positive_step(dt: Any) -> float:
    """Return a time step in s."""
    h = number(dt, "a step", above=0, unit="s")
    if h * h < np.finfo(float).tiny:
        raise InputError(f"a step of {h:g} s is too short to compute with; take a longer one")
    return h


def whole_number(
    value: Any,
    what: str,
    otherwise: str = "",
    *,
    least: int = 1,
    most: int | None = None,
    error: Error = InputError,
) -> int:
    """Return a whole number from `least` to `most`; `otherwise` says what else the caller takes."""
    fits = isinstance(value, (int, np.integer)) and not isinstance(value, bool) and value >= least
    if not fits or (most is not None and value > most):
        limits = f"≥ {least}" if most is None else f"from {least} to {most}"
        raise error(f"{what} must be a whole number {limits}{otherwise}; got {short(value)}")
    return int(value)


def choice(value: Any, what: str, known: Iterable[str], *, error: Error = InputError) -> str:
    """Return one of some names."""
    names = list(known)
    if not isinstance(value, str) or value not in names:
        hint = nearest(value, names, 1) if isinstance(value, str) else ""
        point = "." if hint else ""
        raise error(f"{what} must be one of {', '.join(names)}; got {short(value)}{point}{hint}")
    return value


def flag(value: Any, what: str) -> bool:
    """Return True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{what} must be True or False; got {short(value)}")
    return bool(value)


def function_or_none(value: Any, must: str) -> None:
    """Raise InputError, which says what the value must be, for neither a function nor None."""
    if value is not None and not callable(value):
        raise InputError(f"{must}; got {short(value)}")


def fraction(value: Any, what: str) -> float:
    """Return a number, or that of percents such as ``"5%"``."""
    word = value.strip() if isinstance(value, str) else ""
    if word.endswith("%") and word[:-1].strip().replace(".", "", 1).isdecimal():
        return float(word[:-1]) / 100
    return number(value, what)


def takes(function: Any, count: int) -> bool:
    """Return whether something can be called with so many arguments, as far as Python knows."""
    import inspect

    if not callable(function):
        return False
    try:
        inspect.signature(function).bind(*[0.0] * count)
    except TypeError:
        return False
    except ValueError:  # compiled functions do not tell
        pass
    return True


def of_places(function: Callable[[Array], Any], X: Array, what: str) -> Any:
    """Return what a user's function gives at places X (m, 3); InputError in words where it fails."""
    try:
        return function(X.copy())
    except (IndexError, TypeError, ValueError) as error:
        if isinstance(error, KratosLiteError):
            raise
        raise InputError(
            f"{what}: the function fails at places X; X is (m, 3), all places at once, and x is X[:, 0]; "
            f"numpy's functions and & take arrays: {error}"
        ) from error


def path_of(value: Any) -> Path:
    """Return a path to a file."""
    if not isinstance(value, (str, PathLike)):
        raise InputError(f"a path to a file must be text or a pathlib.Path; got {short(value)}")
    from pathlib import Path  # a quick start without files

    return Path(value)


def instance(
    value: Any,
    what: str,
    kind: type[T] | tuple[type[T], ...],
    example: str = "",
    *,
    error: Error = InputError,
) -> T:
    """Return an instance of a class, or of one of several; `example` says how to make one."""
    if not isinstance(value, kind):
        names = " or ".join(k.__name__ for k in (kind if isinstance(kind, tuple) else (kind,)))
        such = f", such as {example}" if example else ""
        raise error(f"{what} must be a {names}{such}; got {short(value)}")
    return value


def short(value: Any) -> str:
    """Return a value as one line of at most 100 characters, for a message."""
    text = " ".join(repr(value).split())  # arrays have lines
    return text if len(text) <= 100 else text[:97] + "..."
