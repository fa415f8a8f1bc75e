"""The section ``ale`` of Kratos run files: the motion of the material through the mesh."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from kratos_lite.ale import Rotation, Translation
from kratos_lite.analysis.model import Model
from kratos_lite.io.settings import Settings, is_number, shown
from kratos_lite.time_series import TimeSeries

COMMON = ("rate", "acceleration", "damping", "part")
CENTER = ("center_velocity", "center_acceleration")
KEYS = {
    "rotation": ("axis", "center", *CENTER, "skew", "stiffening", *COMMON),
    "translation": ("direction", "boundaries", *COMMON),
}

READ: dict[str, Callable[[Settings, str], Any]] = {
    "boundaries": Settings.text, "part": Settings.text, "center": Settings.vector,
    "skew": Settings.flag, "stiffening": Settings.flag,
}  # fmt: skip


def add_motion(model: Model, settings: Settings, time: float | None = None) -> None:
    """Add the motion that the section ``ale`` of a run file gives to a model; nothing without one.

    It is ``{"rotation": {…}}`` or ``{"translation": {…}}`` with the arguments of `Rotation` or `Translation`;
    rate and acceleration may be ``{"times": […], "values": […]}``, with vectors those of the center, too.
    Given a `time` in s, such tables keep the values of that time.
    """
    if "ale" not in settings:
        return
    section = settings.section("ale")
    section.check_keys(list(KEYS))
    section.expect(len(section.values) == 1, "", "one of 'rotation' and 'translation' is needed")
    (kind,) = section.values
    inner = section.section(kind)
    inner.check_keys(KEYS[kind])
    inner.get("rate")
    arguments = {key: _value(inner, key, time) for key in inner.values}
    motion = inner.placed("", Rotation if kind == "rotation" else Translation, **arguments)
    section.placed(kind, model.add, motion)


def _value(section: Settings, key: str, time: float | None) -> Any:
    """Return the argument of a motion that a key gives."""
    if key in READ:
        return READ[key](section, key)
    value = section.values[key]
    if key in ("axis", "direction"):
        return section.text(key) if isinstance(value, str) else section.vector(key)
    if not isinstance(value, dict):
        return section.vector(key) if key in CENTER else section.number(key)
    series = _series(section, key)
    values = series if time is None else [one(time) for one in series]
    return values if key in CENTER else values[0]


def _series(section: Settings, key: str) -> list[TimeSeries]:
    """Return the time series of ``{"times": […], "values": […]}``, three of them for vectors [x, y, z]."""
    table = section.section(key)
    table.check_keys(("times", "values"))
    times = table.numbers("times")
    if key not in CENTER:
        return [section.placed(key, TimeSeries, times, table.numbers("values"))]
    rows = table.get("values")
    fits = isinstance(rows, list) and rows and all(isinstance(row, list) and len(row) == 3 for row in rows)
    fits = fits and all(is_number(value) for row in rows for value in row)
    table.expect(fits, "values", f"must be a list of [x, y, z]; got {shown(rows)}")
    return [section.placed(key, TimeSeries, times, list(column)) for column in zip(*rows, strict=True)]
