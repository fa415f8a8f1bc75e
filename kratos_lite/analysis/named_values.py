"""Named values: fields and their parts by the short names with which pictures are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from kratos_lite.analysis.fields import FIELDS, PARTS, Fields
from kratos_lite.errors import InputError, nearest
from kratos_lite.typing import Array
from kratos_lite.view.scene import Values


def _names() -> Iterator[tuple[str, tuple[str, int | None]]]:
    for key, field in FIELDS.items():
        if field.kind in ("scalar", "vector") and "state" not in field.where:
            yield key, (key, None)
        for i, part in enumerate(PARTS[field.kind]):
            if field.symbol:
                yield field.symbol + part, (key, i)


NAMES = dict(_names())
"""Field and number of its part by each name; a vector itself is shown by its length."""
MOTIONS = tuple(name for name, (field, _) in NAMES.items() if field == "displacement")
"""Those that need nothing but displacements."""


def nodal_values(result: Fields, name: str) -> Values:
    """Return the values of nodes, or else of elements, by a name of `NAMES`; InputError for another."""
    if name not in NAMES:
        raise InputError(f"unknown field {name!r}; there are {', '.join(NAMES)}.{nearest(name, NAMES, 1)}")
    return named_values(name, lambda field: result.field(field, FIELDS[field].nodal_place))


def named_values(name: str, values: Callable[[str], Array]) -> Values:
    """Return what a name of `NAMES` shows of the values of its field."""
    key, part = NAMES[name]
    field, numbers = FIELDS[key], values(key)
    if part is not None:
        numbers = numbers[:, part]
    elif field.kind == "vector":
        numbers = np.linalg.norm(numbers, axis=1)
    title = field.name if part is None else f"{field.name} {PARTS[field.kind][part]}"
    return Values(numbers, title, field.unit, field.log)
