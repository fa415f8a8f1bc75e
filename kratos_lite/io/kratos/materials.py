"""The materials file of a Kratos run: materials of parts by properties id."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite.errors import KratosLiteError, ModelError
from kratos_lite.io.formats.document import Document, Properties
from kratos_lite.io.kratos.context import RunContext
from kratos_lite.io.kratos.properties import ELASTIC, USED, material_from, names_material
from kratos_lite.io.settings import Settings, is_number, shown
from kratos_lite.materials import MATERIALS
from kratos_lite.mesh import with_rows


def use_materials(settings: Settings, context: RunContext, document: Document, notes: list[str]) -> None:
    """Give a document the materials of the file, and its elements their properties ids."""
    entries = settings.sections("properties")
    settings.expect(entries, "properties", "the materials file needs a list of 'properties'")
    for entry in entries:
        entry.check_keys(("model_part_name", "properties_id", "Material"))
        number = entry.integer("properties_id")
        _assign(entry, context, document, number)
        _use_material(entry, document.properties.setdefault(number, Properties(number)), notes)
    for block in document.mesh.blocks:
        for number in map(int, np.unique(block.properties)):
            if number not in document.properties or not names_material(document.properties[number].values):
                place = document.mesh.place(block, int(np.argmax(block.properties == number)))
                text = f"has no material (property {number}); name its part in the materials file"
                raise ModelError(f"{place} {text}")


def _assign(entry: Settings, context: RunContext, document: Document, number: int) -> None:
    """Give the elements of the part their properties id."""
    elements, parts = context.part(entry).elements, context.mesh.parts
    have = ", ".join([f"{context.root} (all)", *(name for name, part in parts.items() if len(part.elements))])
    text = f"part {entry.text('model_part_name')!r} has no elements to carry a material; parts with elements"
    entry.expect(len(elements), "model_part_name", f"{text} are {have}")
    mask = np.zeros(context.mesh.n_elements, dtype=bool)
    mask[elements] = True
    blocks = [
        replace(block, properties=np.where(mask[at], number, block.properties))
        for block, at in with_rows(document.mesh.blocks)
    ]
    document.mesh = document.mesh.replace(blocks=blocks)


def _use_material(entry: Settings, properties: Properties, notes: list[str]) -> None:
    """Give properties the law and the variables of an entry; refuse what makes no material."""
    part = entry.text("model_part_name")
    body = entry.section("Material", required=True)
    law = body.section("constitutive_law", required=True)
    name = law.text("name").rsplit(".", 1)[-1]
    text = f"part {part}: {name!r} is not a linear elastic law that kratos_lite has"
    cure = "use LinearElastic3DLaw, or solve this part with Kratos"
    law.expect(name in MATERIALS, "name", f"{text}; {cure}")
    variables = body.section("Variables")
    values = {key.rsplit(".", 1)[-1]: _number(variables, key) for key in variables.values}
    if body.section("Tables").values:
        notes.append(f"material of {part}: Tables are not used by {name}")
    for key in body.unknown(("name", "constitutive_law", "Variables", "Tables")):
        text = f"part {part}: {key!r} in a material is not supported; leave it out"
        body.expect(not body.values[key], key, text)
    properties.values |= values | {"CONSTITUTIVE_LAW": name}
    try:
        material_from(properties.values)
    except KratosLiteError as error:
        named = [key for key in variables.values if key in str(error)]
        raise variables.error(named[0] if named else "", f"part {part}: {error}") from None


def _number(variables: Settings, key: str) -> Any:
    """Return a variable: a number for elastic constants, else whatever it is."""
    value = variables.values[key]
    if key.rsplit(".", 1)[-1] in ELASTIC | {"DENSITY"}:
        return variables.number(key)
    fits = all(map(is_number, value)) if isinstance(value, list) else is_number(value)
    text = f"must be a number or a list of numbers; got {shown(value)}"
    variables.expect(fits or key not in USED, key, text)
    return value
