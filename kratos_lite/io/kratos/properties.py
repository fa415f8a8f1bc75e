"""Properties: materials, quadrature, volume loads and prestress, of a document or a materials file."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.errors import InputError, KratosLiteError, MaterialError, ModelError, Problems, nearest
from kratos_lite.io.formats.document import Document, Note, Properties
from kratos_lite.io.kratos.context import Omission, RunContext
from kratos_lite.io.names import PRESTRESS, nearest_variable
from kratos_lite.io.settings import Settings, is_number, shown
from kratos_lite.materials import MATERIALS, Material
from kratos_lite.mesh import mask_of, with_rows
from kratos_lite.model.loads.body import BodyForce, Gravity
from kratos_lite.typing import Array

ELASTIC = {
    name for law in MATERIALS.values() for field, name in law.variables.items() if field not in law.tables
} - {"DENSITY"}
"""Variables that say what material a Properties block means."""
BODY_LOADS = ("VOLUME_ACCELERATION", "GRAVITY", "BODY_FORCE")
USED = ELASTIC | {
    "DENSITY", "CONSTITUTIVE_LAW", "INTEGRATION_ORDER", "INSITU_STRESS", "PRESTRESS", "PRESTRESS_FACTOR",
    "ELASTICITY_TENSOR", "REFERENCE_TEMPERATURE",
    *BODY_LOADS, *(f"{name}_{axis}" for name in BODY_LOADS for axis in "XYZ"),
}  # fmt: skip
"""Variables of Properties that change a static linear solution."""
USER_LAW = "UserProvidedLinearElastic3DLaw"
"""The law of Kratos that takes any ELASTICITY_TENSOR (6, 6) in Pa; it has no orthotropic one for solids."""

THERMAL_LAW = "ThermalElasticIsotropic3D"
"""The linear law of Kratos that temperatures strain, of KratosConstitutiveLawsApplication."""
NO_EXPANSION = (
    "no element expands by its TEMPERATURE: give Properties a THERMAL_EXPANSION_COEFFICIENT and a "
    "REFERENCE_TEMPERATURE, or leave it out"
)


def apply_properties(model: Model, properties: Properties, materials: bool, problems: Problems) -> None:
    """Give a model what one Properties block says, its material only if `materials`."""
    for apply in (*([_apply_material] if materials else []), _apply_rule, _apply_loads, _apply_prestress):
        try:
            apply(model, properties)
        except KratosLiteError as error:
            problems.add(f"Properties {properties.id}: {error}", _line_of(properties, str(error)))
    _note_unused(model, properties)


def _apply_material(model: Model, properties: Properties) -> None:
    if names_material(properties.values):
        model.assign(material_from(properties.values), properties.id)


def _apply_rule(model: Model, properties: Properties) -> None:
    order = properties.values.get("INTEGRATION_ORDER")
    if order is None:
        return
    if np.ndim(order) or order not in (1, 2, 3, 4, 5):
        raise InputError(f"INTEGRATION_ORDER must be 1 … 5; got {order}")
    model.use_rule(int(order), properties.id)


def _apply_prestress(model: Model, properties: Properties) -> None:
    """Add the initial stress -PRESTRESS_FACTOR · PRESTRESS; INSITU_STRESS is the same stress."""
    # Source: Isotropic3D of KratosStructuralApplication, σ = C ε - PRESTRESS_FACTOR · PRESTRESS.
    factor = float(_numbers(properties, "PRESTRESS_FACTOR", 1.0, (), "one number"))
    names = [name for name in PRESTRESS if name in properties.values]
    what = "six components xx yy zz xy yz xz"
    stresses = [_numbers(properties, name, 0.0, (6,), what) for name in names]
    if any((stress != stresses[0]).any() for stress in stresses):
        raise InputError("PRESTRESS and INSITU_STRESS are two names of one stress, but differ; keep one")
    if stresses:
        model.add_prestress(-factor * stresses[0], properties.id)


def expanding(document: Document, materials: bool) -> list[Properties]:
    """Return the properties of elements that a temperature strains; all if their materials come later."""
    used = document.used_properties()
    if not materials:
        return [replace(p, values={**p.values, "CONSTITUTIVE_LAW": None}) for p in used]
    return [p for p in used if names_material(p.values) and material_from(p.values).expansion.any()]


def reference_temperature(properties: Properties, source: str) -> float:
    """Return the temperature without thermal strain of elements with these properties in a file."""
    # Source: `THERMAL_LAW`, σ = C (B u - THERMAL_EXPANSION_COEFFICIENT (TEMPERATURE -
    # REFERENCE_TEMPERATURE)).
    law, name = str(properties.values.get("CONSTITUTIVE_LAW") or "Isotropic3D"), "REFERENCE_TEMPERATURE"
    text = f"nodes have a TEMPERATURE; give a {name}, one number, at which it strains nothing"
    if law not in list(MATERIALS) and "Thermal" not in law:
        cure = f"write {THERMAL_LAW} or {MATERIALS[law].__name__}, or leave the thermal expansion out"
        text = f"CONSTITUTIVE_LAW {law} has no thermal strain in Kratos, but nodes have a TEMPERATURE; {cure}"
    elif (value := _array(properties.values.get(name, ()))).shape == ():
        return float(value)
    line = _line_of(properties, text)
    raise InputError(str(Note(line, f"Properties {properties.id}: {text}", properties.source or source)))


def _numbers(properties: Properties, name: str, default: Any, shape: tuple[int, ...], what: str) -> Array:
    """Return a value of the properties as an array of this shape."""
    array = _array(properties.values.get(name, default))
    array = array.ravel() if shape == (6,) else array
    if array.shape != shape:
        raise InputError(f"{name} must be {what}")
    return array


def _array(value: Any) -> Array:
    """Return numbers as an array; of anything else an empty one, which fits no place."""
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return np.zeros(0)


def _note_unused(model: Model, properties: Properties) -> None:
    """Note values other than 0 that a static solution does not use, but for those noted by the reader."""
    idle, own = [], ELASTIC
    with suppress(KratosLiteError):
        own = set(material_from(properties.values).variables.values())
    for name, value in properties.values.items():
        array = _array(value)
        noted = any(f" {name} " in f" {note} " and "not used" in note for note in model.notes)
        is_used = name in own or name in USED - ELASTIC
        if not is_used and (array.any() or not array.size) and not noted:
            idle.append(name)
    if idle:
        what = f"Properties {properties.id}: {', '.join(idle)}"
        model.notes.append(f"{what} not used by a static solution of solids")


def _line_of(properties: Properties, text: str) -> int:
    """Return the line of the variable that an error names first, else of the block."""
    named = [properties.lines[word] for word in re.findall(r"\w+", text) if word in properties.lines]
    return named[0] if named else properties.line


def names_material(values: dict[str, Any]) -> bool:
    """Whether a Properties block says what its material is."""
    return "CONSTITUTIVE_LAW" in values or bool(ELASTIC & values.keys())


def material_from(values: dict[str, Any]) -> Material:
    """Return the material of a Properties block.

    >>> material_from({"YOUNG_MODULUS": 210e9, "POISSON_RATIO": 0.3})
    Isotropic3D(E=210000000000.0, nu=0.3, density=0.0, alpha=0.0)
    """
    law = values.get("CONSTITUTIVE_LAW")
    name = "Isotropic3D" if law is None else str(law)
    if law in (None, USER_LAW) and "YOUNG_MODULUS_X" in values:
        name = "Orthotropic3D"
    if name not in MATERIALS:
        known = [*MATERIALS, *(alias for m in MATERIALS for alias in MATERIALS.aliases(m))]
        raise MaterialError(
            f"CONSTITUTIVE_LAW {name!r} is not a law that kratos_lite has "
            f"({', '.join(MATERIALS)} and their Kratos names);{nearest(name, known)} "
            "choose one of them, or give a material with --material"
        )
    material = MATERIALS[name].from_variables(values)
    if law == USER_LAW:
        C = np.asarray(values.get("ELASTICITY_TENSOR"))
        if C.shape != (6, 6) or not np.abs(C - material.C).max() <= 1e-9 * np.abs(material.C).max():
            raise MaterialError(
                f"ELASTICITY_TENSOR is not the one of the constants beside it for {name}; fix one"
            )
    return material


def _apply_loads(model: Model, properties: Properties) -> None:
    """Add weight: density × VOLUME_ACCELERATION (or GRAVITY), else BODY_FORCE."""
    a, g, b = (_volume_vector(properties, name) for name in BODY_LOADS)
    where = properties.id
    if a.any() and g.any() and (a != g).any():
        raise InputError(f"GRAVITY is {g.tolist()}, but VOLUME_ACCELERATION {a.tolist()}; keep one")
    acceleration = a if a.any() else g
    if acceleration.any():
        model.add(Gravity(acceleration, where))
        if b.any():
            model.notes.append(
                f"Properties {where}: BODY_FORCE is ignored: density × gravity is the body force already"
            )
    elif b.any():
        model.add(BodyForce(b, where))


def _volume_vector(properties: Properties, name: str) -> Array:
    """Return a vector of Properties from its whole and its components."""
    vector = _numbers(properties, name, np.zeros(3), (3,), "a vector of three components").copy()
    for i, axis in enumerate("XYZ"):
        part = f"{name}_{axis}"
        value = _numbers(properties, part, vector[i], (), "one number")
        if name in properties.values and value != vector[i]:
            raise InputError(f"{part} is {value:g}, but {name} has {vector[i]:g} there; keep one of them")
        vector[i] = value
    return vector


# ---- the materials file of a run ----------------------------------------------------------------------


def use_materials(settings: Settings, context: RunContext, document: Document, notes: list[str]) -> None:
    """Give a document the materials of the file, and its elements their properties ids."""
    entries = settings.sections("properties")
    text = "the materials file needs a list of 'properties', which is empty or missing"
    settings.expect(entries, "properties", text)
    for entry in entries:
        entry.check_keys(("model_part_name", "properties_id", "Material", "sub_properties"))
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
    mask = mask_of(elements, context.mesh.n_elements)
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
    if name.endswith("Factory"):  # Kratos puts the name of the law together
        name = name.removesuffix("Factory") + "3D" + law.text("yield_surface") + law.text("plastic_potential")
    known = [*MATERIALS, *(alias for m in MATERIALS for alias in MATERIALS.aliases(m))]
    text = f"part {part}: {name!r} is not a law that kratos_lite has.{nearest(name, known)}"
    law.expect(name in MATERIALS, "name", f"{text} Choose one, or solve this part with Kratos")
    variables = body.section("Variables")
    values = {key.rsplit(".", 1)[-1]: _variable(variables, key) for key in variables.values}
    for what, where in (("Tables", body), ("sub_properties", entry)):
        if where.values.get(what):
            notes.append(Omission(f"material of {part}: {what} are not used by {name}"))
    for key in body.unknown(("name", "constitutive_law", "Variables", "Tables")):
        text = f"part {part}: {key!r} in a material is not supported; leave it out"
        body.expect(not body.values[key], key, text)
    properties.values |= values | {"CONSTITUTIVE_LAW": name}
    properties.source, properties.line, properties.lines = variables.source, 0, {}
    try:
        material_from(properties.values)
    except KratosLiteError as error:
        words = re.findall(r"[A-Z_]{2,}", str(error))
        slips = {key: nearest_variable(key, words) for key in variables.unknown(USED)}
        named = [key for key in variables.values if key in str(error) or slips.get(key)]
        hint = "".join(f".{slips[key]}" for key in named[:1] if slips.get(key))
        raise variables.error(named[0] if named else "", f"part {part}: {error}{hint}") from None


def _variable(variables: Settings, key: str) -> Any:
    """Return a variable: a number for elastic constants, else whatever it is."""
    value = variables.values[key]
    if key.rsplit(".", 1)[-1] in ELASTIC | {"DENSITY"}:
        return variables.number(key)
    fits = all(map(is_number, value)) if isinstance(value, list) else is_number(value)
    text = f"must be a number or a list of numbers; got {shown(value)}"
    variables.expect(fits or key not in USED, key, text)
    return value
