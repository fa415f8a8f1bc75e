"""The section ``time`` of run files, and values that change with the time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kratos_lite.errors import InputError, nearest
from kratos_lite.io.json_file import Object
from kratos_lite.io.project.settings import Settings, inside, is_number, shown
from kratos_lite.io.scene import March
from kratos_lite.model.loads import Load, ScaledLoad
from kratos_lite.time_series import TimeSeries
from kratos_lite.validation import positive_step, whole_number

if TYPE_CHECKING:
    from kratos_lite.analysis import CentralDifference
    from kratos_lite.analysis.schemes import Implicit

KEYS = ("step", "steps", "every", "scheme", "rayleigh", "lumped", "restart")
SERIES = (".pvd", ".csv", ".npz")
"""Endings of files that hold a march."""
NO_RESULT = "{}: a march is written as .pvd (for ParaView), .csv or .npz"
SCHEMES = {
    "newmark": (0, 2),
    "hht": (0, 1),
    "bossak": (0, 1),
    "generalized_alpha": (0, 1),
    "central_difference": (0,),
}
"""How many numbers each scheme takes."""


def scheme_of(name: str, numbers: list[float]) -> Implicit | CentralDifference:
    """Return a scheme by its name and numbers; InputError for those that are none.

    >>> scheme_of("hht", [-0.1]).name
    'hht(-0.1)'
    """
    if name not in SCHEMES:
        raise InputError(f"unknown scheme {name!r}.{nearest(name, SCHEMES)} Known are {', '.join(SCHEMES)}")
    counts = SCHEMES[name]
    if len(numbers) not in counts:
        raise InputError(f"{name} takes {' or '.join(map(str, counts))} numbers; got {len(numbers)}")
    from kratos_lite import analysis as dynamics

    make: Callable[..., Implicit | CentralDifference]
    make = getattr(dynamics, "CentralDifference" if name == "central_difference" else name)
    return make(*numbers)


def march_of(settings: Settings, folder: Path, outside: bool = False) -> March | None:
    """Return what the section ``time`` of a run file says, or None without one.

    It is ``{"step": s, "steps": n, "every": k, "scheme": …, "rayleigh": [α, β], "lumped": false, "restart":
    "moment.npz"}``.  A scheme is a name such as ``"newmark"``, or a name with its numbers such as
    ``{"hht": -0.05}`` or ``{"newmark": [0.25, 0.5]}``.

    Raises
    ------
    InputError
        With file, line and column of what is wrong.
    """
    if "time" not in settings:
        return None
    section = settings.section("time")
    section.check_keys(KEYS)
    return March(
        _checked(section, "step", positive_step, section.number("step")),
        _checked(section, "steps", lambda n: whole_number(n, "steps"), section.integer("steps")),
        _checked(section, "every", lambda n: whole_number(n, "every"), section.integer("every", 1)),
        _scheme(section) if "scheme" in section else None,
        _rayleigh(section) if "rayleigh" in section else (0.0, 0.0),
        section.flag("lumped", False),
        restart=_restart(section, folder, outside) if "restart" in section else None,
    )


def _checked(section: Settings, key: str, check: Callable[..., Any], *values: Any) -> Any:
    """Return what a check makes of values; give its error the place of a key."""
    try:
        return check(*values)
    except InputError as error:
        raise section.error(key, f"{section.name(key)}: {error}") from None


def _scheme(section: Settings) -> Implicit | CentralDifference:
    value = section.values["scheme"]
    name, numbers = value, []
    if isinstance(value, Object) and len(value) == 1:
        ((name, given),) = value.items()
        numbers = given if isinstance(given, list) else [given]
    if not isinstance(name, str) or not all(map(is_number, numbers)):
        raise section.error(
            "scheme",
            f'{section.name("scheme")} must be a name such as "newmark", or a name with its numbers such as '
            f'{{"hht": -0.05}}; got {shown(value)}',
        )
    scheme: Implicit | CentralDifference = _checked(section, "scheme", scheme_of, name, numbers)
    return scheme


def _rayleigh(section: Settings) -> tuple[float, float]:
    values = section.numbers("rayleigh")
    if len(values) != 2 or min(values) < 0:
        raise section.error(
            "rayleigh", f"{section.name('rayleigh')} must be [α, β], both ≥ 0, in 1/s and s; got {values}"
        )
    return values[0], values[1]


def _restart(section: Settings, folder: Path, outside: bool) -> str:
    try:
        path = inside(folder, section.text("restart"), outside)
    except ValueError as error:
        raise section.error("restart", f"{section.name('restart')}: {error}") from None
    if not path.is_file():
        raise section.error("restart", f"{section.name('restart')}: there is no file {path}")
    return str(path)


def varying(section: Settings, key: str, make: Callable[[Settings, str], Load]) -> Load:
    """Return the load that `make` reads of a key, or one that varies.

    The latter is ``{"value": …, "times": […], "factors": […]}``: the value times a piecewise linear factor.
    """
    if not isinstance(section.values[key], Object):
        return make(section, key)
    table = section.section(key)
    table.check_keys(("value", "times", "factors"))
    load = make(table, "value")
    return ScaledLoad(
        load, _checked(section, key, TimeSeries, table.numbers("times"), table.numbers("factors"))
    )
