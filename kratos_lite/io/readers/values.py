"""Values in JSON: vectors, points, materials, and numbers that change in time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.io.json_file import Object
from kratos_lite.io.settings import Settings, is_number, shown
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.mesh import Mesh
from kratos_lite.tabular import names_of
from kratos_lite.time_series import TimeSeries
from kratos_lite.typing import Array

Read: TypeAlias = Callable[[Settings, str], Any]
"""Reads the value of a key of an object."""


def number_or_series(section: Settings, key: str) -> float | TimeSeries:
    """Return a number, or the time series of ``{"times": […], "values": […]}``."""
    value = section.get(key)
    if not isinstance(value, Object):
        if not is_number(value):
            kinds = 'a number or {"times": […], "values": […]}'
            raise section.error(key, f"{section.name(key)} must be {kinds}; got {shown(value)}")
        return float(value)
    table = section.section(key)
    table.check_keys(("times", "values"))
    return section.placed(key, TimeSeries, table.numbers("times"), table.numbers("values"))


def vector_or_series(section: Settings, key: str) -> list[float] | list[TimeSeries]:
    """Return three numbers, or three time series of ``{"times": […], "values": [[x, y, z], …]}``."""
    if not isinstance(section.get(key), Object):
        return section.vector(key)
    table = section.section(key)
    table.check_keys(("times", "values"))
    rows = table.get("values")
    if not (isinstance(rows, list) and rows and all(map(_is_vector, rows))):
        raise table.error("values", f"{table.name('values')} must be a list of [x, y, z]; got {shown(rows)}")
    times = table.numbers("times")
    return [section.placed(key, TimeSeries, times, list(column)) for column in zip(*rows, strict=True)]


def read_material(section: Settings) -> LinearMaterial:
    """Return the material of an object with the name of its law and its constants."""
    law = section.text("law", "Isotropic3D")
    kind = section.placed("law", MATERIALS.__getitem__, law)
    names = names_of(kind)
    section.check_keys(["law", *names])
    missing = [name for name in names if name not in section and name != "density"]
    if missing:
        raise section.error("", f"{section.path}: {law} needs {', '.join(missing)}")
    values = {name: section.number(name) for name in names if name in section}
    return section.placed("", kind, **values)


def is_by_part(section: Settings) -> bool:
    """Return whether an object holds one material for each part."""
    return any(isinstance(value, Object) for value in section.values.values())


def part(section: Settings, key: str, mesh: Mesh | None) -> str:
    """Return the name of a part of the mesh, or of one of its sides."""
    name = section.text(key)
    if mesh is None:
        raise section.error(key, f"{section.name(key)}: this body has no mesh, so no part {name!r}")
    section.placed(key, mesh.part, name)
    return name


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
    if not all(map(_is_vector, rows)):
        kinds = "a point [x, y, z], a list of points or a part"
        raise section.error(key, f"{section.name(key)} must be {kinds}; got {shown(value)}")
    return np.array(value, dtype=float)


def matrix(section: Settings, key: str) -> Array:
    """Return a matrix (3, 3): its three rows, or its diagonal."""
    value = section.get(key)
    if _is_vector(value):
        return np.diag(np.array(value, dtype=float))
    if isinstance(value, list) and len(value) == 3 and all(map(_is_vector, value)):
        return np.array(value, dtype=float)
    kinds = "three rows of three numbers, or a diagonal"
    raise section.error(key, f"{section.name(key)} must be {kinds}; got {shown(value)}")


def _is_vector(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(is_number, value))
