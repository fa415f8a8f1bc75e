"""TimeSeries: values at times, linearly interpolated."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.validation import finite, number, short, takes

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class TimeSeries:
    """A piecewise linear function of time; before the first and after the last time it is constant.

    Parameters
    ----------
    times : (k,) s, strictly ascending.
    values : (k,) floats.

    Raises
    ------
    InputError
        If there are not as many values as times, or the times do not ascend.

    Examples
    --------
    >>> ramp = TimeSeries([0.0, 2.0], [0.0, 10.0])
    >>> ramp(0.5), ramp(3.0), ramp.integral(0.0, 3.0)
    (2.5, 10.0, 20.0)
    """

    def __init__(self, times: ArrayLike, values: ArrayLike) -> None:
        self.times, self.values = finite(times, "times"), finite(values, "values")
        if self.times.ndim != 1 or self.times.shape != self.values.shape or not len(self.times):
            raise InputError(
                "a time series needs as many values as times, one at least; "
                f"got shapes {self.times.shape} and {self.values.shape}"
            )
        if (np.diff(self.times) <= 0).any():
            raise InputError(f"times of a series must ascend; got {self.times[:6].tolist()}")

    def __call__(self, time: float) -> float:
        """Return the value at a time in s."""
        return float(np.interp(time, self.times, self.values))

    def slope(self, time: float) -> float:
        """Return the derivative; at a kink the mean of both sides, at time 0 that of the later one.

        Parameters
        ----------
        time : s.

        Returns
        -------
        float

        Examples
        --------
        >>> ramp = TimeSeries([0.0, 2.0], [0.0, 10.0])
        >>> ramp.slope(0.0), ramp.slope(1.0), ramp.slope(2.0), ramp.slope(3.0)
        (5.0, 5.0, 2.5, 0.0)
        """
        gaps = np.diff(self.times)
        slopes = np.concatenate([[0.0], np.diff(self.values) / gaps, [0.0]])
        # for times that are sums
        near = min(1e-9 * abs(time) + 1e-15, 1e-3 * float(gaps.min(initial=np.inf)))
        after = slopes[np.searchsorted(self.times, time + near)]
        before = slopes[np.searchsorted(self.times, time - near)] if time > near else after
        return float(before + after) / 2

    def integral(self, start: float, end: float) -> float:
        """Return the exact integral over time.

        Parameters
        ----------
        start, end : s.

        Returns
        -------
        float
        """
        inner = self.times[(self.times > start) & (self.times < end)]
        knots = np.concatenate([[start], inner, [end]])
        values = np.interp(knots, self.times, self.values)
        return float((np.diff(knots) * (values[1:] + values[:-1])).sum() / 2)


Factor: TypeAlias = "float | TimeSeries | Callable[[float], float]"


def function_of(
    value: Factor, what: str, checked: Callable[[Any, str], Any] = number
) -> Callable[[float], Any]:
    """Return a number, time series or function as a function of the time, whose values are checked."""
    if isinstance(value, TimeSeries):
        return value
    if callable(value):
        if isinstance(value, type) or not takes(value, 1):
            raise InputError(f"{what} must be a function of the time alone; got {short(value)}")
        return lambda time: checked(value(time), f"{what} at t = {time:g} s")
    constant = finite(value, what)
    if constant.ndim:
        raise InputError(f"{what} must be a number, a TimeSeries or a function of time; got {value!r}")
    return lambda time: float(constant)


def slope_of(value: Factor, what: str) -> Callable[[float], float]:
    """Return the derivative of a number, time series or function; of a function by differences."""
    if isinstance(value, TimeSeries):
        return value.slope
    if not callable(value):
        return lambda time: 0.0
    f = function_of(value, what)

    def slope(time: float) -> float:
        h = 1e-6 * max(1.0, abs(time))
        if time < h:
            return (-3 * f(time) + 4 * f(time + h) - f(time + 2 * h)) / (2 * h)
        return (f(time + h) - f(time - h)) / (2 * h)

    return slope


def integral_of(value: Factor, start: float, end: float) -> float:
    """Return the integral of a function of the time, by three Gauss points unless it is a `TimeSeries`."""
    if isinstance(value, TimeSeries):
        return value.integral(start, end)
    f, half = function_of(value, "a function of the time"), (end - start) / 2
    points, weights = np.polynomial.legendre.leggauss(3)
    return float(half * sum(w * f(start + half * (1 + x)) for x, w in zip(points, weights, strict=True)))
