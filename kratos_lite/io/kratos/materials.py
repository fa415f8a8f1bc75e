"""The materials file of a Kratos run: materials of parts by properties id."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite.errors import InputError, KratosLiteError, ModelError
from kratos_lite.io.formats.document import Document, Properties
from kratos_lite.io.kratos.context import RunContext
from kratos_lite.io.kratos.properties import ELASTIC, USED, material_from
from kratos_lite.io.settings import Settings, is_number, shown
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.mesh import Block, Mesh, with_rows


def materials_of(
    settings: Settings, context: RunContext, document: Document, notes: list[str]
) -> dict[int, LinearMaterial]:
    """Return the materials by properties id; the document gets these ids and the variables of the file."""
    entries = settings.sections("properties")
    settings.expect(entries, "properties", "the materials file needs a list of 'properties'")
    found: dict[int, LinearMaterial] = {}
    for entry in entries:
        entry.check_keys(("model_part_name", "properties_id", "Material"))
        number = entry.integer("properties_id")
        _assign(entry, context, document, number)
        found[number] = _material(entry, document.properties[number], notes)
    return _used(found, document)


def _assign(entry: Settings, context: RunContext, document: Document, number: int) -> None:
    """Give the elements of the part their properties id."""
    elements, parts = context.part(entry).elements, context.mesh.parts
    filled = [len(elements) > 0, *(len(part.elements) > 0 for part in parts.values())]
    is_there, *filled = filled
    have = [f"{context.root} (all)", *(name for name, some in zip(parts, filled, strict=True) if some)]
    text = f"part {entry.text('model_part_name')!r} has no elements to carry a material; parts with elements"
    entry.expect(is_there, "model_part_name", f"{text} are {', '.join(have)}")
    mask = np.zeros(context.mesh.n_elements, dtype=bool)
    mask[elements] = True
    blocks = [
        replace(block, properties=np.where(mask[at], number, block.properties))
        for block, at in with_rows(document.mesh.blocks)
    ]
    document.mesh = document.mesh.replace(blocks=blocks)
    document.properties.setdefault(number, Properties(number))


def _material(entry: Settings, properties: Properties, notes: list[str]) -> LinearMaterial:
    part = entry.text("model_part_name")
    body = entry.section("Material", required=True)
    law = body.section("constitutive_law", required=True)
    name = law.text("name").rsplit(".", 1)[-1]
    text = f"part {part}: {name!r} is not a linear elastic law that kratos_lite has"
    cure = "use LinearElastic3DLaw, or solve this part with Kratos"
    law.expect(name in MATERIALS, "name", f"{text}; {cure}")
    variables = body.section("Variables")
    values: dict[str, Any] = {key.rsplit(".", 1)[-1]: _number(variables, key) for key in variables.values}
    if body.section("Tables").values:
        notes.append(f"material of {part}: Tables are not used by {name}")
    for key in body.unknown(("name", "constitutive_law", "Variables", "Tables")):
        text = f"part {part}: {key!r} in a material is not supported; leave it out"
        body.expect(not body.values[key], key, text)
    properties.values |= values
    try:
        material = material_from({**properties.values, "CONSTITUTIVE_LAW": name})
    except KratosLiteError as error:
        named = [key for key in variables.values if key in str(error)]
        raise variables.error(named[0] if named else "", f"part {part}: {error}") from None
    assert material is not None
    return material


def _number(variables: Settings, key: str) -> Any:
    """Return a variable: a number for elastic constants, else whatever it is."""
    value = variables.values[key]
    if key.rsplit(".", 1)[-1] in ELASTIC | {"DENSITY"}:
        return variables.number(key)
    fits = all(map(is_number, value)) if isinstance(value, list) else is_number(value)
    text = f"must be a number or a list of numbers; got {shown(value)}"
    variables.expect(fits or key not in USED, key, text)
    return value


def _used(found: dict[int, LinearMaterial], document: Document) -> dict[int, LinearMaterial]:
    """Return the materials that elements have, those of the mesh file too; name elements without any."""
    mesh, used = document.mesh, {}
    for block in mesh.blocks:
        for number in map(int, np.unique(block.properties)):
            material = found.get(number) or _of_mesh_file(document, number)
            if material is None:
                raise _without_material(mesh, block, number)
            used[number] = material
    return used


def _without_material(mesh: Mesh, block: Block, number: int) -> ModelError:
    place = mesh.place(block, int(np.argmax(block.properties == number)))
    return ModelError(f"{place} has no material (property {number}); name its part in the materials file")


def _of_mesh_file(document: Document, number: int) -> LinearMaterial | None:
    given = document.properties.get(number)
    try:
        return material_from(given.values) if given else None
    except KratosLiteError as error:
        line = given.line if given else 0
        raise InputError(f"{document.mesh.source}:{line}: Properties {number}: {error}") from None
