"""What the options of the command line change of the case of an input."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kratos_lite.analysis.model import Model
from kratos_lite.cli.options import OF_A_CASE, only
from kratos_lite.errors import InputError, nearest
from kratos_lite.io.case import Case, Outputs, TimeIntegration
from kratos_lite.io.files import read_case
from kratos_lite.io.kratos.context import Omission
from kratos_lite.materials import MATERIALS
from kratos_lite.model.loads import Load, ScaledLoad
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.nodal import PointLoad
from kratos_lite.model.loads.surface import Pressure, Resultant, Traction
from kratos_lite.model.loads.temperature import Temperature

if TYPE_CHECKING:
    from kratos_lite.ale import Motion

LOADS = {"traction": Traction, "pressure": Pressure, "point_load": PointLoad, "resultant": Resultant}
"""Options of loads on parts."""


MODAL = ("modes", "buckling", "harmonic", "time")
"""Options that say which analysis is done."""


def case_of(options: Namespace, part: int | None = None) -> Case:
    """Return the case of an input and the options of the command line, which win where there is one value.

    `part` is the number of the part file to read, of a mesh in parts.
    """
    if options.units is not None:
        refuse(options, ["scale"], "makes a mesh one in m, which --units contradicts; give one of them")
    case = read_case(
        options.input,
        materials=all(where is not None for where, _ in options.material),
        strict=not options.lenient,
        initial_displacement=not options.ignore_initial_displacement,
        part=part,
        **given(options, "linear", "scale"),
    )
    if case.then:
        refuse(options, MODAL, "does not go with a file of several steps")
    for number, each in enumerate((case, *case.then), 1):
        _apply(each, options, f"-{number}" if case.then else "")
        if options.strict and (omitted := omitted_of(each)):
            raise InputError(
                "\n".join([f"{options.input}: --strict: not everything requested is done:", *omitted])
            )
    return case


def omitted_of(case: Case) -> list[str]:
    """Return the notes on what a run file requests, and is not done."""
    return [n for n in case.model.notes if isinstance(n, Omission)] if case.is_of_model else []


def _apply(case: Case, options: Namespace, mark: str) -> None:
    """Change a case as the options say; the names of its outputs get a mark."""
    for name, value in given(
        options, "solver", "tolerance", "error", "most_unknowns", "backend", "petsc"
    ).items():
        setattr(case, name, value)
    if case.is_of_model:
        _add_to_model(case.model, options)
    else:
        refuse(options, only("models"), f"is for models; {options.input} describes a body")
    case.time = _time(options, case.time)
    if case.is_of_model and case.time is not None:
        case.time = case.time.starting_from(case.model.supports, case.model.initial_displacement)
    if given(options, "modes", "buckling", "harmonic"):
        _take_modes(case, options)
    for name, path in given(options, "json", "picture", "state").items():
        setattr(case.outputs, name, _marked(path, mark))
    case.outputs.sections = options.section
    results = [_marked(path, mark) for path in options.output]
    if mark and (case.modes or case.time or case.harmonic):  # the other steps are at rest
        of = ".csv" if case.harmonic else ".pvd"
        results = [str(Path(path).with_suffix(of)) if path.endswith(".vtu") else path for path in results]
    case.outputs.results, case.outputs.mode = results or case.outputs.results, options.vtu


def _marked(path: str, mark: str) -> str:
    """Return a path with a mark before its ending.

    >>> _marked("out/part.vtu", "-2")
    'out/part-2.vtu'
    """
    return f"{Path(path).with_suffix('')}{mark}{Path(path).suffix}" if mark else path


def given(options: Namespace, *names: str) -> dict[str, Any]:
    """Return those of some options that are given, by their names."""
    values = ((name, getattr(options, name)) for name in names)
    return {name: value for name, value in values if not (value is None or value is False or value == [])}


def refuse(options: Namespace, names: Iterable[str], why: str) -> None:
    """Raise InputError for the first of some options that is given."""
    for name in given(options, *names):
        raise InputError(f"--{name.replace('_', '-')} {why}")


def refuse_serial_options(options: Namespace) -> None:
    """Raise InputError, before a file is read, for options that do not go with PETSc, or without PETSc."""
    from kratos_lite.distributed.petsc import parsed, petsc

    why = "does not go with --backend petsc, which solves statics; leave one out"
    refuse(options, (*MODAL, *only("time"), "rotation", "translation"), why)
    refuse(options, ("error",), "is for one process; leave it out, or --backend petsc")
    if Path(options.input).suffix.lower() == ".py":
        raise InputError(f"{options.input}: scripts are for one process; leave --backend petsc out")
    parsed(options.petsc)
    petsc()


def _take_modes(case: Case, options: Namespace) -> None:
    """Ask a case for modes, buckling or a harmonic response, whatever its file says of time and outputs."""
    (name, value), *others = given(options, *MODAL).items()
    if others:
        raise InputError(f"--{name} and --{others[0][0]}: give one of them")
    other = ("state", *(["json"] if name == "harmonic" else []))
    refuse(options, other, "does not hold modes or responses; -o OUT does")
    refuse(options, ("error",), "is for statics; modes are those of the mesh as it is")
    if case.is_of_model and case.time is not None and case.time.quasi_static is not None:
        _hold_at(case.model, case.time.end)
    case.time, case.above, case.outputs, case.buckling = None, None, Outputs(), name == "buckling"
    case.modes, case.harmonic = (0, value) if name == "harmonic" else (value, None)


def _hold_at(model: Model, time: float) -> None:
    """Give a model the supports and loads that it has at a time in s, as constant ones."""
    model.supports = model.supports.at(time)
    acting = (pair for load in model.loads for pair in load.acting(time))
    model.loads = [_times(size, load) for size, load in acting]
    model.notes.append(f"supports and loads are those at t = {time:g} s, the end of the steps")


def _times(size: float, load: Load) -> Load:
    return load if size == 1 else ScaledLoad(load, lambda _: size)


def _time(options: Namespace, of_file: TimeIntegration | None) -> TimeIntegration | None:
    """Return the time integration that the options and a file ask for."""
    time = of_file
    if options.time is not None:
        time = (
            replace(of_file, **options.time, place="", sizes=())
            if of_file
            else TimeIntegration(**options.time)
        )
    if time is None:
        refuse(options, only("time"), "belongs to a time integration; add --time STEP:STEPS")
        return None
    refuse(options, only("statics"), "is for statics; time integration chooses its own solver")
    return replace(time, **given(options, "steps", "integrator", "rayleigh", "lumped", "restart"))


def _add_to_model(model: Model, options: Namespace) -> None:
    """Add the units, materials, supports, loads and motion of the command line to a model."""
    if options.units not in (None, "auto"):
        model.mesh.use_units(options.units)
    if options.formulation is not None:
        try:
            model.formulation = options.formulation
        except InputError as error:
            raise InputError(f"--formulation: {error}") from None
    # the special wins over the general
    for part, law in sorted(options.material, key=lambda pair: pair[0] is not None):
        model.assign(law, _where(model, part))
    if options.units == "auto":
        model.recognize_units()
    for part, (axes, value) in options.fix:
        model.fix(part, axes, value)
    for part in options.symmetry:
        model.symmetry(part)
    for one, other in options.tie:
        model.tie(one, other)
    _add_loads(model, options)
    if motions := given(options, "rotation", "translation"):
        model.add(_motion(model, options, *motions))


def _add_loads(model: Model, options: Namespace) -> None:
    """Add the loads of the command line to a model."""
    if options.gravity and any(isinstance(load, Gravity) for load in model.loads):
        model.notes.append("--gravity is added to the gravity of the file")
    for acceleration in options.gravity:
        model.add(Gravity(acceleration))
    for name, load in LOADS.items():
        for part, value in getattr(options, name):
            model.add(load(part, value))
    for name, follow in (("remote", model.distribute), ("rigid", model.rigid)):
        for part, point, force, moment in getattr(options, name):
            model.add(follow(part, point).load(force, moment))
    for value, reference in options.temperature:
        model.add(Temperature(value, reference))


def _where(model: Model, part: str | None) -> str | int | None:
    """Return what a word before the constants of a material means: a part, a property id, or all."""
    if part is None or part in model.mesh.parts or (part[1:] in ("+", "-") and part[0] in "xyz"):
        return part
    if part.isdecimal():
        return int(part)
    laws, parts = ", ".join(MATERIALS), ", ".join(model.mesh.parts) or "none"
    hint = nearest(part, [*MATERIALS, *model.mesh.parts])
    raise InputError(f"--material: unknown law or part {part!r}; laws are {laws}, parts are {parts}.{hint}")


def _motion(model: Model, options: Namespace, name: str, second: str = "") -> Motion:
    """Return the motion of the material that the options give."""
    if model.motion is not None:
        raise InputError("--rotation, --translation: the file gives a motion already, and a model has one")
    if second:
        raise InputError("--rotation and --translation: a model has one motion; give one of them")
    from kratos_lite.ale import Rotation, Translation  # a quick start without motion

    settings = given(options, *(option.dest for option in OF_A_CASE if name in option.needs))
    settings["part"] = settings.pop("moving_part", None)
    try:
        return {"rotation": Rotation, "translation": Translation}[name](*getattr(options, name), **settings)
    except InputError as error:
        raise InputError(f"--{name}: {error}") from None
