"""What the texts of options mean: numbers, vectors, fractions, steps, integrators and materials."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import isfinite
from typing import TYPE_CHECKING

from kratos_lite.errors import InputError, MaterialError, nearest
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.tabular import names_of

if TYPE_CHECKING:
    from kratos_lite.analysis.integrators import ModelIntegrator


def number(text: str, option: str) -> float:
    """Return a finite number or say which option holds what instead."""
    try:
        value = float(text) if "_" not in text else float("nan")
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(f"{option}: {text!r} is not a finite number such as 1.5 or 2e9")
    return value


def vector(text: str, option: str) -> list[float]:
    """Return three numbers.

    >>> vector("0,0,-9.81", "--gravity")
    [0.0, 0.0, -9.81]
    """
    words = text.split(",")
    if len(words) != 3:
        raise InputError(f"{option}: three numbers X,Y,Z are needed; got {text!r}")
    return [number(word, option) for word in words]


def fraction_of(text: str, what: str) -> float:
    """Return a fraction between 0 and 1, of a number or of percents.

    >>> fraction_of("2.5%", "--error"), fraction_of("0.01", "--error")
    (0.025, 0.01)
    """
    word = text.strip()
    try:
        fraction = number(word.removesuffix("%"), what) / (100 if word.endswith("%") else 1)
    except InputError:
        fraction = 0.0
    if not 0 < fraction < 1:
        raise InputError(f"{what} must be a fraction between 0 and 1, such as 1% or 0.01; got {text!r}")
    return fraction


LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
"""Units of length in m."""


def scale_of(text: str) -> float:
    """Return the factor from coordinates to m, of a number or a unit.

    >>> scale_of("mm"), scale_of("2.5")
    (0.001, 2.5)
    """
    return LENGTHS[text] if text in LENGTHS else number(text, f"--scale (or one of {', '.join(LENGTHS)})")


def numbers_of(text: str, option: str) -> list[float]:
    """Return numbers with commas between them; none of an empty text."""
    return [number(word, option) for word in text.split(",")] if text else []


def rayleigh_of(text: str) -> tuple[float, float]:
    """Return α in 1/s and β in s of Rayleigh damping."""
    values = numbers_of(text, "--rayleigh")
    if len(values) != 2 or min(values) < 0:
        raise InputError(f"--rayleigh: ALPHA,BETA, both ≥ 0, in 1/s and s are needed; got {text!r}")
    return values[0], values[1]


def steps_of(text: str) -> tuple[float, int, int]:
    """Return step, number of steps and every how many a state is kept of ``STEP:STEPS[:EVERY]``.

    >>> steps_of("1e-3:200:10")
    (0.001, 200, 10)
    """
    step, *counts = text.split(":")
    if len(counts) not in (1, 2) or not all(re.fullmatch("[0-9]{1,18}", count) for count in counts):
        raise InputError(f"--time: expected STEP:STEPS[:EVERY] such as 1e-3:200:10; got {text!r}")
    steps, every = (int(count) for count in (*counts, "1")[:2])
    return number(step, "--time"), steps, every


def integrator_of(text: str) -> ModelIntegrator:
    """Return the integrator of ``NAME[:NUMBERS]``.

    >>> str(integrator_of("hht:-0.1"))
    'hht(-0.1)'
    """
    from kratos_lite.analysis.integrators import INTEGRATORS  # a quick start of statics

    name, _, words = text.partition(":")
    numbers = numbers_of(words, "--integrator")
    if name not in INTEGRATORS:
        hint = nearest(name, INTEGRATORS)
        raise InputError(f"unknown integrator {name!r}.{hint} Known are {', '.join(INTEGRATORS)}")
    make: Callable[..., ModelIntegrator] = INTEGRATORS[name]
    counts = sorted({0, len(names_of(INTEGRATORS[name]))})
    if len(numbers) not in counts:
        raise InputError(f"{name} takes {' or '.join(map(str, counts))} numbers; got {len(numbers)}")
    return make(*numbers)


def rates_of(text: str, option: str) -> tuple[str | list[float], float, float]:
    """Return axis, rate and acceleration of ``AXIS:RATE[:ACCELERATION]``.

    >>> rates_of("z:-30:2.5", "--rotation")
    ('z', -30.0, 2.5)
    """
    axis, *numbers = text.split(":")
    if not axis or len(numbers) not in (1, 2):
        raise InputError(f"{option}: expected AXIS:RATE[:ACCELERATION] such as z:30; got {text!r}")
    rate, acceleration = (number(word, option) for word in (*numbers, "0")[:2])
    return vector(axis, option) if "," in axis else axis, rate, acceleration


def split_part(text: str, option: str, example: str) -> tuple[str, str]:
    """Split ``PART:rest`` at the last colon."""
    part, colon, rest = text.rpartition(":")
    if not (part and colon and rest):
        raise InputError(f"{option}: expected {example}; got {text!r}")
    return part, rest


def material_of(text: str) -> tuple[str | None, LinearMaterial]:
    """Return part (or None) and material of ``[PART:][LAW:]constant=value,…``.

    >>> material_of("steel:E=210e9,nu=0.3")
    ('steel', Isotropic3D(E=210000000000.0, nu=0.3, density=0.0))
    """
    option = f"--material {text}"
    *names, constants = text.split(":")
    part, law = None, "Isotropic3D"
    for name in names:
        if name in MATERIALS:
            law = name
        elif part is None:
            part = name
        else:
            laws = ", ".join(MATERIALS)
            raise InputError(f"{option}: {name!r} is no material; have {laws}.{nearest(name, MATERIALS)}")
    kind = MATERIALS[law]
    values: dict[str, float] = {}
    for pair in constants.split(","):
        key, equals, value = (word.strip() for word in pair.partition("="))
        variable = kind.variables.get(key, key)
        if not equals or variable not in kind.variables.values():
            raise InputError(f"{option}: constants of {law} are {', '.join(kind.variables)}; got {pair!r}")
        if variable in values:
            raise InputError(f"{option}: {key} is given twice")
        values[variable] = number(value, option)
    try:
        return part, kind.from_variables(values)
    except MaterialError as error:
        raise InputError(f"{option}: {error}") from None
