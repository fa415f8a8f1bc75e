"""Options of the command line that describe a model: materials, supports and loads in words."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING, Any

from kratos_lite.errors import InputError

if TYPE_CHECKING:
    from kratos_lite.ale import Motion
    from kratos_lite.analysis.model import Model
    from kratos_lite.materials import LinearMaterial

MARCHING = ("scheme", "rayleigh", "lumped", "restart", "state")
"""Options that say how a model marches."""


def number(text: str, option: str) -> float:
    """Return a finite number or say which option holds what instead."""
    from math import isfinite

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


def split_part(text: str, option: str, example: str) -> tuple[str, str]:
    """Split ``PART:rest`` at the last colon."""
    part, colon, rest = text.rpartition(":")
    if not (part and colon and rest):
        raise InputError(f"{option}: expected {example}; got {text!r}")
    return part, rest


def material(text: str) -> tuple[str | None, LinearMaterial]:
    """Return part (or None) and material of ``[PART:][LAW:]constant=value,…``.

    >>> material("steel:E=210e9,nu=0.3")
    ('steel', Isotropic3D(E=210000000000.0, nu=0.3, density=0.0))
    """
    from kratos_lite.errors import nearest
    from kratos_lite.materials import MATERIALS

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
    kind: Any = MATERIALS[law]
    known = list(kind.variables)
    values: dict[str, float] = {}
    for pair in constants.split(","):
        key, equals, value = pair.partition("=")
        field = {v: k for k, v in kind.variables.items()}.get(key.strip(), key.strip())
        if not equals or field not in known:
            raise InputError(f"{option}: constants of {law} are {', '.join(known)}; got {pair!r}")
        if field in values:
            raise InputError(f"{option}: {field} is given twice")
        values[field] = number(value, option)
    missing = [k for k in known if k not in values and k != "density"]
    if missing:
        raise InputError(f"{option}: {law} also needs {', '.join(missing)}")
    return part, kind(**values)


def _where(model: Model, part: str | None) -> str | int | None:
    """Return what a word before the constants of a material means: a part, a property id, or all."""
    from kratos_lite.errors import nearest
    from kratos_lite.materials import MATERIALS

    if part is None or part in model.mesh.parts or (part[1:] in ("+", "-") and part[0] in "xyz"):
        return part
    if part.isdecimal():
        return int(part)
    laws, parts = ", ".join(MATERIALS), ", ".join(model.mesh.parts) or "none"
    hint = nearest(part, [*MATERIALS, *model.mesh.parts])
    raise InputError(f"--material: unknown law or part {part!r}; laws are {laws}, parts are {parts}.{hint}")


def motion(model: Model, options: Namespace) -> Motion | None:
    """Return the motion of the material that the options give, or None."""
    from kratos_lite.ale import Rotation, Translation

    turns, passes = options.rotation, options.translation
    if (turns or passes) and model.motion is not None:
        raise InputError("--rotation, --translation: the file gives a motion already, and a model has one")
    if turns and passes:
        raise InputError("--rotation and --translation: a model has one motion; give one of them")
    for option, owner in (("center", "rotation"), ("stiffening", "rotation"), ("boundaries", "translation")):
        if getattr(options, option) and not getattr(options, owner):
            raise InputError(f"--{option} belongs to --{owner}; give that too")
    text, option = turns or passes, "--rotation" if turns else "--translation"
    if not text:
        if options.damping:
            raise InputError("--damping belongs to --rotation or --translation; give one of them too")
        return None
    rates, damping = _rates(text, option), number(options.damping or "0", "--damping")
    try:
        if passes:
            return Translation(*rates, boundaries=options.boundaries or "absorbing", damping=damping)
        center = vector(options.center, "--center") if options.center else (0.0, 0.0, 0.0)
        return Rotation(*rates, center=center, stiffening=options.stiffening, damping=damping)
    except InputError as error:
        raise InputError(f"{option} {text}: {error}") from None


def _rates(text: str, option: str) -> tuple[str | list[float], float, float]:
    """Return axis, rate and acceleration of ``AXIS:RATE[:ACCELERATION]``.

    >>> _rates("z:-30:2.5", "--rotation")
    ('z', -30.0, 2.5)
    """
    axis, *numbers = text.split(":")
    if not axis or len(numbers) not in (1, 2):
        raise InputError(f"{option}: expected AXIS:RATE[:ACCELERATION] such as z:30; got {text!r}")
    rate, acceleration = (number(word, option) for word in (*numbers, "0")[:2])
    return vector(axis, option) if "," in axis else axis, rate, acceleration


def apply(model: Model, options: Namespace) -> None:
    """Add the materials, supports and loads of the command line to a model."""
    from kratos_lite.model.loads import Gravity, PointLoad, Pressure, Traction

    given = [material(text) for text in options.material]
    for part, law in sorted(given, key=lambda pair: pair[0] is not None):  # the special wins over the general
        model.assign(law, _where(model, part))
    for text in options.fix:
        part, rest = split_part(text, "--fix", "PART:axes or PART:axes=value")
        axes, equals, value = rest.partition("=")
        model.fix(part, axes, number(value, "--fix") if equals else 0.0)
    if options.gravity and any(isinstance(load, Gravity) for load in model.loads):
        model.notes.append("--gravity is added to the gravity of the file")
    for text in options.gravity:
        model.add(Gravity(vector(text, "--gravity")))
    for text in options.traction:
        part, rest = split_part(text, "--traction", "PART:X,Y,Z")
        model.add(Traction(part, vector(rest, "--traction")))
    for text in options.pressure:
        part, rest = split_part(text, "--pressure", "PART:P")
        model.add(Pressure(part, number(rest, "--pressure")))
    for text in options.point_load:
        part, rest = split_part(text, "--point-load", "PART:X,Y,Z")
        model.add(PointLoad(part, vector(rest, "--point-load")))
    if (given_motion := motion(model, options)) is not None:
        model.add(given_motion)


def marches(options: Namespace) -> bool:
    """Whether a march is asked for by the options or by a run file."""
    from kratos_lite.io.documents import ending

    if options.march is not None:
        return True
    if ending(options.input) == ".json":
        from kratos_lite.io.project import is_in_time

        if is_in_time(options.input):
            return True
    for name in MARCHING:
        if getattr(options, name):
            raise InputError(f"--{name} belongs to a march; add --march STEP:STEPS")
    return False
