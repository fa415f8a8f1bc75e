"""From a Document to a Model: element names, materials, supports and loads as Kratos means them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import InputError, KratosLiteError, MaterialError, Problems, nearest
from kratos_lite.io.document import Document, Properties
from kratos_lite.io.kratos.variables import Variables
from kratos_lite.loads import BodyForce, Gravity
from kratos_lite.materials import MATERIALS, LinearMaterial
from kratos_lite.mesh import Block
from kratos_lite.model import Model

ELASTIC = {name for law in MATERIALS.values() for name in law.variables.values()} - {"DENSITY"}
"""Variables that say what material a Properties block means."""
USER_LAW = "UserProvidedLinearElastic3DLaw"
"""The law of Kratos that takes any ELASTICITY_TENSOR (6, 6) in Pa; it has no orthotropic one for solids."""


def model_from(
    document: Document,
    *,
    materials: bool = True,
    processes: Callable[[Variables], None] | None = None,
) -> Model:
    """Return the model that a document describes.

    Parameters
    ----------
    document : what was read.
    materials : take the materials from the Properties; False leaves them to the caller.
    processes : called with the values of the document to change them, as a run file does.

    Raises
    ------
    InputError
        With the place in the file of each unknown element and each impossible material.
    """
    check_elements(document)
    model = Model(document.mesh)
    model.notes += [str(note) for note in document.notes]
    model.notes += _renamed(document.mesh.blocks)
    used = {int(p) for block in document.mesh.blocks for p in np.unique(block.properties)}
    problems = Problems(document.mesh.source)
    for number in sorted(used & document.properties.keys()):
        _apply_properties(model, document.properties[number], materials, problems)
    problems.raise_if_any()
    values = Variables(document.mesh)
    _fill(values, document, model)
    if processes:
        processes(values)
    values.apply(model)
    _link(model, document)
    return model


def check_elements(document: Document) -> None:
    """Raise InputError for every element block of unknown kind that is not empty."""
    problems = Problems(document.mesh.source)
    for block in document.mesh.blocks:
        if len(block) and block.name not in ELEMENTS:
            line = None if block.lines is None else int(block.lines[0])
            known = [*ELEMENTS, *(alias for name in ELEMENTS for alias in ELEMENTS.aliases(name))]
            problems.add(
                f"unknown element {block.name!r} ({len(block)} of them);{nearest(block.name, known)} "
                f"Known are {', '.join(sorted(ELEMENTS, key=_by_number))} and their Kratos names",
                line,
            )
    problems.raise_if_any()


def _by_number(name: str) -> tuple[int, str]:
    return len(name), name


def _renamed(blocks: list[Block]) -> list[str]:
    """Return a note for each kind of element that is solved under another name."""
    notes = {}
    for block in blocks:
        name = ELEMENTS[block.name].__name__ if block.name in ELEMENTS else block.name
        if len(block) and name != block.name:
            large = " with small displacements" if "Lagrangian" in block.name else ""
            notes[block.name] = f"{block.name} is solved as {name}{large}"
    return list(notes.values())


def _apply_properties(model: Model, properties: Properties, materials: bool, problems: Problems) -> None:
    values = properties.values
    where = properties.id
    if materials:
        try:
            material = material_from(values)
        except KratosLiteError as error:
            line = _line_of(properties, str(error))
            unknown = [v for v in values if v not in ELASTIC | {"DENSITY"} and nearest(v, ELASTIC)]
            hint = "".join(
                f"; found {v!r} at line {properties.lines.get(v, 0)}:{nearest(v, ELASTIC)}" for v in unknown
            )
            problems.add(f"Properties {where}: {error}{hint}", line)
            return
        if material is not None:
            model.assign(material, where)
    if "INTEGRATION_ORDER" in values:
        try:
            order = values["INTEGRATION_ORDER"]
            model.use_rule(int(order), where)
            if order not in (1, 2, 3, 4, 5):
                raise InputError(f"INTEGRATION_ORDER must be 1 … 5; got {order}")
        except InputError as error:
            problems.add(f"Properties {where}: {error}", properties.lines.get("INTEGRATION_ORDER"))
    _apply_volume_loads(model, properties, problems)
    for name in ("INSITU_STRESS", "PRESTRESS"):
        if name in values:
            stress = np.asarray(values[name], dtype=float).ravel()
            if stress.shape != (6,):
                problems.add(f"{name} must have six components xx yy zz xy yz xz", properties.lines.get(name))
            else:
                model.add_prestress(stress * float(values.get("PRESTRESS_FACTOR", 1.0)), where)


def _line_of(properties: Properties, text: str) -> int:
    """Return the line of the variable that an error names, else of the block."""
    named = [line for name, line in properties.lines.items() if name in text]
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
    vectors: dict[str, Any] = {}
    for name in ("VOLUME_ACCELERATION", "GRAVITY", "BODY_FORCE"):
        value = np.asarray(properties.values.get(name, np.zeros(3)), dtype=float)
        if value.shape != (3,):
            problems.add(f"{name} must have three components", properties.lines.get(name))
            return
        vectors[name] = value
    a, g, b = vectors.values()
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


def _fill(values: Variables, document: Document, model: Model) -> None:
    """Put the data blocks of a document into variables."""
    mesh = document.mesh
    for data in document.nodal_data:
        rows = mesh.node_rows(data.ids)
        known = rows >= 0
        if data.values.size:
            values.set_nodes(data.variable, rows[known], data.values[known])
        if data.fixed.any():
            values.fix(data.variable, rows[known & data.fixed])
        elif data.variable.startswith("DISPLACEMENT") and data.values.any():
            model.notes.append(
                f"line {data.line}: initial values of {data.variable} do not matter in linear statics"
            )
    if document.condition_data:
        ids = np.concatenate([np.zeros(0, dtype=np.int64), *(block.ids for block in mesh.conditions)])
        order = np.argsort(ids, kind="stable")
        for data in document.condition_data:
            place = np.searchsorted(ids, data.ids, sorter=order).clip(max=max(len(ids) - 1, 0))
            rows = order[place] if len(ids) else np.zeros(0, dtype=np.int64)
            known = ids[rows] == data.ids if len(ids) else np.zeros(len(data.ids), dtype=bool)
            if data.values.size:
                values.set_conditions(data.variable, rows[known], data.values[known])
    for data in document.element_data:
        model.notes.append(f"line {data.line}: ElementalData {data.variable} is not used")


def _link(model: Model, document: Document) -> None:
    """Add the multi-point constraints of a document."""
    rows = document.mesh.node_rows
    for constraint in document.constraints:
        dofs = [constraint.slave, *constraint.masters]
        if not all(name in ("DISPLACEMENT_X", "DISPLACEMENT_Y", "DISPLACEMENT_Z") for _, name in dofs):
            model.notes.append(
                f"line {constraint.line}: constraint {constraint.id} is not on displacements; ignored"
            )
            continue
        slave, *masters = [(int(rows([node])[0]), name[-1].lower()) for node, name in dofs]
        weights: dict[tuple[int, str], float] = {}
        for master, weight in zip(masters, constraint.weights, strict=True):
            weights[master] = weights.get(master, 0.0) + weight
        model.link(slave, weights, constraint.constant)
