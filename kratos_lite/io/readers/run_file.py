"""Run files of kratos_lite in JSON: a mesh file with materials, supports, loads and an analysis."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from kratos_lite.analysis.model import Model
from kratos_lite.errors import Problems
from kratos_lite.io.case import Case, Outputs
from kratos_lite.io.formats import ending, read_document
from kratos_lite.io.json_file import Object
from kratos_lite.io.kratos.to_model import model_from
from kratos_lite.io.readers.motion import add_motion
from kratos_lite.io.readers.time import load_of, read_time
from kratos_lite.io.readers.values import is_by_part, number_or_series, read_material
from kratos_lite.io.settings import Settings, find_file, inside, shown
from kratos_lite.io.writers.endings import check_series
from kratos_lite.model.loads import Load, TimeDependentLoad
from kratos_lite.model.loads.body import BodyForce, Gravity
from kratos_lite.model.loads.nodal import PointLoad
from kratos_lite.model.loads.surface import Pressure, Traction
from kratos_lite.solvers.linear_solver import METHODS

OUTPUTS = ("output", "json", "picture")
LOADS: dict[str, Callable[[str, Any], Load]] = {
    "traction": Traction,
    "pressure": Pressure,
    "point_load": PointLoad,
}
KEYS = (
    "model",
    "formulation",
    "material",
    "fix",
    "gravity",
    *LOADS,
    "ale",
    "time",
    "solver",
    "tolerance",
    *OUTPUTS,
)


def read_run_file(
    settings: Settings,
    *,
    strict: bool = True,
    allow_outside: bool = False,
    initial_displacement: bool = True,
) -> Case:
    """Return the case of a run file of kratos_lite.

    It has the keys `model` (a mesh file), `formulation` (of its elements, as of `Model`), `material`
    (``{"law", "E", "nu", "density"}``, or one for each part), `fix` (``{part: "xyz"}`` or
    ``{part: {"x": 0.001}}``, m), `gravity` (m/s²), `traction` and `pressure` by part (Pa), `point_load` by
    part (N on each node), `ale` (a motion of the material, see `add_motion`), `time` (see `read_time`),
    `solver` (``{"type", "tolerance"}``), `tolerance`, and the files to write: `output`, `json`, `picture`.  A
    prescribed displacement may be ``{"times": […], "values": […]}``, a load ``{"value": …, "amplitude": …}``.

    Parameters
    ----------
    settings : the file; all files that it names lie in its folder.
    strict, initial_displacement : as of `kratos_lite.read`, for its mesh.
    allow_outside : let it name files elsewhere.

    Raises
    ------
    InputError, MeshError, ModelError
        With file, line, column and cure of what is wrong.
    """
    folder, problems = Path(settings.source).parent, Problems()
    for key in settings.unknown(KEYS):
        problems.add(str(settings.error(key, settings.unknown_key(key, KEYS))))
    solver, tolerance = problems.of(_solver, settings) or ("auto", 0.0)
    outputs = problems.of(_outputs, settings, folder, allow_outside)
    path = problems.of(_mesh_file, settings, folder, allow_outside)
    sections = {key: problems.of(settings.section, key) for key in ("material", "fix", *LOADS)}
    gravity = problems.of(_gravity, settings) if "gravity" in settings else None
    time = problems.of(lambda: read_time(settings, folder, outside=allow_outside))
    problems.raise_if_any()
    given = sections["material"]
    document = read_document(path, strict=strict)
    by_file = not given.values or is_by_part(given)
    model = model_from(document, materials=by_file, initial_displacement=initial_displacement)
    problems.of(_choose_formulation, model, settings)
    _assign(model, given, problems)
    for part in sections["fix"].values:
        problems.of(_fix, model, sections["fix"], part)
    for key, load in LOADS.items():
        for part in sections[key].values:
            problems.of(_load, model, sections[key], part, load)
    if gravity is not None:
        _add_gravity(model, gravity)
    problems.of(add_motion, model, settings)
    problems.raise_if_any()
    if time is None and _changes(model):
        model.notes.append("loads and supports that change in time are taken at t = 0")
    time = time and time.starting_from(model.supports, model.initial_displacement)
    return Case(model, time, 0, solver, tolerance, outputs=outputs, files=settings.files)


def _choose_formulation(model: Model, settings: Settings) -> None:
    if "formulation" in settings:
        word = settings.text("formulation")
        settings.placed("formulation", setattr, model, "formulation", word)


def _changes(model: Model) -> bool:
    """Whether loads or supports change in time."""
    return bool(model.supports.motions) or any(isinstance(load, TimeDependentLoad) for load in model.loads)


def _gravity(settings: Settings) -> Load:
    return load_of(settings, "gravity", lambda owner, key: owner.placed(key, Gravity, owner.vector(key)))


def _add_gravity(model: Model, gravity: Load) -> None:
    """Add gravity, and note what the mesh file has of its kind already."""
    for load in model.loads:
        if isinstance(load, BodyForce):
            name = "VOLUME_ACCELERATION" if isinstance(load, Gravity) else "BODY_FORCE"
            place = "the nodes" if load.where is None else f"Properties {load.where}"
            model.notes.append(f"gravity is added to the {name} of {place} in the mesh file")
    model.add(gravity)


def _mesh_file(settings: Settings, folder: Path, outside: bool) -> Path:
    return mesh_file_of(settings, "model", folder, outside)


def mesh_file_of(settings: Settings, key: str, folder: Path, outside: bool = False) -> Path:
    """Return the path of the mesh file that a key names."""
    path, note = find_file(settings, key, folder, outside=outside)
    if note:
        raise settings.error(key, f"{key}: {note}; correct the path")
    if ending(path) == ".json":
        raise settings.error(key, f"{key} must be a mesh file such as .mdpa; got {path.name}")
    return path


def _solver(settings: Settings) -> tuple[str, float]:
    solver = settings.section("solver")
    solver.check_keys(("type", "tolerance"))
    kind = solver.text("type", "auto")
    if kind not in METHODS:
        raise solver.error("type", f"solver.type must be one of {', '.join(METHODS)}; got {kind!r}")
    if "tolerance" in settings and "tolerance" in solver:
        raise settings.error("tolerance", "tolerance is given twice, also in 'solver'; keep one")
    owner = settings if "tolerance" in settings else solver
    tolerance = owner.number("tolerance", 1e-10)
    if not 0 < tolerance < 1:
        raise owner.error("tolerance", f"tolerance must lie between 0 and 1; got {tolerance:g}")
    return kind, tolerance


def _outputs(settings: Settings, folder: Path, outside: bool) -> Outputs:
    found = {key: output_of(settings, key, folder, outside) for key in OUTPUTS if key in settings}
    if "time" in settings and "output" in settings:
        settings.placed("output", check_series, settings.text("output"))
    results = [found.pop("output")] if "output" in found else []
    return Outputs(results, **found)


def output_of(settings: Settings, key: str, folder: Path, outside: bool = False) -> str:
    """Return the path of the output that a key names."""
    try:
        return str(inside(folder, settings.text(key), outside))
    except ValueError as error:
        raise settings.error(key, f"{settings.name(key)}: {error}") from None


def _assign(model: Model, section: Settings, problems: Problems) -> None:
    if is_by_part(section):
        for part in section.values:
            problems.of(_assign_part, model, section, part)
    elif section.values and (one := problems.of(read_material, section)) is not None:
        model.assign(one)


def _assign_part(model: Model, section: Settings, part: str) -> None:
    section.placed(part, model.assign, read_material(section.section(part)), part)


def _fix(model: Model, section: Settings, part: str) -> None:
    value = section.values[part]
    if isinstance(value, str):
        section.placed(part, model.fix, part, value)
        return
    if not isinstance(value, Object):
        raise section.error(
            part, f'{section.name(part)} must be axes such as "xz" or {{"x": 0.001}}; got {shown(value)}'
        )
    axes = section.section(part)
    axes.check_keys(("x", "y", "z"))
    for axis in axes.values:
        axes.placed(axis, model.fix, part, axis, number_or_series(axes, axis))


def _load(model: Model, section: Settings, part: str, load: Callable[[str, Any], Load]) -> None:
    def of_value(owner: Settings, key: str) -> Load:
        value = owner.number(key) if load is Pressure else owner.vector(key)
        return owner.placed(key, load, part, value)

    made = load_of(section, part, of_value)
    section.placed(part, model.mesh.part, part)
    model.add(made)
