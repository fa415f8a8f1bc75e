"""Values of options: what their texts mean, by the forms that the help shows.

A reader raises InputError with the reason, or ValueError where a text is not of its form.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, pi
from typing import TYPE_CHECKING, Any

from kratos_lite.errors import InputError, nearest
from kratos_lite.tabular import names_of

if TYPE_CHECKING:
    from kratos_lite.analysis.integrators import ModelIntegrator
    from kratos_lite.materials import Material

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
"""Units of length in m."""


def number(text: str) -> float:
    """Return a finite number."""
    try:
        value = float(text) if "_" not in text else float("nan")
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(f"{text!r} is not a finite number such as 1.5 or 2e9")
    return value


def count(text: str) -> int:
    """Return a whole number ≥ 1."""
    if not (text.isascii() and text.isdigit() and len(text) < 19 and int(text)):
        raise InputError(f"a whole number ≥ 1 is needed; got {text!r}")
    return int(text)


def numbers(text: str) -> list[float]:
    """Return numbers with commas between them; none of an empty text."""
    return [number(word) for word in text.split(",")] if text else []


def vector(text: str) -> list[float]:
    """Return three numbers.

    >>> vector("0,0,-9.81")
    [0.0, 0.0, -9.81]
    """
    x, y, z = numbers(text)
    return [x, y, z]


def fraction(text: str) -> float:
    """Return a fraction between 0 and 1, of a number or of percents.

    >>> fraction("2.5%"), fraction("0.01")
    (0.025, 0.01)
    """
    word = text.strip()
    value = number(word.removesuffix("%")) / (100 if word.endswith("%") else 1)
    if not 0 < value < 1:
        raise ValueError
    return value


def scale(text: str) -> float:
    """Return the factor from coordinates to m, of a number or a unit.

    >>> scale("mm"), scale("2.5")
    (0.001, 2.5)
    """
    return LENGTHS[text] if text in LENGTHS else float(text)


def rayleigh(text: str) -> tuple[float, float]:
    """Return α in 1/s and β in s of Rayleigh damping."""
    alpha, beta = numbers(text)
    if min(alpha, beta) < 0:
        raise ValueError
    return alpha, beta


def steps(text: str) -> dict[str, Any]:
    """Return step, steps and every of ``STEP:STEPS[:EVERY]``.

    >>> steps("1e-3:200:10")
    {'step': 0.001, 'steps': 200, 'every': 10}
    """
    step, steps, every = text.split(":") if text.count(":") > 1 else [*text.split(":"), "1"]
    return {"step": number(step), "steps": count(steps), "every": count(every)}


def rates(text: str) -> tuple[str | list[float], float, float]:
    """Return axis, rate and acceleration of ``AXIS:RATE[:ACCELERATION]``.

    >>> rates("z:-30:2.5")
    ('z', -30.0, 2.5)
    """
    axis, rate, acceleration = text.split(":") if text.count(":") > 1 else [*text.split(":"), "0"]
    return vector(axis) if "," in axis else axis, number(rate), number(acceleration)


def displacement(text: str) -> tuple[str, float]:
    """Return axes and the value of ``xyz[=VALUE]``.

    >>> displacement("xy"), displacement("z=-1e-3")
    (('xy', 0.0), ('z', -0.001))
    """
    axes, equals, value = text.partition("=")
    return axes, number(value) if equals else 0.0


def parts(text: str) -> tuple[str, str]:
    """Return the two parts of ``PART:PART``.

    >>> parts("plate.z+:rib.z-")
    ('plate.z+', 'rib.z-')
    """
    one, other = text.split(":")
    return one, other


def remote_load(text: str) -> tuple[str, list[float], list[float], list[float]]:
    """Return part, point, force and moment of ``PART:X,Y,Z:FX,FY,FZ[,MX,MY,MZ]``.

    >>> remote_load("hole:0.3,0,0:0,0,-500,0,20,0")
    ('hole', [0.3, 0.0, 0.0], [0.0, 0.0, -500.0], [0.0, 20.0, 0.0])
    """
    part, point, words = text.rsplit(":", 2)
    *force, mx, my, mz = numbers(words if words.count(",") > 2 else f"{words},0,0,0")
    fx, fy, fz = force
    return part, vector(point), [fx, fy, fz], [mx, my, mz]


def temperature(text: str) -> list[float]:
    """Return temperature and reference of ``T[:REFERENCE]``.

    >>> temperature("120:20")
    [120.0, 20.0]
    """
    value, _, reference = text.partition(":")
    return [number(value), number(reference or "0")]


def section(text: str) -> tuple[str | tuple[str, float], str | None]:
    """Return the plane of ``[PART:]x=0.5`` and the part that it cuts, or a part to cut around.

    >>> section("bolt:y=-0.5"), section("hub")
    ((('y', -0.5), 'bolt'), ('hub', None))
    """
    plane, equals, offset = text.partition("=")
    part, _, axis = plane.rpartition(":")
    return ((axis, number(offset)), part or None) if equals else (text, None)


def integrator(text: str) -> ModelIntegrator:
    """Return the integrator of ``NAME[:NUMBERS]``.

    >>> str(integrator("hht:-0.1"))
    'hht(-0.1)'
    """
    from kratos_lite.analysis.integrators import INTEGRATORS  # a quick start of statics

    name, _, words = text.partition(":")
    kind, constants = INTEGRATORS[name], numbers(words)
    counts = sorted({0, len(names_of(kind))})
    if len(constants) not in counts:
        raise InputError(f"{name} takes {' or '.join(map(str, counts))} numbers; got {len(constants)}")
    return kind(*constants)


def material(text: str) -> tuple[str | None, Material]:
    """Return part (or None) and material of ``[PART:][LAW:]constant=value,…``.

    >>> material("steel:E=210e9,nu=0.3")
    ('steel', Isotropic3D(E=210000000000.0, nu=0.3, density=0.0, alpha=0.0))
    """
    from kratos_lite.materials import MATERIALS  # help and version do without NumPy

    *names, constants = text.split(":")
    laws = ["Isotropic3D", *(name for name in names if name in MATERIALS)]
    parts = [None, *(name for name in names if name not in MATERIALS)]
    if len(parts) > 2:
        hint = nearest(str(parts[-1]), MATERIALS)
        raise InputError(f"{parts[-1]!r} is no material; have {', '.join(MATERIALS)}.{hint}")
    law = MATERIALS[laws[-1]]
    variables = {field: law.variables.get(field, field) for field in names_of(law)}
    values: dict[str, float] = {}
    for pair in constants.split(","):
        key, equals, value = (word.strip() for word in pair.partition("="))
        variable = variables.get(key, key)
        if not equals or variable not in variables.values():
            form = "" if equals else ", where a constant and its value are needed, as E=210e9,nu=0.3 of steel"
            raise InputError(f"constants of {laws[-1]} are {', '.join(variables)}; got {pair!r}{form}")
        if variable in values:
            raise InputError(f"{key} is given twice")
        values[variable] = number(value)
    return parts[-1], law.from_variables(values)


def sweep(text: str) -> dict[str, Any]:
    """Return the options of a harmonic response, from the first frequency to the last in Hz.

    >>> sweep("0:10:3:2%")["frequencies"].round(2).tolist()
    [0.0, 31.42, 62.83]
    """
    from numpy import linspace

    low, high, many, *damping = text.split(":")
    omega = 2 * pi * linspace(number(low), number(high), count(many))
    return {"frequencies": omega, "damping": fraction(*damping) if damping else 0.0}


FORMS: dict[str, Callable[[str], Any]] = {
    "N": count,
    "T[:REFERENCE]": temperature,
    "NUMBER": number,
    "ALPHA": number,
    "P": number,
    "FACTOR": scale,
    "FRACTION": fraction,
    "X,Y,Z": vector,
    "xyz[=VALUE]": displacement,
    "PART:PART": parts,
    "PART:POINT:FORCE[,MOMENT]": remote_load,
    "[PART:][LAW:]E=…,nu=…": material,
    "AXIS:RATE[:ACCELERATION]": rates,
    "STEP:STEPS[:EVERY]": steps,
    "NAME[:NUMBERS]": integrator,
    "CUT": section,
    "ALPHA,BETA": rayleigh,
    "LOW:HIGH:COUNT[:DAMPING]": sweep,
}


def read(form: str, text: str) -> Any:
    """Return what a text of a form means; a text of an unknown form is taken as it is.

    >>> read("PART:X,Y,Z", "z+:0,0,-1e5")
    ('z+', [0.0, 0.0, -100000.0])
    """
    if form in FORMS or not form.startswith("PART:"):
        return FORMS.get(form, str)(text)
    part, _, rest = text.rpartition(":")
    if not (part and rest):
        raise ValueError
    return part, FORMS[form.removeprefix("PART:")](rest)
