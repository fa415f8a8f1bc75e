"""Rate: how fast a motion is at each time, and the derivative of that."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from kratos_lite.errors import InputError
from kratos_lite.time_series import Factor, TimeSeries, function_of, slope_of


class Rate:
    """A rate in time and its acceleration, of numbers, `TimeSeries` or functions of time in s."""

    def __init__(self, rate: Factor, acceleration: Factor | None, what: str = "a rate") -> None:
        self.is_accelerated = acceleration is not None
        self.value = function_of(rate, what)
        self.slope = slope_of(rate, what)
        if acceleration is not None:
            self.slope = function_of(acceleration, "an acceleration")
        self.steady = not (callable(rate) or callable(acceleration) or acceleration)
        self.is_changing = callable(rate if acceleration is None else acceleration)
        if not callable(rate) and (isinstance(acceleration, TimeSeries) or not callable(acceleration)):
            number = not (acceleration is None or isinstance(acceleration, TimeSeries))
            self.value = _accelerated(self.value(0.0), self.slope(0.0) if number else acceleration)

    def at(self, time: float, step: float = 0.0, steady: bool = False) -> tuple[float, float]:
        """Return rate and acceleration at a time in s, the mean over a step in s if not given."""
        if self.is_accelerated or not (steady or step):
            return self.value(time), self.slope(time)
        if steady:
            return self.value(time), 0.0
        start, end = max(time - step / 2, 0.0), time + step / 2
        return self.value(time), (self.value(end) - self.value(start)) / (end - start)


def vector_rates(
    velocity: Sequence[Factor], acceleration: Sequence[Factor] | None, what: str
) -> tuple[Rate, Rate, Rate]:
    """Return the rates of three components, each a number, `TimeSeries` or function of time."""
    x, y, z = _components(velocity, f"{what} velocity")
    accelerations = (None,) * 3 if acceleration is None else _components(acceleration, f"{what} acceleration")
    name = f"{what} velocity"
    return Rate(x, accelerations[0], name), Rate(y, accelerations[1], name), Rate(z, accelerations[2], name)


def _components(values: Sequence[Factor], what: str) -> tuple[Factor, Factor, Factor]:
    try:
        x, y, z = values
    except (TypeError, ValueError):
        raise InputError(
            f"{what} has three components, each a number, TimeSeries or function of time; got {values!r:.80}"
        ) from None
    return x, y, z


def _accelerated(start: float, acceleration: float | TimeSeries | None) -> Callable[[float], float]:
    """Return the rate in time from its start."""
    if isinstance(acceleration, TimeSeries):
        return lambda time: start + acceleration.integral(0.0, time)
    return lambda time: start + (acceleration or 0.0) * time
