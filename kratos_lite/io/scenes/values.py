"""Values of JSON scenes: vectors, points, functions of the time, and calls whose errors get a place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar

import numpy as np

from kratos_lite.bodies import TimeSeries
from kratos_lite.errors import KratosLiteError
from kratos_lite.io.json_file import Object
from kratos_lite.io.project.settings import Settings, is_number, shown
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array

T = TypeVar("T")
Read: TypeAlias = Callable[[Settings, str, "Mesh | None"], Any]
"""Reads the value of a key of an object; the mesh is that of the body, if it has one."""


def placed(section: Settings, key: str, action: Callable[..., T], *arguments: Any, **named: Any) -> T:
    """Call something; an error of the library gets the place of a key."""
    try:
        return action(*arguments, **named)
    except KratosLiteError as error:
        name = section.name(key) if key else section.path
        raise section.error(key, f"{name}: {error}") from None


def number(section: Settings, key: str, mesh: Mesh | None) -> float:
    """Return a number."""
    return section.number(key)


def text(section: Settings, key: str, mesh: Mesh | None) -> str:
    """Return a string."""
    return section.text(key)


def vector(section: Settings, key: str, mesh: Mesh | None) -> list[float]:
    """Return three numbers."""
    return section.vector(key)


def part(section: Settings, key: str, mesh: Mesh | None) -> str:
    """Return the name of a part of the mesh, or of one of its sides."""
    name = section.text(key)
    if mesh is None:
        raise section.error(key, f"{section.name(key)}: this body has no mesh, so no part {name!r}")
    placed(section, key, mesh.part, name)
    return name


def function(section: Settings, key: str, mesh: Mesh | None) -> float | TimeSeries:
    """Return a number, or the time series of ``{"times": […], "values": […]}``."""
    value = section.get(key)
    if isinstance(value, Object):
        inner = section.section(key)
        inner.check_keys(("times", "values"))
        return placed(section, key, TimeSeries, inner.numbers("times"), inner.numbers("values"))
    if not is_number(value):
        raise section.error(
            key,
            f'{section.name(key)} must be a number or {{"times": […], "values": […]}}; got {shown(value)}',
        )
    return float(value)


def points(section: Settings, key: str, mesh: Mesh | None) -> Array:
    """Return points (3,) or (m, 3): one point, a list of points, or the nodes of a part by its name."""
    value = section.get(key)
    if isinstance(value, str):
        name = part(section, key, mesh)
        assert mesh is not None
        found = mesh.points[mesh.nodes(name)]
        if not len(found):
            raise section.error(key, f"{section.name(key)}: part {name!r} has no nodes")
        return np.asarray(found)
    rows = value if isinstance(value, list) and value and isinstance(value[0], list) else [value]
    if not all(isinstance(row, list) and len(row) == 3 and all(map(is_number, row)) for row in rows):
        raise section.error(
            key,
            f"{section.name(key)} must be a point [x, y, z], a list of points or a part; got {shown(value)}",
        )
    return np.array(value, dtype=float)


def matrix(section: Settings, key: str, mesh: Mesh | None) -> Array:
    """Return a matrix (3, 3): its three rows, or its diagonal."""
    value = section.get(key)
    if isinstance(value, list) and len(value) == 3:
        if all(map(is_number, value)):
            return np.diag(np.array(value, dtype=float))
        if all(isinstance(row, list) and len(row) == 3 and all(map(is_number, row)) for row in value):
            return np.array(value, dtype=float)
    raise section.error(
        key, f"{section.name(key)} must be three rows of three numbers, or a diagonal; got {shown(value)}"
    )
