"""Properties of a document: materials, quadrature, volume loads and prestress of a model."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite.analysis.model import Model
from kratos_lite.errors import InputError, KratosLiteError, MaterialError, Problems, nearest
from kratos_lite.io.document import Properties
from kratos_lite.io.names import nearest_variable
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.model.loads import BodyForce, Gravity

ELASTIC = {name for law in MATERIALS.values() for name in law.variables.values()} - {"DENSITY"}
"""Variables that say what material a Properties block means."""
BODY_LOADS = ("VOLUME_ACCELERATION", "GRAVITY", "BODY_FORCE")
USED = ELASTIC | {
    "DENSITY", "CONSTITUTIVE_LAW", "INTEGRATION_ORDER", "INSITU_STRESS", "PRESTRESS", "PRESTRESS_FACTOR",
    "ELASTICITY_TENSOR",
    *BODY_LOADS, *(f"{name}_{axis}" for name in BODY_LOADS for axis in "XYZ"),
}  # fmt: skip
"""Variables of Properties that change a static linear solution."""
USER_LAW = "UserProvidedLinearElastic3DLaw"
"""The law of Kratos that takes any ELASTICITY_TENSOR (6, 6) in Pa; it has no orthotropic one for solids."""


def apply_properties(model: Model, properties: Properties, materials: bool, problems: Problems) -> None:
    """Give a model what one Properties block says, its material only if `materials`."""
    values = properties.values
    where = properties.id
    if materials:
        try:
            material = material_from(values)
        except KratosLiteError as error:
            line = _line_of(properties, str(error))
            unknown = [v for v in values if v not in ELASTIC | {"DENSITY"} and nearest_variable(v, ELASTIC)]
            hint = "".join(
                f"; found {v!r} at line {properties.lines.get(v, 0)}:{nearest_variable(v, ELASTIC)}"
                for v in unknown
            )
            problems.add(f"Properties {where}: {error}{hint}", line)
            return
        if material is not None:
            model.assign(material, where)
    _apply_rule(model, properties, problems)
    _apply_volume_loads(model, properties, problems)
    _apply_prestress(model, properties, problems)
    _note_unused(model, properties)


def _apply_rule(model: Model, properties: Properties, problems: Problems) -> None:
    order = properties.values.get("INTEGRATION_ORDER")
    if order is None:
        return
    try:
        if np.ndim(order) or order not in (1, 2, 3, 4, 5):
            raise InputError(f"INTEGRATION_ORDER must be 1 … 5; got {order}")
        model.use_rule(int(order), properties.id)
    except InputError as error:
        problems.add(f"Properties {properties.id}: {error}", properties.lines.get("INTEGRATION_ORDER"))


def _apply_prestress(model: Model, properties: Properties, problems: Problems) -> None:
    values, lines = properties.values, properties.lines
    factor = _array(values.get("PRESTRESS_FACTOR", 1.0))
    if factor.shape != ():
        problems.add("PRESTRESS_FACTOR must be one number", lines.get("PRESTRESS_FACTOR"))
        return
    for name in ("INSITU_STRESS", "PRESTRESS"):
        if name in values:
            stress = _array(values[name]).ravel()
            if stress.shape != (6,):
                problems.add(f"{name} must have six components xx yy zz xy yz xz", lines.get(name))
            else:
                model.add_prestress(stress * float(factor), properties.id)


def _array(value: Any) -> NDArray[np.float64]:
    """Return numbers as an array; what is none becomes one without a number, which fits no place."""
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return np.zeros(0)


def _note_unused(model: Model, properties: Properties) -> None:
    """Note values other than 0 that a static solution does not use, but for those noted by the reader."""
    idle = []
    for name, value in properties.values.items():
        array = _array(value)
        noted = any(f" {name} " in f" {note} " and "not used" in note for note in model.notes)
        if name not in USED and (array.any() or not array.size) and not noted:
            idle.append(name)
    if idle:
        text = f"Properties {properties.id}: {', '.join(idle)} not used by a static solution of solids"
        model.notes.append(text)


def _line_of(properties: Properties, text: str) -> int:
    """Return the line of the variable that an error names first, else of the block."""
    named = [properties.lines[word] for word in re.findall(r"\w+", text) if word in properties.lines]
    return named[0] if named else properties.line


def material_from(values: dict[str, Any]) -> LinearMaterial | None:
    """Return the material of a Properties block, or None if it names none.

    >>> material_from({"YOUNG_MODULUS": 210e9, "POISSON_RATIO": 0.3})
    Isotropic3D(E=210000000000.0, nu=0.3, density=0.0)
    """
    law = values.get("CONSTITUTIVE_LAW")
    if law is None and not ELASTIC & values.keys():
        return None
    name = "Isotropic3D" if law is None else str(law)
    if law in (None, USER_LAW) and "YOUNG_MODULUS_X" in values:
        name = "Orthotropic3D"
    if name not in MATERIALS:
        known = [*MATERIALS, *(alias for m in MATERIALS for alias in MATERIALS.aliases(m))]
        raise MaterialError(
            f"CONSTITUTIVE_LAW {name!r} is not a linear elastic law that kratos_lite has "
            f"({', '.join(MATERIALS)} and their Kratos names);{nearest(name, known)} "
            "choose one of them, or give a material with --material"
        )
    material = MATERIALS[name].from_variables(values)
    if law == USER_LAW:
        C = np.asarray(values.get("ELASTICITY_TENSOR"))
        if C.shape != (6, 6) or not np.abs(C - material.C).max() <= 1e-9 * np.abs(material.C).max():
            raise MaterialError(
                f"ELASTICITY_TENSOR is not the one of the constants beside it for {name}; mend one"
            )
    return material


def _apply_volume_loads(model: Model, properties: Properties, problems: Problems) -> None:
    """Add weight: density × VOLUME_ACCELERATION (or GRAVITY), else BODY_FORCE."""
    try:
        a, g, b = (_volume_vector(properties, name) for name in BODY_LOADS)
    except InputError as error:
        problems.add(str(error), _line_of(properties, str(error)))
        return
    where = properties.id
    if a.any() and g.any() and (a != g).any():
        problems.add(
            f"Properties {where} has VOLUME_ACCELERATION {a.tolist()} and GRAVITY {g.tolist()}; keep one",
            properties.lines.get("GRAVITY"),
        )
        return
    acceleration = a if a.any() else g
    if acceleration.any():
        model.add(Gravity(acceleration, where))
        if b.any():
            model.notes.append(
                f"Properties {where}: BODY_FORCE is ignored: density × gravity is the body force already"
            )
    elif b.any():
        model.add(BodyForce(b, where))


def _volume_vector(properties: Properties, name: str) -> NDArray[np.float64]:
    """Return a vector of Properties from its whole and its components."""
    values = properties.values
    vector = _array(values.get(name, np.zeros(3)))
    if vector.shape != (3,):
        raise InputError(f"{name} must have three components")
    vector = vector.copy()
    for i, axis in enumerate("XYZ"):
        part = f"{name}_{axis}"
        value = _array(values.get(part, vector[i]))
        if value.shape != ():
            raise InputError(f"{part} must be one number")
        if name in values and value != vector[i]:
            raise InputError(f"{part} is {value:g}, but {name} has {vector[i]:g} there; keep one of them")
        vector[i] = value
    return vector
