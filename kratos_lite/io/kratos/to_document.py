"""From a Model to a Document, so that it can be written as `.mdpa`."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.nodal_loads import external_loads
from kratos_lite.errors import InputError
from kratos_lite.io.formats.document import Constraint, Data, Document, Note, Properties
from kratos_lite.io.kratos.point_elements import is_on_nodes, written
from kratos_lite.io.kratos.properties import THERMAL_LAW, USER_LAW
from kratos_lite.materials import Material
from kratos_lite.mesh import Block, Mesh, Part, with_rows
from kratos_lite.model.loads import TimeDependentLoad
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.temperature import Temperature, heated
from kratos_lite.shapes.faces import Point1
from kratos_lite.solvers.constraints import Constraints
from kratos_lite.tabular import names_of
from kratos_lite.typing import Array, Ints, Mask

KRATOS_LAW = {
    "Isotropic3D": "LinearElastic3DLaw",
    **dict.fromkeys(("Orthotropic3D", "Anisotropic3D"), USER_LAW),
}


def document_from(model: Model) -> Document:
    """Return a document that means the same model to Kratos and to kratos_lite.

    Every material becomes a Properties block, gravity on the whole body its VOLUME_ACCELERATION;
    all other loads become the point loads that they put on the nodes.
    """
    unwritten = {
        "a motion of the material": model.motion is not None,
        "a remote point": any(point.is_rigid or point.fixed.any() for point in model.remote_points),
        "an elastic support or added mass": not is_on_nodes(model.attached),
        "a support that moves in time": bool(model.supports.motions),
        "a factor of the stiffness of each element": model.stiffness_factors is not None,
        "a load that changes in time": any(isinstance(load, TimeDependentLoad) for load in model.loads),
    }
    for what, is_present in unwritten.items():
        if is_present:
            raise InputError(f"{what} cannot be written to a file of a model; leave it to a script")
    mesh, supports, start = model.mesh, model.supports, _initial_displacement(model)
    whole = [g for g in model.loads if isinstance(g, Gravity) and g.where is None and np.ndim(g.force) == 1]
    if model.attached and model.attached.M.count_nonzero():
        whole = []  # elements of one node have no weight by Properties
    gravity, others = sum((g.force for g in whole), np.zeros(3)), [x for x in model.loads if x not in whole]
    temperature, references = _temperature(model)
    numbers, properties = _properties(model, gravity, references)
    blocks = _blocks(model, numbers)
    forces = external_loads(model, model.element_groups(), others)
    loaded, number = (forces != 0).any(axis=1, keepdims=True), next(iter(properties), 0)
    points = Block("PointLoadCondition3D1N", np.argwhere(loaded)[:, :1], properties=number, shape=Point1)
    conditions = [points] if len(points) else []
    more, elemental = written(model.attached, blocks, number)
    whole_mesh = mesh.replace(blocks=[*blocks, *more], conditions=conditions, parts=_parts(mesh))
    constraints, fixed, values = supports.independent(), supports.fixed.copy(), supports.values.copy()
    depends = np.diff(constraints.start) > 0
    at = constraints.dependents[~depends]  # what constraints hold is fixed
    fixed.flat[at], values.flat[at] = True, constraints.constants[~depends]
    data = _nodal_data(mesh, "DISPLACEMENT", fixed, values, fixed=True) + start
    data += _nodal_data(mesh, "POINT_LOAD", np.repeat(loaded, 3, axis=1), forces)
    if len(hot := np.flatnonzero(np.isfinite(temperature))):
        free = np.zeros(len(hot), dtype=bool)
        data.append(Data("TEMPERATURE", mesh.node_ids[hot], free, temperature[hot]))
    tied = constraints_of(mesh, constraints.take(depends))
    document = Document(whole_mesh, properties, nodal_data=data, constraints=tied, element_data=elemental)
    if mesh.conditions:
        document.notes.append(Note(0, "conditions are replaced by the nodal forces of their loads"))
    if mesh.units != "SI":
        document.notes.append(Note(0, f"that the numbers, which stay, are in {mesh.units}"))
    return document


def _blocks(model: Model, numbers: Ints) -> list[Block]:
    """Return the elements with these properties, by the names of the classes that compute them."""
    mesh, groups = model.mesh, model.element_groups()
    names = np.concatenate([np.full(len(block), block.name, dtype=object) for block in mesh.blocks])
    if model.chosen():
        for group in groups:
            names[group.rows] = group.element.__name__
    blocks = []
    for block, indices in with_rows(mesh.blocks):
        block_names = names[indices]
        ends = [0, *(np.flatnonzero(block_names[1:] != block_names[:-1]) + 1).tolist(), len(block_names)]
        for first, last in pairwise(ends):
            if last > first:
                part = replace(block, properties=numbers[indices], lines=None).take(np.arange(first, last))
                blocks.append(replace(part, name=str(block_names[first])))
    return blocks


def _temperature(model: Model) -> tuple[Array, Array]:
    """Return the temperatures (n,) of nodes and (m,) without strain of elements; ∞ where nothing expands."""
    mesh = model.mesh
    loads = [load for load in model.loads if isinstance(load, Temperature)]
    nodes, references = np.full(mesh.n_nodes, np.inf), np.full(mesh.n_elements, np.inf)
    groups = [group for group in model.element_groups() if loads and group.material.expansion.any()]
    for group in groups:
        references[group.rows] = loads[0].reference
    for load in reversed(loads):
        own = mesh.elements(load.where)
        references[own] = np.where(np.isfinite(references[own]), load.reference, np.inf)
    values = []
    for group in heated(mesh, groups, [(1.0, load) for load in loads]):
        heating = 0.0 if group.heating is None else group.heating
        values.append((group.nodes, heating + references[group.rows, None]))
        nodes[group.nodes] = values[-1][1]
    if not all(np.allclose(nodes[at], T, rtol=1e-9) for at, T in values):
        raise InputError("temperatures that differ on two sides of a node cannot be written to a file")
    return nodes, references


def _properties(model: Model, gravity: Array, references: Array) -> tuple[Ints, dict[int, Properties]]:
    """Return the property id of each element, one per material and state at rest, and the Properties."""
    numbers = np.zeros(model.mesh.n_elements, dtype=np.int64)
    properties: dict[int, Properties] = {}
    known: list[tuple[Material, list[float]]] = []
    for group in model.element_groups():
        if group.rule is not group.element.rule:
            raise InputError("a model with replaced quadrature rules cannot be written to a file of a model")
        prestress = np.zeros((len(group.rows), 6)) if group.prestress is None else group.prestress
        at_rest = np.column_stack([prestress, references[group.rows]])
        different, which = np.unique(at_rest, axis=0, return_inverse=True)
        for i, state in enumerate(different):
            kind = (group.material, state.tolist())
            known += [] if kind in known else [kind]
            number = known.index(kind) + 1
            numbers[group.rows[which.ravel() == i]] = number
            properties[number] = Properties(number, _values(group.material, gravity, state))
    return numbers, properties


def _values(material: Material, gravity: Array, at_rest: Array) -> dict[str, Any]:
    name, prestress, reference = type(material).__name__, at_rest[:6], at_rest[6]
    if name not in KRATOS_LAW:
        raise InputError(f"material {name} has no name in Kratos; model files hold {', '.join(KRATOS_LAW)}")
    constants = [c for c in names_of(type(material)) if c not in material.tables]
    if "alpha" in material.tables and material.expansion.any():
        raise InputError(f"the thermal expansion of {name} cannot be written; Kratos has {THERMAL_LAW} alone")
    stated = {material.variables[c]: float(getattr(material, c)) for c in constants}
    values: dict[str, Any] = {name: v for name, v in stated.items() if v or "THERMAL" not in name}
    values["CONSTITUTIVE_LAW"] = KRATOS_LAW[name]
    if np.isfinite(reference):
        if name != "Isotropic3D":
            raise InputError(f"a temperature of {name} cannot be written; Kratos has {THERMAL_LAW} alone")
        values |= {"CONSTITUTIVE_LAW": THERMAL_LAW, "REFERENCE_TEMPERATURE": float(reference)}
    if values["CONSTITUTIVE_LAW"] == USER_LAW:
        values["ELASTICITY_TENSOR"] = material.C
    if gravity.any():
        values["VOLUME_ACCELERATION"] = gravity
    if prestress.any():
        values["PRESTRESS"] = 0.0 - prestress  # Kratos subtracts it
    return values


def _initial_displacement(model: Model) -> list[Data]:
    """Return the state without stress as the DISPLACEMENT of free nodes; InputError for supported ones."""
    u0 = model.initial_displacement
    if u0 is None:
        return []
    if u0[model.supports.fixed].any():
        what = "an initial displacement of prescribed degrees of freedom"
        raise InputError(f"{what} cannot be written: their DISPLACEMENT in a file is what is prescribed")
    return _nodal_data(model.mesh, "DISPLACEMENT", u0 != 0, u0)


def _nodal_data(mesh: Mesh, variable: str, where: Mask, values: Array, fixed: bool = False) -> list[Data]:
    """Return the components (n, 3) of a variable where a mask (n, 3) is set."""
    data = []
    for axis, letter in enumerate("XYZ"):
        if len(indices := np.flatnonzero(where[:, axis])):
            ids, mask = mesh.node_ids[indices], np.full(len(indices), fixed)
            data.append(Data(f"{variable}_{letter}", ids, mask, values[indices, axis]))
    return data


def _parts(mesh: Mesh) -> dict[str, Part]:
    """Return the parts with names that Kratos can read."""
    parts = {name_of_part(name): part for name, part in mesh.parts.items()}
    return {name: Part(part.nodes, part.elements, properties=()) for name, part in parts.items()}


def name_of_part(part: str) -> str:
    """Return the name of a part, or of a side, that Kratos can read.

    >>> name_of_part("z+")
    'z_plus'
    """
    return part.replace("+", "_plus").replace("-", "_minus")


def constraints_of(mesh: Mesh, constraints: Constraints) -> list[Constraint]:
    """Return constraints of a mesh as those of a file."""

    def dof(number: int) -> tuple[int, str]:
        return int(mesh.node_ids[number // 3]), f"DISPLACEMENT_{'XYZ'[number % 3]}"

    return [
        Constraint(
            i, dof(dependent), tuple(map(dof, independents.tolist())), tuple(weights.tolist()), constant
        )
        for i, (dependent, independents, weights, constant) in enumerate(constraints, start=1)
    ]
