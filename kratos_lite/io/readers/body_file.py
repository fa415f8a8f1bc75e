"""Scenes in JSON: strict, and every problem with its line."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.bodies import BODIES, Body, Obstacle, RigidBody, State
from kratos_lite.bodies.rotations import exp
from kratos_lite.bodies.validation import Material
from kratos_lite.errors import InputError, Problems
from kratos_lite.io.documents import ending, read_document
from kratos_lite.io.json_file import Object
from kratos_lite.io.kratos import model_from
from kratos_lite.io.kratos.properties import material_from
from kratos_lite.io.project.run_file import read_material
from kratos_lite.io.settings import Settings, find_file, inside, read_settings, shown
from kratos_lite.io.scenes.actions import add_constraint, add_load
from kratos_lite.io.scenes.scene import OUTPUTS, BodyScene
from kratos_lite.io.scenes.values import Read, matrix, number, placed, vector
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.generators import annulus, box
from kratos_lite.model.mass_properties import MassProperties

KEYS = ("mesh", "material", "body", "start", "loads", "constraints", "time", "output", "restart")
MESHES: dict[str, tuple[Callable[..., Mesh], dict[str, Callable[[Settings, str], Any]]]] = {
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
OPTIONS: dict[str, Callable[[Settings, str], Any]] = {
    "form": Settings.text,
    "modes": Settings.integer,
    "lumped": Settings.flag,
    "scheme": Settings.text,
    "damping": Settings.number,
    "tolerance": Settings.number,
}
"""Options of bodies; which of them a kind has is said by its arguments."""
CHARACTERISTICS: dict[str, Read] = {
    "mass": number,
    "volume": number,
    "center": vector,
    "inertia": matrix,
    "euler": matrix,
}


def read_json_scene(path: Path, strict: bool = True) -> BodyScene:
    """Return the scene of a JSON file; its files are named from its folder.

    Raises
    ------
    InputError
        With file, line, column and cure of every problem that is found.
    """
    settings, problems = read_settings(path), Problems()
    if "model" in settings or "solver_settings" in settings:
        raise InputError(f"{path}: this is a run file of a model: kratos-lite solve {path}")
    for key in settings.unknown(KEYS):
        problems.add(str(settings.error(key, settings.unknown_key(key, KEYS))))
    files = [path]
    time = problems.of(_time, settings)
    output = problems.of(_outputs, settings, path.parent)
    body = problems.of(_body_of, settings, path.parent, files, strict)
    if body is None:
        problems.raise_if_any()
    problems.of(_start, settings, body)
    for key, add in (("loads", add_load), ("constraints", add_constraint)):
        for section in problems.of(settings.sections, key) or []:
            problems.of(add, body, section)
    if "restart" in settings:
        problems.of(_restart, settings, path.parent, files, body)
    problems.raise_if_any()
    line, column = settings.section("time").values.places["step"]
    return BodyScene(body, **time, output=output, files=files, place=f"{path}:{line}:{column}")


def _time(settings: Settings) -> dict[str, Any]:
    time = settings.section("time", required=True)
    time.check_keys(("step", "steps", "every", "substeps"))
    found: dict[str, Any] = {"dt": time.number("step")}
    if not found["dt"] > 0:
        raise time.error("step", f"time.step must be a number of seconds > 0; got {found['dt']:g}")
    for key in ("steps", "every", "substeps"):
        if key == "substeps" and time.values.get(key) == "auto":
            found[key] = "auto"
        elif key == "steps" or key in time:
            found[key] = time.integer(key)
            if found[key] < 1:
                raise time.error(key, f"time.{key} must be a whole number ≥ 1; got {found[key]}")
    return found


def _outputs(settings: Settings, folder: Path) -> dict[str, str]:
    output = settings.section("output")
    output.check_keys(OUTPUTS)
    found = {}
    for key in output.values:
        try:
            found[key] = str(inside(folder, output.text(key)))
        except ValueError as error:
            raise output.error(key, f"output.{key}: {error}") from None
    return found


# ---- mesh and material -----------------------------------------------------------------------------


def _mesh_and_material(
    settings: Settings, folder: Path, files: list[Path], strict: bool
) -> tuple[Mesh | None, Material | None]:
    mesh, material = _mesh(settings, folder, files, strict) if "mesh" in settings else (None, None)
    if "material" in settings:
        material = _material(settings.section("material"), mesh)
    return mesh, material


def _mesh(settings: Settings, folder: Path, files: list[Path], strict: bool) -> tuple[Mesh, Material | None]:
    value = settings.get("mesh")
    if isinstance(value, str):
        return _mesh_of_file(settings, folder, files, strict)
    if not isinstance(value, Object) or len(value) != 1 or next(iter(value)) not in MESHES:
        kinds = " or ".join(f'{{"{name}": {{…}}}}' for name in MESHES)
        raise settings.error("mesh", f"mesh must be the name of a file, {kinds}; got {shown(value)}")
    name = next(iter(value))
    make, readers = MESHES[name]
    section = settings.section("mesh").section(name)
    section.check_keys(readers)
    required = [k for k, p in inspect.signature(make).parameters.items() if p.default is p.empty]
    for key in required:
        section.get(key)
    values = {key: readers[key](section, key) for key in section.values}
    return placed(settings.section("mesh"), name, make, **values), None


def _mesh_of_file(
    settings: Settings, folder: Path, files: list[Path], strict: bool
) -> tuple[Mesh, Material | None]:
    """Return the mesh of a file, and its materials by property id if all elements have one."""
    path, note = find_file(settings, "mesh", folder)
    if note:
        raise settings.error("mesh", f"mesh: {note}; correct the path")
    if ending(path) == ".json":
        raise settings.error("mesh", f"mesh must be a mesh file such as .mdpa; got {path.name}")
    files.append(path)
    document = read_document(path, strict=strict)
    mesh = model_from(document, materials=False).mesh
    numbers = {int(number) for block in mesh.blocks for number in np.unique(block.properties)}
    given = {n: document.properties[n].values for n in sorted(numbers) if n in document.properties}
    found = {n: placed(settings, "mesh", material_from, values) for n, values in given.items()}
    known = {n: material for n, material in found.items() if material is not None}
    return mesh, known if len(known) == len(numbers) else None


def _material(section: Settings, mesh: Mesh | None) -> Material:
    """Return one material, or materials by the names of parts."""
    if not any(isinstance(value, Object) for value in section.values.values()):
        return read_material(section)
    if mesh is None:
        raise section.error("", "material: materials of parts need a mesh")
    found = {}
    for name in section.values:
        placed(section, name, mesh.part, name)
        found[name] = read_material(section.section(name))
    return found


# ---- body ------------------------------------------------------------------------------------------


def _body_of(settings: Settings, folder: Path, files: list[Path], strict: bool) -> Body:
    return _body(settings, *_mesh_and_material(settings, folder, files, strict))


def _body(settings: Settings, mesh: Mesh | None, material: Material | None) -> Body:
    value = settings.get("body")
    whole = isinstance(value, str)
    section = Settings(Object(), settings.source, "body") if whole else settings.section("body")
    owner, key = (settings, "body") if whole else (section, "kind")
    kind = placed(owner, key, BODIES.__getitem__, owner.text(key))
    arguments = inspect.signature(kind).parameters
    options = [name for name in (*OPTIONS, "mass_properties") if name in arguments]
    section.check_keys(("kind", *options))
    given: dict[str, Any] = {name: OPTIONS[name](section, name) for name in OPTIONS if name in section}
    if "mass_properties" in section:
        inner = section.section("mass_properties")
        given["mass_properties"] = placed(section, "mass_properties", _characteristics, inner, mesh, material)
    elif mesh is None:
        raise settings.error("mesh", "key 'mesh' is missing: it is the shape of the body")
    if material is None and "mass_properties" not in given and not issubclass(kind, Obstacle):
        raise settings.error(
            "material", 'key \'material\' is missing, and the mesh has none: {"E": …, "nu": …, "density": …}'
        )
    return placed(owner, key, kind, mesh, material, **given)


def _characteristics(section: Settings, mesh: Mesh | None, material: Material | None) -> MassProperties:
    """Return mass_properties: those of the mesh with the given ones in their place."""
    section.check_keys(CHARACTERISTICS)
    given = {key: CHARACTERISTICS[key](section, key, mesh) for key in section.values}
    if mesh is None or material is None:
        section.get("mass")
        return MassProperties(**given)
    return RigidBody(mesh, material).mass_properties.with_(**given)


def _start(settings: Settings, body: Body) -> None:
    """Let the body start: turned, with its velocities."""
    start = settings.section("start")
    start.check_keys(("rotation", "velocity", "angular_velocity"))
    if "rotation" in start:
        placed(start, "rotation", body.turn, exp(np.array(start.vector("rotation"))))
    keys = {"linear": "velocity", "angular": "angular_velocity"}
    given = {name: start.vector(key) for name, key in keys.items() if key in start}
    if given:
        body.set_velocity(**given)


def _restart(settings: Settings, folder: Path, files: list[Path], body: Body) -> None:
    path, _ = find_file(settings, "restart", folder)
    files.append(path)
    placed(settings, "restart", lambda: State.load(path).put_into(body))
