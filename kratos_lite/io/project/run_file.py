"""Run files in JSON: our own small ones, and ``ProjectParameters.json`` of Kratos."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

from kratos_lite.analysis.model import Model
from kratos_lite.errors import InputError, KratosLiteError, Problems
from kratos_lite.io.documents import ending, read_document
from kratos_lite.io.json_file import Object
from kratos_lite.io.kratos.to_model import model_from
from kratos_lite.io.project.ale import add_motion, number_or_series
from kratos_lite.io.project.march import NO_RESULT, SERIES, march_of, varying
from kratos_lite.io.project.settings import Settings, find_file, inside, read_settings, shown
from kratos_lite.io.scene import Scene
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.model.loads import BodyForce, Gravity, Load, PointLoad, Pressure, TimeDependentLoad, Traction

SOLVERS = ("auto", "dense", "direct", "amg")
OUTPUTS = ("output", "json", "picture")
LOADS: dict[str, Callable[[str, Any], Load]] = {
    "traction": Traction,
    "pressure": Pressure,
    "point_load": PointLoad,
}
KEYS = ("model", "material", "fix", "gravity", *LOADS, "ale", "time", "solver", "tolerance", *OUTPUTS)


def read_project(path: str | Path, *, allow_outside: bool = False) -> Scene:
    """Return the project of a run file: Kratos' ``ProjectParameters.json``, or our own.

    Our own has the keys `model` (a mesh file), `material` (``{"law", "E", "nu", "density"}``, or one
    for each part), `fix` (``{part: "xyz"}`` or ``{part: {"x": 0.001}}``, m), `gravity` (m/s²),
    `traction` and `pressure` by part (Pa), `point_load` by part (N on each node), `ale` (a motion of the
    material, see `add_motion`), `time` (a march, see `march_of`), `solver` (``{"type", "tolerance"}``),
    `tolerance`, and the files to write: `output`, `json`, `picture`.  A prescribed displacement may be
    ``{"times": […], "values": […]}``, a load ``{"value": …, "times": […], "factors": […]}``.

    Parameters
    ----------
    path : the run file; all files it names lie in its folder.
    allow_outside : let it name files elsewhere.

    Raises
    ------
    InputError, MeshError, ModelError
        With file, line, column and cure of what is wrong.
    """
    settings, folder = read_settings(path), Path(path).parent
    if "solver_settings" in settings or "problem_data" in settings:
        from kratos_lite.io.kratos.run_file import read_kratos_project

        return read_kratos_project(settings, folder, allow_outside)
    if "properties" in settings and "model" not in settings:
        raise settings.error("properties", "this is a materials file; read the run file that names it")
    return _read_own(settings, folder, allow_outside)


def is_in_time(path: str | Path) -> bool:
    """Return whether a run file asks for a march, without reading what it names."""
    from kratos_lite.io.kratos.time_integration import DYNAMIC

    values = read_settings(path).values
    if "solver_settings" not in values and "problem_data" not in values:
        return "time" in values
    solver = values.get("solver_settings")
    return isinstance(solver, Object) and solver.get("solver_type") in DYNAMIC


def _read_own(settings: Settings, folder: Path, outside: bool) -> Scene:
    problems = Problems()
    for key in settings.unknown(KEYS):
        problems.add(str(settings.error(key, settings.unknown_key(key, KEYS))))
    solver, tolerance = problems.of(_solver, settings) or ("auto", 0.0)
    output = problems.of(_outputs, settings, folder, outside)
    path = problems.of(_model_path, settings, folder, outside)
    sections = {key: problems.of(settings.section, key) for key in ("material", "fix", *LOADS)}
    gravity = problems.of(_gravity, settings) if "gravity" in settings else None
    march = problems.of(march_of, settings, folder, outside)
    problems.of(_check_outputs, settings)
    problems.raise_if_any()
    material = sections["material"]
    model = model_from(read_document(path), materials=not material.values or _is_by_part(material))
    _assign(model, material, problems)
    for part in sections["fix"].values:
        problems.of(_fix, model, sections["fix"], part)
    for key, load in LOADS.items():
        for part in sections[key].values:
            problems.of(_load, model, sections[key], part, load)
    if gravity is not None:
        _add_gravity(model, gravity)
    problems.of(add_motion, model, settings)
    problems.raise_if_any()
    if march is None and _changes(model):
        model.notes.append("what changes with the time is that at t = 0, unless the model marches")
    return Scene(model, solver, tolerance, output, march=march)


def _changes(model: Model) -> bool:
    """Whether loads or supports change with the time."""
    return bool(model.supports.motions) or any(isinstance(load, TimeDependentLoad) for load in model.loads)


def _gravity(settings: Settings) -> Load:
    return varying(settings, "gravity", lambda owner, key: Gravity(owner.vector(key)))


def _add_gravity(model: Model, gravity: Load) -> None:
    """Add gravity, and note what the mesh file has of its kind already."""
    for load in model.loads:
        if isinstance(load, BodyForce):
            name = "VOLUME_ACCELERATION" if isinstance(load, Gravity) else "BODY_FORCE"
            place = "the nodes" if load.where is None else f"Properties {load.where}"
            model.notes.append(f"gravity is added to the {name} of {place} in the mesh file")
    model.add(gravity)


def _model_path(settings: Settings, folder: Path, outside: bool) -> Path:
    path, note = find_file(settings, "model", folder, outside=outside)
    if note:
        raise settings.error("model", f"model: {note}; correct the path")
    if ending(path) == ".json":
        raise settings.error("model", f"model must be a mesh file such as .mdpa; got {path.name}")
    return path


def _solver(settings: Settings) -> tuple[str, float]:
    solver = settings.section("solver")
    solver.check_keys(("type", "tolerance"))
    kind = solver.text("type", "auto")
    if kind not in SOLVERS:
        raise solver.error("type", f"solver.type must be one of {', '.join(SOLVERS)}; got {kind!r}")
    if "tolerance" in settings and "tolerance" in solver:
        raise settings.error("tolerance", "tolerance is given twice, also in 'solver'; keep one")
    owner = settings if "tolerance" in settings else solver
    tolerance = owner.number("tolerance", 1e-10)
    if not 0 < tolerance < 1:
        raise owner.error("tolerance", f"tolerance must lie between 0 and 1; got {tolerance:g}")
    return kind, tolerance


def _outputs(settings: Settings, folder: Path, outside: bool) -> dict[str, str]:
    found = {}
    for key in OUTPUTS:
        if key in settings:
            name = settings.text(key)
            try:
                found[key] = str(inside(folder, name, outside))
            except ValueError as error:
                raise settings.error(key, f"{key}: {error}") from None
    return found


def _check_outputs(settings: Settings) -> None:
    """Refuse files that hold no march, where there is one."""
    if "time" in settings and "output" in settings:
        name = settings.text("output")
        if Path(name).suffix.lower() not in SERIES:
            raise settings.error("output", f"output: {NO_RESULT.format(name)}")


def _is_by_part(material: Settings) -> bool:
    return any(isinstance(value, Object) for value in material.values.values())


def _assign(model: Model, section: Settings, problems: Problems) -> None:
    if not _is_by_part(section):
        material = problems.of(read_material, section) if section.values else None
        if material is not None:
            model.assign(material)
        return
    for part in section.values:
        problems.of(_assign_part, model, section, part)


def _assign_part(model: Model, section: Settings, part: str) -> None:
    _at(section, part, model.assign, read_material(section.section(part)), part)


def read_material(section: Settings) -> LinearMaterial:
    """Return the material of an object; InputError with the place of a mistake."""
    law = section.text("law", "Isotropic3D")
    try:
        kind = MATERIALS[law]
    except InputError as error:
        raise section.error("law", str(error)) from None
    names = [item.name for item in fields(kind)]  # type: ignore[arg-type]
    section.check_keys(["law", *names])
    missing = [name for name in names if name not in section and name != "density"]
    if missing:
        raise section.error("", f"{section.path}: {law} needs {', '.join(missing)}")
    try:
        return kind(**{name: section.number(name) for name in names if name in section})
    except InputError:
        raise
    except KratosLiteError as error:
        raise section.error("", f"{section.path}: {error}") from None


def _at(section: Settings, key: str, action: Callable[..., Any], *arguments: Any) -> None:
    """Call something; give an error of the model the place of a key."""
    try:
        action(*arguments)
    except KratosLiteError as error:
        raise section.error(key, f"{section.name(key)}: {error}") from None


def _fix(model: Model, section: Settings, part: str) -> None:
    value = section.values[part]
    if isinstance(value, str):
        _at(section, part, model.fix, part, value)
        return
    if not isinstance(value, Object):
        raise section.error(
            part, f'{section.name(part)} must be axes such as "xz" or {{"x": 0.001}}; got {shown(value)}'
        )
    axes = section.section(part)
    axes.check_keys(("x", "y", "z"))
    for axis in axes.values:
        _at(axes, axis, model.fix, part, axis, number_or_series(axes, axis))


def _load(model: Model, section: Settings, part: str, load: Callable[[str, Any], Load]) -> None:
    def of_value(owner: Settings, key: str) -> Load:
        return load(part, owner.number(key) if load is Pressure else owner.vector(key))

    made = varying(section, part, of_value)
    _at(section, part, model.mesh.part, part)
    model.add(made)
