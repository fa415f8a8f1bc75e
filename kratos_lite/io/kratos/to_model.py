"""From a Document to a Model: element names, materials, supports and loads as Kratos means them."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.elements import ELEMENTS
from kratos_lite.elements.formulations import is_unnamed
from kratos_lite.errors import InputError, Problems, naming, nearest
from kratos_lite.io.formats.document import Constraint, Data, Document, Note
from kratos_lite.io.formats.mdpa.mesh import NO_NODES
from kratos_lite.io.kratos.context import Omission
from kratos_lite.io.kratos.point_elements import set_apart
from kratos_lite.io.kratos.properties import NO_EXPANSION, USED, apply_properties, expanding
from kratos_lite.io.kratos.variables import LOADING, SPLIT, TEMPERATURE, VECTORS, Variables, components
from kratos_lite.io.names import LOADED, SURE, misspelt
from kratos_lite.mesh import Mesh, ids_of, rows_of_ids
from kratos_lite.solvers.constraints import Constraints
from kratos_lite.typing import Array, Ints

DISPLACEMENTS = ("DISPLACEMENT_X", "DISPLACEMENT_Y", "DISPLACEMENT_Z")

PRESENT = ("SmallDisplacementElement", "TotalLagrangianElement", "UpdatedLagrangianElement", "Element3D")
"""Elements of Kratos today; they take the DISPLACEMENT of free nodes for a guess."""
OF_ELEMENTS = {
    **dict.fromkeys(("LOCAL_AXIS_1", "LOCAL_AXIS_2"), "of orthotropic elements is not supported: their "
                    "material has the axes x y z; turn the mesh, or leave it out"),
    "REFERENCE_TEMPERATURE": "is not supported; give it in Properties",
}  # fmt: skip
"""Data of elements that change a solution in Kratos."""


def model_from(
    document: Document,
    *,
    materials: bool = True,
    initial_displacement: bool = True,
    processes: Callable[[Variables], None] | None = None,
    follows: bool = False,
) -> Model:
    """Return the model that a document describes; `processes` may change the values, as a run file does.

    Loads of conditions follow the body that they act on if this is nonlinear, or `follows`.
    """
    if not document.mesh.n_nodes:
        raise InputError(f"{document.mesh.source}: {NO_NODES}")
    document = set_apart(document)
    _check_elements(document)
    _check_variables(document)
    model = Model(document.mesh)
    model.notes += [str(note) for note in document.notes]
    model.notes += _renamed(document.mesh)
    problems = Problems()
    for properties in document.used_properties():
        problems.source = properties.source or document.mesh.source
        apply_properties(model, properties, materials, problems)
    problems.raise_if_any()
    values = Variables(document.mesh, expanding(document, materials), follows or model.is_nonlinear)
    _fill(values, document, model)
    u0 = values.nodal.vector("DISPLACEMENT")
    if processes:
        processes(values)
    with naming(document.mesh.source):
        _check_temperatures(values, document, model)
        values.apply(model)
        if initial_displacement:
            _activate(model, u0)
        _constrain(model, document)
        for each in document.attached:
            model.add(each)
    return model


def _check_elements(document: Document) -> None:
    """Raise InputError for every block of unknown elements, or of misspelt conditions, that is not empty."""
    mesh, problems = document.mesh, Problems(document.mesh.source)
    for block in mesh.blocks:
        if len(block) and block.name not in ELEMENTS:
            line = None if block.lines is None else int(block.lines.min())
            known = [*ELEMENTS, *(alias for name in ELEMENTS for alias in ELEMENTS.aliases(name))]
            hint = nearest(block.name, known) if "3D" in block.name else ""
            have = ", ".join(sorted(ELEMENTS, key=lambda name: (len(name), name)))
            text = f"unknown element {block.name!r} ({len(block)} of them);{hint} Known are {have}"
            problems.add(f"{text} and their Kratos names", line)
    for block in mesh.conditions:
        kind = block.name.split("3D")[0]
        if len(block) and kind not in LOADED and (meant := get_close_matches(kind, LOADED, 1, SURE)):
            line = None if block.lines is None else int(block.lines.min())
            text = f"unknown condition {block.name!r} ({len(block)} of them)"
            problems.add(f"{text}. Did you mean {block.name.replace(kind, meant[0])}?", line)
    problems.raise_if_any()


def _check_variables(document: Document) -> None:
    """Raise InputError for variables that are one of a load, support or constant but for a letter or two."""
    problems = Problems()
    of_data = {*LOADING, *VECTORS, *SPLIT}
    variables = [
        (name, USED, block.source, block.lines.get(name))
        for block in document.properties.values()
        for name in block.values
    ]
    blocks = (*document.nodal_data, *document.condition_data)
    variables += [(data.variable, of_data, data.source, data.line) for data in blocks]
    for name, known, source, line in variables:
        if name not in known and (meant := misspelt(name, sorted(known))):
            place = ":".join(str(part) for part in (source or document.mesh.source, line) if part)
            problems.add(f"{place}: unknown variable {name}. Did you mean {meant}?")
    problems.raise_if_any()


def _renamed(mesh: Mesh) -> list[str]:
    """Return a note for each kind of element that is solved under another name."""
    notes = {}
    for block in mesh.blocks:
        name = ELEMENTS[block.name].__name__ if block.name in ELEMENTS else block.name
        if len(block) and name != block.name and not is_unnamed(block.name):
            large = (
                " with small displacements" if "Lagrangian" in block.name and "Lagrangian" not in name else ""
            )
            notes[block.name] = f"{block.name} is solved as {name}{large}"
    return list(notes.values())


def _fill(values: Variables, document: Document, model: Model) -> None:
    """Put the data blocks of a document into variables."""
    mesh, problems, ids = document.mesh, Problems(), ids_of(document.mesh.conditions)
    blocks = [(values.nodal, data, mesh.node_rows(data.ids)) for data in document.nodal_data]
    blocks += [(values.conditional, data, rows_of_ids(ids, data.ids)) for data in document.condition_data]
    for fields, data, indices in blocks:
        known = indices >= 0
        if _fits(data, model, problems, mesh.source):
            if fields is values.nodal:
                _note_overridden(values, data, indices, model)
            if data.values.size:
                fields.put(data.variable, indices[known], data.values[known])
            if data.fixed.any():
                values.fix(data.variable, indices[known & data.fixed])
    turned = any("YOUNG_MODULUS_X" in block.values for block in document.properties.values())
    for data in document.element_data:
        if text := OF_ELEMENTS.get(data.variable if turned else data.variable.replace("LOCAL_AXIS", "")):
            problems.add(f"{data.source or mesh.source}:{data.line}: ElementalData {data.variable} {text}")
        kind = str if data.variable.startswith("LOCAL_AXIS") else Omission
        _note(model, data, f"ElementalData {data.variable} is not used", kind)
    problems.raise_if_any()


def _check_temperatures(values: Variables, document: Document, model: Model) -> None:
    """Raise InputError for temperatures that strain nothing; note where none is stated."""
    T = values.nodal.get(TEMPERATURE)
    if T is not None and T.any() and not values.expanding:
        data = next(data for data in document.nodal_data if data.variable == TEMPERATURE)
        raise InputError(str(Note(data.line, NO_EXPANSION, data.source or document.mesh.source)))
    if T is not None and values.expanding and (cold := int((T == 0).sum())):
        model.notes.append(f"TEMPERATURE is 0 at {cold} nodes; it is 0, as in Kratos, where none is given")


def _activate(model: Model, u0: Array) -> None:
    """Make elements free of stress at the displacement that a file gives to nodes that it does not fix."""
    # Source: KinematicLinear::Initialize of KratosStructuralApplication. The present elements of Kratos take
    # it for a guess, which linear statics does not need.
    u0 = np.where(model.supports.fixed, 0.0, u0)
    mesh = model.mesh
    count = int(u0.any(axis=1).sum())
    others = [block.name for block in mesh.blocks if len(block) and block.name.startswith(PRESENT)]
    if count and others:
        text = f"initial DISPLACEMENT of {count} free nodes is not used: {others[0]} takes it for a guess"
        model.notes.append(f"{text}, only KinematicLinear3D and its kin for the state without stress")
    elif count:
        model.set_stress_free_state(u0)
        text = f"elements are free of stress at the initial DISPLACEMENT of {count} free nodes"
        model.notes.append(f"{text}; --ignore-initial-displacement leaves it out")


def _note(model: Model, data: Data, text: str, kind: type[str] = str) -> None:
    model.notes.append(kind(Note(data.line, text, data.source)))


def _fits(data: Data, model: Model, problems: Problems, source: str) -> bool:
    """Whether the values have the size of their variable; note what is unused, refuse what is wrong."""
    wanted = (3,) if data.variable in SPLIT else ()
    if not data.values.size or data.values.shape[1:] == wanted:
        return True
    size = list(data.values.shape[1:]) or "of one number"
    if data.variable in VECTORS or data.variable in LOADING:
        text = f"{data.variable} has values {size}; expected {'[3] (x, y, z)' if wanted else 'one number'}"
        problems.add(f"{data.source or source}:{data.line}: {text}")
    else:
        _note(model, data, f"{data.variable} is not used by a static solution of solids")
    return False


def _note_overridden(values: Variables, data: Data, indices: Ints, model: Model) -> None:
    """Note fixed values that an earlier block gave otherwise."""
    known = indices >= 0
    for name, new in components(data.variable, data.values).items():
        if name in values.fixed and new.size:
            at = indices[known]
            changed = values.fixed[name][at] & (values.nodal[name][at] != new[known])
            if count := int(changed.sum()):
                more = f" (and {count - 1} more)" if count > 1 else ""
                which = f"{name} of node {data.ids[known][changed].min()}{more}"
                _note(model, data, f"{which} is fixed to another value before; the last one counts")


def _constrain(model: Model, document: Document) -> None:
    """Add the multi-point constraints of a document."""
    known: list[Constraint] = []
    for constraint in document.constraints:
        if {name for _, name in (constraint.dependent, *constraint.independents)} <= set(DISPLACEMENTS):
            known.append(constraint)
        else:
            text = f"constraint {constraint.id} is not on displacements; ignored"
            model.notes.append(Omission(Note(constraint.line, text)))
    if not known:
        return

    def dofs(pairs: list[tuple[int, str]]) -> Ints:
        ids, names = zip(*pairs, strict=True)
        axes = np.array([DISPLACEMENTS.index(name) for name in names])
        return 3 * document.mesh.node_rows(ids) + axes

    counts = [len(constraint.weights) for constraint in known]
    constraints = Constraints(
        dofs([constraint.dependent for constraint in known]),
        np.concatenate([[0], np.cumsum(counts)]),
        dofs([pair for constraint in known for pair in constraint.independents]),
        np.array([weight for constraint in known for weight in constraint.weights]),
        np.array([constraint.constant for constraint in known]),
    )
    model.supports.add_constraints(constraints)
