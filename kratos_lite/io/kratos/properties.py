"""Properties of a document: materials, quadrature, volume loads and prestress of a model."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.errors import InputError, KratosLiteError, MaterialError, Problems, nearest
from kratos_lite.io.formats.document import Properties
from kratos_lite.io.names import PRESTRESS
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.model.loads.body import BodyForce, Gravity
from kratos_lite.typing import Array

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
    """Add the initial stress -PRESTRESS_FACTOR · PRESTRESS; INSITU_STRESS is another name of the same stress.

    Source: Isotropic3D of KratosStructuralApplication, σ = C ε - PRESTRESS_FACTOR · PRESTRESS.
    """
    factor = float(_numbers(properties, "PRESTRESS_FACTOR", 1.0, (), "one number"))
    names = [name for name in PRESTRESS if name in properties.values]
    what = "six components xx yy zz xy yz xz"
    stresses = [_numbers(properties, name, 0.0, (6,), what) for name in names]
    if any((stress != stresses[0]).any() for stress in stresses):
        raise InputError("PRESTRESS and INSITU_STRESS are two names of one stress, but differ; keep one")
    if stresses:
        model.add_prestress(-factor * stresses[0], properties.id)


def _numbers(properties: Properties, name: str, default: Any, shape: tuple[int, ...], what: str) -> Array:
    """Return a value of the properties as an array of this shape."""
    array = _array(properties.values.get(name, default))
    array = array.ravel() if shape == (6,) else array
    if array.shape != shape:
        raise InputError(f"{name} must be {what}")
    return array


def _array(value: Any) -> Array:
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


def names_material(values: dict[str, Any]) -> bool:
    """Whether a Properties block says what its material is."""
    return "CONSTITUTIVE_LAW" in values or bool(ELASTIC & values.keys())


def material_from(values: dict[str, Any]) -> LinearMaterial:
    """Return the material of a Properties block.

    >>> material_from({"YOUNG_MODULUS": 210e9, "POISSON_RATIO": 0.3})
    Isotropic3D(E=210000000000.0, nu=0.3, density=0.0)
    """
    law = values.get("CONSTITUTIVE_LAW")
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
