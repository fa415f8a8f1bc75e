"""Files with a body in JSON: its mesh, material, kind, start, loads, constraints and time."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.bodies import BODIES, Body, FixedBody, RigidBody
from kratos_lite.bodies.rotations import exp
from kratos_lite.bodies.validation import Material
from kratos_lite.errors import Problems
from kratos_lite.io.case import Case, Outputs
from kratos_lite.io.formats import read_document
from kratos_lite.io.json_file import Object
from kratos_lite.io.kratos.properties import material_from
from kratos_lite.io.kratos.to_model import model_from
from kratos_lite.io.readers.body_loads import add_constraint, add_load
from kratos_lite.io.readers.run_file import mesh_file_of, output_of
from kratos_lite.io.readers.time import read_time_of_body, restart_of
from kratos_lite.io.readers.values import Read, is_by_part, matrix, read_material
from kratos_lite.io.settings import Settings, shown
from kratos_lite.io.writers.endings import SERIES, check_ending
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.generators import annulus, box
from kratos_lite.model.mass_properties import MassProperties

OUTPUTS = (*(ending[1:] for ending in SERIES), "picture", "state")
KEYS = ("mesh", "material", "body", "start", "loads", "constraints", "time", "output", "restart")
MESHES: dict[str, tuple[Callable[..., Mesh], dict[str, Read]]] = {
    "box": (
        box,
        {
            "size": Settings.vector,
            "cells": Settings.vector,
            "element": Settings.text,
            "origin": Settings.vector,
        },
    ),
    "annulus": (
        annulus,
        {
            **dict.fromkeys(("inner", "outer", "width"), Settings.number),
            "cells": Settings.vector,
            "element": Settings.text,
        },
    ),
}
"""Meshes that are made, by name: function, and how its arguments are read."""
OPTIONS: dict[str, Read] = {
    "formulation": Settings.text,
    "modes": Settings.integer,
    "lumped": Settings.flag,
    "integrator": Settings.text,
    "damping": Settings.number,
    "tolerance": Settings.number,
}
"""Options of bodies; which of them a kind has is said by its arguments."""
MASS_PROPERTIES: dict[str, Read] = {
    "mass": Settings.number,
    "volume": Settings.number,
    "center": Settings.vector,
    "inertia": matrix,
    "euler": matrix,
}


def read_body_file(settings: Settings, *, strict: bool = True) -> Case:
    """Return the case of a JSON file with a body; its files are named from its folder.

    Parameters
    ----------
    settings : the file.
    strict : as of `kratos_lite.read`, for its mesh.

    Raises
    ------
    InputError
        With file, line, column and cure of every problem that is found.
    """
    folder, problems = Path(settings.source).parent, Problems()
    for key in settings.unknown(KEYS):
        problems.add(str(settings.error(key, settings.unknown_key(key, KEYS))))
    time = problems.of(read_time_of_body, settings)
    outputs = problems.of(_outputs, settings, folder)
    body = problems.of(_body_of, settings, folder, strict)
    if body is None:
        problems.raise_if_any()
    problems.of(_start, settings, body)
    for key, add in (("loads", add_load), ("constraints", add_constraint)):
        for section in problems.of(settings.sections, key) or []:
            problems.of(add, body, section)
    if "restart" in settings and (restart := problems.of(restart_of, settings, folder)) and time:
        time = replace(time, restart=restart)
    problems.raise_if_any()
    return Case(body, time, outputs=outputs, files=settings.files)


def _outputs(settings: Settings, folder: Path) -> Outputs:
    section = settings.section("output")
    section.check_keys(OUTPUTS)
    for key in section.values:
        if key != "picture":
            section.placed(key, check_ending, section.text(key), ".npz" if key == "state" else f".{key}")
    return outputs_of({key: output_of(section, key, folder) for key in section.values})


def outputs_of(paths: dict[str, str]) -> Outputs:
    """Return the outputs of a body from paths by the keys `OUTPUTS`."""
    results = [path for key, path in paths.items() if key not in ("picture", "state")]
    return Outputs(results, picture=paths.get("picture"), state=paths.get("state"))


# ---- mesh and material -----------------------------------------------------------------------------


def _mesh_and_material(settings: Settings, folder: Path, strict: bool) -> tuple[Mesh | None, Material | None]:
    mesh, material = _mesh(settings, folder, strict) if "mesh" in settings else (None, None)
    if "material" in settings:
        material = _material(settings.section("material"), mesh)
    return mesh, material


def _mesh(settings: Settings, folder: Path, strict: bool) -> tuple[Mesh, Material | None]:
    value = settings.get("mesh")
    if isinstance(value, str):
        return _mesh_of_file(settings, folder, strict)
    if not isinstance(value, Object) or len(value) != 1 or next(iter(value)) not in MESHES:
        kinds = " or ".join(f'{{"{name}": {{…}}}}' for name in MESHES)
        raise settings.error("mesh", f"mesh must be the name of a file, {kinds}; got {shown(value)}")
    name = next(iter(value))
    make, readers = MESHES[name]
    section = settings.section("mesh").section(name)
    section.check_keys(readers)
    for key, parameter in inspect.signature(make).parameters.items():
        if parameter.default is parameter.empty:
            section.get(key)
    values = {key: readers[key](section, key) for key in section.values}
    return settings.section("mesh").placed(name, make, **values), None


def _mesh_of_file(settings: Settings, folder: Path, strict: bool) -> tuple[Mesh, Material | None]:
    """Return the mesh of a file, and its materials by property id if all elements have one."""
    document = read_document(mesh_file_of(settings, "mesh", folder), strict=strict)
    mesh = model_from(document, materials=False).mesh
    numbers = {int(number) for block in mesh.blocks for number in np.unique(block.properties)}
    given = {n: document.properties[n].values for n in sorted(numbers) if n in document.properties}
    found = {n: settings.placed("mesh", material_from, values) for n, values in given.items()}
    known = {n: material for n, material in found.items() if material is not None}
    return mesh, known if len(known) == len(numbers) else None


def _material(section: Settings, mesh: Mesh | None) -> Material:
    """Return one material, or materials by the names of parts."""
    if not is_by_part(section):
        return read_material(section)
    if mesh is None:
        raise section.error("", "material: materials of parts need a mesh")
    found = {}
    for name in section.values:
        section.placed(name, mesh.part, name)
        found[name] = read_material(section.section(name))
    return found


# ---- body ------------------------------------------------------------------------------------------


def _body_of(settings: Settings, folder: Path, strict: bool) -> Body:
    return _body(settings, *_mesh_and_material(settings, folder, strict))


def _body(settings: Settings, mesh: Mesh | None, material: Material | None) -> Body:
    value = settings.get("body")
    is_word = isinstance(value, str)
    section = Settings(Object(), settings.source, "body") if is_word else settings.section("body")
    owner, key = (settings, "body") if is_word else (section, "kind")
    kind = owner.placed(key, BODIES.__getitem__, owner.text(key))
    arguments = inspect.signature(kind).parameters
    options = [name for name in (*OPTIONS, "mass_properties") if name in arguments]
    section.check_keys(("kind", *options))
    given: dict[str, Any] = {name: OPTIONS[name](section, name) for name in OPTIONS if name in section}
    if "mass_properties" in section:
        inner = section.section("mass_properties")
        given["mass_properties"] = section.placed("mass_properties", _mass_properties, inner, mesh, material)
    elif mesh is None:
        raise settings.error("mesh", "key 'mesh' is missing: it is the shape of the body")
    if material is None and "mass_properties" not in given and not issubclass(kind, FixedBody):
        raise settings.error(
            "material", 'key \'material\' is missing, and the mesh has none: {"E": …, "nu": …, "density": …}'
        )
    return owner.placed(key, kind, mesh, material, **given)


def _mass_properties(section: Settings, mesh: Mesh | None, material: Material | None) -> MassProperties:
    """Return mass_properties: those of the mesh with the given ones in their place."""
    section.check_keys(MASS_PROPERTIES)
    given = {key: MASS_PROPERTIES[key](section, key) for key in section.values}
    if mesh is None or material is None:
        section.get("mass")
        return MassProperties(**given)
    return RigidBody(mesh, material).mass_properties.with_(**given)


def _start(settings: Settings, body: Body) -> None:
    """Let the body start: turned, with its velocities."""
    start = settings.section("start")
    start.check_keys(("rotation", "velocity", "angular_velocity"))
    if "rotation" in start:
        start.placed("rotation", body.rotate, exp(np.array(start.vector("rotation"))))
    keys = {"linear": "velocity", "angular": "angular_velocity"}
    given = {name: start.vector(key) for name, key in keys.items() if key in start}
    if given:
        start.placed("", body.set_velocity, **given)
