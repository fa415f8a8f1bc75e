"""What the options of the command line add to the case of an input."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kratos_lite.analysis.model import Model
from kratos_lite.cli.option_texts import (
    fraction_of,
    integrator_of,
    material_of,
    number,
    rates_of,
    rayleigh_of,
    scale_of,
    split_part,
    steps_of,
    vector,
)
from kratos_lite.errors import InputError, nearest
from kratos_lite.io.case import Case, Outputs, TimeIntegration
from kratos_lite.io.files import read_case
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.model.loads import Load
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.nodal import PointLoad
from kratos_lite.model.loads.surface import Pressure, Resultant, Traction
from kratos_lite.validation import whole_number

if TYPE_CHECKING:
    from kratos_lite.ale import Motion

OF_TIME = ("integrator", "rayleigh", "lumped", "restart", "state", "steps")
"""Options that need a time integration."""
OF_MODELS = (
    *("material", "formulation", "fix", "gravity", "traction", "pressure", "point_load", "resultant"),
    *("modes", "solver", "tolerance", "error"),
    *("rotation", "translation", "center", "center_velocity", "center_acceleration", "stiffening"),
    *("boundaries", "damping", "moving_part"),
    *("integrator", "rayleigh", "lumped"),
)
"""Options that bodies do not have."""
NO_STATICS = "does not go with --backend petsc, which solves statics; leave one out"
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
    materials = [material_of(text) for text in options.material]
    everywhere = any(part is None for part, _ in materials)
    case = read_case(
        options.input,
        materials=not everywhere,
        strict=not options.lenient,
        linear=options.linear,
        scale=scale_of(options.scale or "1"),
        initial_displacement=not options.ignore_initial_displacement,
        part=part,
    )
    case.backend, case.petsc = options.backend or case.backend, options.petsc
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


def refuse(options: Namespace, names: tuple[str, ...], why: str) -> None:
    """Raise InputError for the first of some options that is given."""
    for name in names:
        if getattr(options, name) not in (None, False, []):
            raise InputError(f"--{name.replace('_', '-')} {why}")


def refuse_serial_options(options: Namespace) -> None:
    """Raise InputError, before a file is read, for options that do not go with PETSc, or without PETSc."""
    from kratos_lite.distributed.petsc import parsed, petsc

    refuse(options, ("modes", "time", "restart", "state", *OF_TIME, "rotation", "translation"), NO_STATICS)
    refuse(options, ("error",), "is for one process; leave it out, or --backend petsc")
    if Path(options.input).suffix.lower() == ".py":
        raise InputError(f"{options.input}: scripts are for one process; leave --backend petsc out")
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
        step, steps, every = steps_of(options.time)
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
        changes["integrator"] = integrator_of(options.integrator)
    if options.rayleigh:
        changes["rayleigh"] = rayleigh_of(options.rayleigh)
    if options.lumped:
        changes["lumped"] = True
    if options.restart:
        changes["restart"] = options.restart
    return replace(time, **changes)


LOADS: dict[str, tuple[Callable[[str, Any], Load], Callable[[str, str], Any], str]] = {
    "traction": (Traction, vector, "PART:X,Y,Z"),
    "pressure": (Pressure, number, "PART:P"),
    "point_load": (PointLoad, vector, "PART:X,Y,Z"),
    "resultant": (Resultant, vector, "PART:X,Y,Z"),
}


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

    rates = rates_of(text, option)
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
