"""What is equal: loads and supports that are given twice, as a cell of a notebook does that is run twice."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from types import FunctionType
from typing import Any

import numpy as np

from kratos_lite.model.loads.base import Load
from kratos_lite.time_series import TimeSeries

DEEPEST = 8
"""Levels of values inside values that are compared; what lies deeper is compared as an object."""


def key_of(value: Any, depth: int = 0) -> Hashable:
    """Return a key that equal things share: loads by class and all values, functions by their code.

    >>> key_of({"a": [1, 2.0]}) == key_of({"a": [1, 2.0]}), key_of(lambda x: x) == key_of(lambda x: 2 * x)
    (True, False)
    """
    deeper = depth + 1
    if isinstance(value, np.ndarray):
        return "array", value.shape, value.dtype.kind, hash(value.tobytes())
    if isinstance(value, Mapping):
        value = [*value, *value.values()]
    if isinstance(value, (list, tuple)):
        return tuple(key_of(one, deeper) for one in value)
    if isinstance(value, FunctionType) and depth <= DEEPEST:
        closed = [cell.cell_contents for cell in value.__closure__ or ()]
        return value.__code__, key_of(value.__defaults__, deeper), key_of(closed, deeper)
    if isinstance(value, (Load, TimeSeries)):
        return type(value), key_of(vars(value), deeper)
    return value if isinstance(value, Hashable) and depth <= DEEPEST else id(value)


def equal_loads(loads: Sequence[Load]) -> list[str]:
    """Return a warning for each load that acts more than once."""
    alike: dict[Hashable, list[Load]] = {}
    for load in loads:
        alike.setdefault(key_of(load), []).append(load)
    return [
        f"{len(same)} equal loads {same[0]!r}, which add up; if one alone is meant, give it a name, "
        "model.add(load, name=...), so that it is not added twice"
        for same in alike.values()
        if len(same) > 1
    ]
