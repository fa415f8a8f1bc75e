"""The section ``ale`` of run files: the motion of the material through the mesh."""

from __future__ import annotations

from typing import Any

from kratos_lite.ale import Motion, Rotation, Translation
from kratos_lite.analysis.model import Model
from kratos_lite.io.readers.values import number_or_series, vector_or_series
from kratos_lite.io.settings import Settings
from kratos_lite.time_series import TimeSeries

COMMON = ("rate", "acceleration", "damping", "part")
CENTER = ("center_velocity", "center_acceleration")
KEYS = {
    "rotation": ("axis", "center", *CENTER, "skew", "stiffening", *COMMON),
    "translation": ("direction", "boundaries", *COMMON),
}


def add_motion(model: Model, settings: Settings, time: float | None = None) -> None:
    """Add the motion that the section ``ale`` of a run file gives to a model; nothing without one.

    It is ``{"rotation": {…}}`` or ``{"translation": {…}}`` with the arguments of `Rotation` or `Translation`;
    rate and acceleration may be ``{"times": […], "values": […]}``, with vectors those of the center, too.
    Given a `time` in s, such tables stay what they are then.

    Raises
    ------
    InputError
        With file, line and column of what is wrong, also where the motion does not fit the model.
    """
    if "ale" not in settings:
        return
    section = settings.section("ale")
    section.check_keys(KEYS)
    if len(section.values) != 1:
        raise section.error("", "ale: one of 'rotation' and 'translation' is needed")
    (kind,) = section.values
    section.placed(kind, model.add, read_motion(section.section(kind), kind, time))


def read_motion(section: Settings, kind: str, time: float | None = None) -> Motion:
    """Return the motion of an object, of the kind ``rotation`` or ``translation``; see `add_motion`."""
    section.check_keys(KEYS[kind])
    section.get("rate")
    given: dict[str, Any] = {}
    for key in section.values:
        if key in ("axis", "direction"):
            given[key] = section.text(key) if isinstance(section.values[key], str) else section.vector(key)
        elif key == "center":
            given[key] = section.vector(key)
        elif key in CENTER:
            values = vector_or_series(section, key)
            given[key] = [v(time) if isinstance(v, TimeSeries) and time is not None else v for v in values]
        elif key in ("skew", "stiffening"):
            given[key] = section.flag(key)
        elif key in ("boundaries", "part"):
            given[key] = section.text(key)
        else:
            value = section.number(key) if key == "damping" else number_or_series(section, key)
            given[key] = value(time) if isinstance(value, TimeSeries) and time is not None else value
    return section.placed("", Rotation if kind == "rotation" else Translation, **given)
