"""The section ``time`` of a file: steps, integrator, damping and restart; and loads that change in time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kratos_lite.errors import InputError, nearest
from kratos_lite.io.case import TimeIntegration, number_of_steps
from kratos_lite.io.json_file import Object
from kratos_lite.io.readers.values import number_or_series
from kratos_lite.io.settings import Settings, find_file, is_number, shown
from kratos_lite.model.loads import Load, ScaledLoad
from kratos_lite.tabular import names_of
from kratos_lite.validation import positive_step, whole_number

if TYPE_CHECKING:
    from kratos_lite.analysis.integrators import ModelIntegrator

OF_MODELS = ("step", "steps", "every", "integrator", "rayleigh", "lumped", "restart")
OF_BODIES = ("step", "steps", "every", "substeps")


def integrator_of(name: str, numbers: list[float]) -> ModelIntegrator:
    """Return an integrator by its name and numbers; InputError for those that are none.

    >>> str(integrator_of("hht", [-0.1]))
    'hht(-0.1)'
    """
    from kratos_lite.analysis.integrators import INTEGRATORS

    if name not in INTEGRATORS:
        hint = nearest(name, INTEGRATORS)
        raise InputError(f"unknown integrator {name!r}.{hint} Known are {', '.join(INTEGRATORS)}")
    make: Callable[..., ModelIntegrator] = INTEGRATORS[name]
    counts = sorted({0, len(names_of(INTEGRATORS[name]))})
    if len(numbers) not in counts:
        raise InputError(f"{name} takes {' or '.join(map(str, counts))} numbers; got {len(numbers)}")
    return make(*numbers)


def read_time(settings: Settings, folder: Path, *, outside: bool = False) -> TimeIntegration | None:
    """Return what the section ``time`` of a run file says, or None without one.

    It is ``{"step": s, "steps": n, "every": k, "integrator": …, "rayleigh": [α, β], "lumped": false,
    "restart": "state.npz"}``.  An integrator is a name such as ``"newmark"``, or a name with its numbers such
    as ``{"hht": -0.05}`` or ``{"newmark": [0.25, 0.5]}``.

    Raises
    ------
    InputError
        With file, line and column of what is wrong.
    """
    if "time" not in settings:
        return None
    section = settings.section("time")
    section.check_keys(OF_MODELS)
    return TimeIntegration(
        **_steps(section),
        integrator=_integrator(section) if "integrator" in section else None,
        rayleigh=_rayleigh(section) if "rayleigh" in section else (0.0, 0.0),
        lumped=section.flag("lumped", False),
        restart=restart_of(section, folder, outside) if "restart" in section else None,
    )


def read_time_of_body(settings: Settings) -> TimeIntegration:
    """Return what the section ``time`` of a file with a body says: step, steps, every and substeps."""
    section = settings.section("time", required=True)
    section.check_keys(OF_BODIES)
    substeps: int | str = "auto"
    if section.values.get("substeps") != "auto":
        substeps = _whole(section, "substeps", 1)
    return TimeIntegration(**_steps(section), substeps=substeps)


def _steps(section: Settings) -> dict[str, Any]:
    step = section.placed("step", positive_step, section.number("step"))
    line, column = section.values.places["step"]
    return {
        "step": step,
        "steps": section.placed("steps", number_of_steps, section.integer("steps")),
        "every": _whole(section, "every", 1),
        "place": f"{section.source}:{line}:{column}",
    }


def _whole(section: Settings, key: str, *default: int) -> int:
    return section.placed(key, whole_number, section.integer(key, *default), key)


def _integrator(section: Settings) -> ModelIntegrator:
    value = section.values["integrator"]
    name, numbers = value, []
    if isinstance(value, Object) and len(value) == 1:
        ((name, given),) = value.items()
        numbers = given if isinstance(given, list) else [given]
    if not isinstance(name, str) or not all(map(is_number, numbers)):
        raise section.error(
            "integrator",
            f'{section.name("integrator")} must be a name such as "newmark", or a name with its numbers such '
            f'as {{"hht": -0.05}}; got {shown(value)}',
        )
    return section.placed("integrator", integrator_of, name, numbers)


def _rayleigh(section: Settings) -> tuple[float, float]:
    values = section.numbers("rayleigh")
    if len(values) != 2 or min(values) < 0:
        raise section.error(
            "rayleigh", f"{section.name('rayleigh')} must be [α, β], both ≥ 0, in 1/s and s; got {values}"
        )
    return values[0], values[1]


def restart_of(section: Settings, folder: Path, outside: bool = False) -> str:
    """Return the file of the key ``restart``: a state from which to go on."""
    return str(find_file(section, "restart", folder, outside=outside)[0])


def load_of(section: Settings, key: str, make: Callable[[Settings, str], Load]) -> Load:
    """Return the load that `make` reads of a key, or one that changes in time.

    The latter is ``{"value": …, "amplitude": …}``: the value times a number or a time series.
    """
    if not isinstance(section.values[key], Object):
        return make(section, key)
    table = section.section(key)
    table.check_keys(("value", "amplitude"))
    return section.placed(key, ScaledLoad, make(table, "value"), number_or_series(table, "amplitude"))
