"""What the options of the command line add to the case of an input."""

from __future__ import annotations

import re
from argparse import Namespace
from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kratos_lite.analysis.model import Model
from kratos_lite.errors import InputError, MaterialError, nearest
from kratos_lite.io.case import Case, Outputs, TimeIntegration
from kratos_lite.io.files import read_case
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.model.loads import Load
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.nodal import PointLoad
from kratos_lite.model.loads.surface import Pressure, Traction
from kratos_lite.tabular import names_of
from kratos_lite.validation import whole_number

if TYPE_CHECKING:
    from kratos_lite.ale import Motion
    from kratos_lite.analysis.integrators import ModelIntegrator

OF_TIME = ("integrator", "rayleigh", "lumped", "restart", "state", "steps")
"""Options that need a time integration."""
OF_MODELS = (
    *(
        "material",
        "formulation",
        "fix",
        "gravity",
        "traction",
        "pressure",
        "point_load",
        "modes",
        "solver",
        "tolerance",
        "error",
    ),
    *("rotation", "translation", "center", "center_velocity", "center_acceleration", "stiffening"),
    *("boundaries", "damping", "moving_part"),
    *("integrator", "rayleigh", "lumped"),
)
"""Options that bodies do not have."""
NO_STATICS = "does not go with --engine petsc, which solves statics; leave one out"
OWNERS = {
    **dict.fromkeys(("center", "center_velocity", "center_acceleration", "stiffening"), ("rotation",)),
    "boundaries": ("translation",),
    **dict.fromkeys(("damping", "moving_part"), ("rotation", "translation")),
}
"""Options of a motion, and those that they belong to."""


def case_of(options: Namespace, part: int | None = None) -> Case:
    """Return the case of an input and the options of the command line, which win where there is one value.

    `part` is the number of the part file to read, of a mesh in parts.
    """
    materials = [material(text) for text in options.material]
    everywhere = any(part is None for part, _ in materials)
    case = read_case(
        options.input,
        materials=not everywhere,
        strict=not options.lenient,
        initial_displacement=not options.ignore_initial_displacement,
        part=part,
    )
    case.engine, case.petsc = options.engine or case.engine, options.petsc
    if case.is_of_model:
        apply(case.model, options, materials)
        if options.solver:
            case.solver = options.solver
        if options.tolerance is not None:
            case.tolerance = options.tolerance
        if options.error is not None:
            case.error = fraction_of(options.error, "--error")
    else:
        refuse(options, OF_MODELS, f"is for models; {options.input} describes a body")
    case.time = _time(options, case.time)
    if case.is_of_model and case.time is not None:
        case.time = case.time.starting_from(case.model.supports, case.model.initial_displacement)
    _set_outputs(case.outputs, options)
    if options.modes is not None:
        _take_modes(case, options)
    return case


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


def refuse(options: Namespace, names: tuple[str, ...], why: str) -> None:
    """Raise InputError for the first of some options that is given."""
    for name in names:
        if getattr(options, name) not in (None, False, []):
            raise InputError(f"--{name.replace('_', '-')} {why}")


def refuse_serial_options(options: Namespace) -> None:
    """Raise InputError, before a file is read, for options that do not go with PETSc, or without PETSc."""
    from kratos_lite.distributed.petsc import parsed, petsc

    refuse(options, ("modes", "time", "restart", "state", *OF_TIME, "rotation", "translation"), NO_STATICS)
    refuse(options, ("error",), "is for one process; leave it out, or --engine petsc")
    if Path(options.input).suffix.lower() == ".py":
        raise InputError(f"{options.input}: scripts are for one process; leave --engine petsc out")
    parsed(options.petsc)
    petsc()


def _take_modes(case: Case, options: Namespace) -> None:
    """Ask a case for natural frequencies, whatever its file says of time and outputs."""
    if options.time is not None:
        raise InputError("--modes and --time: give one of them")
    refuse(options, ("json", "state"), "does not hold modes; -o OUT.pvd or OUT.html does")
    refuse(options, ("error",), "is for statics; modes are those of the mesh as it is")
    case.modes, case.time = whole_number(options.modes, "--modes"), None
    case.outputs = Outputs(options.output, picture=options.picture, mode=options.vtu)


def _set_outputs(outputs: Outputs, options: Namespace) -> None:
    """Let the files of the options take the place of those of the input."""
    for name in ("json", "picture", "state"):
        if (path := getattr(options, name)) is not None:
            setattr(outputs, name, path)
    outputs.results, outputs.mode = options.output or outputs.results, options.vtu


def _time(options: Namespace, of_file: TimeIntegration | None) -> TimeIntegration | None:
    """Return the time integration that the options and a file ask for."""
    time = of_file
    if options.time is not None:
        step, steps, every = _steps(options.time)
        time = (
            replace(of_file, step=step, steps=steps, every=every, place="")
            if of_file
            else TimeIntegration(step, steps, every)
        )
    if time is None:
        refuse(options, OF_TIME, "belongs to a time integration; add --time STEP:STEPS")
        return None
    refuse(
        options, ("solver", "tolerance", "error"), "is for statics; time integration chooses its own solver"
    )
    changes: dict[str, Any] = {}
    if options.steps is not None:
        changes["steps"] = whole_number(options.steps, "--steps")
    if options.integrator:
        changes["integrator"] = _integrator(options.integrator)
    if options.rayleigh:
        changes["rayleigh"] = _rayleigh(options.rayleigh)
    if options.lumped:
        changes["lumped"] = True
    if options.restart:
        changes["restart"] = options.restart
    return replace(time, **changes)


def _steps(text: str) -> tuple[float, int, int]:
    """Return step, number of steps and every how many a state is kept of ``STEP:STEPS[:EVERY]``.

    >>> _steps("1e-3:200:10")
    (0.001, 200, 10)
    """
    step, *counts = text.split(":")
    if len(counts) not in (1, 2) or not all(re.fullmatch("[0-9]{1,18}", count) for count in counts):
        raise InputError(f"--time: expected STEP:STEPS[:EVERY] such as 1e-3:200:10; got {text!r}")
    steps, every = (int(count) for count in (*counts, "1")[:2])
    return number(step, "--time"), steps, every


def _integrator(text: str) -> ModelIntegrator:
    """Return the integrator of ``NAME[:NUMBERS]``.

    >>> str(_integrator("hht:-0.1"))
    'hht(-0.1)'
    """
    from kratos_lite.analysis.integrators import INTEGRATORS  # a quick start of statics

    name, _, words = text.partition(":")
    numbers = _numbers(words, "--integrator")
    if name not in INTEGRATORS:
        hint = nearest(name, INTEGRATORS)
        raise InputError(f"unknown integrator {name!r}.{hint} Known are {', '.join(INTEGRATORS)}")
    make: Callable[..., ModelIntegrator] = INTEGRATORS[name]
    counts = sorted({0, len(names_of(INTEGRATORS[name]))})
    if len(numbers) not in counts:
        raise InputError(f"{name} takes {' or '.join(map(str, counts))} numbers; got {len(numbers)}")
    return make(*numbers)


def _numbers(text: str, option: str) -> list[float]:
    return [number(word, option) for word in text.split(",")] if text else []


def _rayleigh(text: str) -> tuple[float, float]:
    values = _numbers(text, "--rayleigh")
    if len(values) != 2 or min(values) < 0:
        raise InputError(f"--rayleigh: ALPHA,BETA, both ≥ 0, in 1/s and s are needed; got {text!r}")
    return values[0], values[1]


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


LOADS: dict[str, tuple[Callable[[str, Any], Load], Callable[[str, str], Any], str]] = {
    "traction": (Traction, vector, "PART:X,Y,Z"),
    "pressure": (Pressure, number, "PART:P"),
    "point_load": (PointLoad, vector, "PART:X,Y,Z"),
}


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


def _where(model: Model, part: str | None) -> str | int | None:
    """Return what a word before the constants of a material means: a part, a property id, or all."""
    if part is None or part in model.mesh.parts or (part[1:] in ("+", "-") and part[0] in "xyz"):
        return part
    if part.isdecimal():
        return int(part)
    laws, parts = ", ".join(MATERIALS), ", ".join(model.mesh.parts) or "none"
    hint = nearest(part, [*MATERIALS, *model.mesh.parts])
    raise InputError(f"--material: unknown law or part {part!r}; laws are {laws}, parts are {parts}.{hint}")


def motion(model: Model, options: Namespace) -> Motion | None:
    """Return the motion of the material that the options give, or None."""
    turns, passes = options.rotation, options.translation
    if (turns or passes) and model.motion is not None:
        raise InputError("--rotation, --translation: the file gives a motion already, and a model has one")
    if turns and passes:
        raise InputError("--rotation and --translation: a model has one motion; give one of them")
    for name, owners in OWNERS.items():
        if getattr(options, name) and not any(getattr(options, owner) for owner in owners):
            belongs = f"--{name.replace('_', '-')} belongs to {' or '.join(f'--{owner}' for owner in owners)}"
            raise InputError(f"{belongs}; give {'that' if len(owners) == 1 else 'one of them'} too")
    text, option = turns or passes, "--rotation" if turns else "--translation"
    if not text:
        return None
    from kratos_lite.ale import Rotation, Translation  # a quick start without motion

    rates = _rates(text, option)
    common: dict[str, Any] = {"damping": number(options.damping or "0", "--damping")}
    common["part"] = options.moving_part
    try:
        if passes:
            return Translation(*rates, boundaries=options.boundaries or "absorbing", **common)
        vectors = ("center", "center_velocity", "center_acceleration")
        given = {name: getattr(options, name) for name in vectors}
        common |= {name: vector(v, f"--{name.replace('_', '-')}") for name, v in given.items() if v}
        return Rotation(*rates, stiffening=options.stiffening, **common)
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


def apply(model: Model, options: Namespace, materials: list[tuple[str | None, LinearMaterial]]) -> None:
    """Add the materials, supports, loads and motion of the command line to a model."""
    if options.formulation is not None:
        try:
            model.formulation = options.formulation
        except InputError as error:
            raise InputError(f"--formulation: {error}") from None
    # the special wins over the general
    for part, law in sorted(materials, key=lambda pair: pair[0] is not None):
        model.assign(law, _where(model, part))
    for text in options.fix:
        part, rest = split_part(text, "--fix", "PART:axes or PART:axes=value")
        axes, equals, value = rest.partition("=")
        model.fix(part, axes, number(value, "--fix") if equals else 0.0)
    if options.gravity and any(isinstance(load, Gravity) for load in model.loads):
        model.notes.append("--gravity is added to the gravity of the file")
    for text in options.gravity:
        model.add(Gravity(vector(text, "--gravity")))
    for name, (load, read, example) in LOADS.items():
        option = f"--{name.replace('_', '-')}"
        for text in getattr(options, name):
            part, rest = split_part(text, option, example)
            model.add(load(part, read(rest, option)))
    if (given_motion := motion(model, options)) is not None:
        model.add(given_motion)
