"""Variables: values of Kratos variables on nodes and conditions, and what they mean for a model.

Both the data blocks of a file and the processes of a run file put values here; `apply` then
turns them into supports and loads.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.analysis.fields import FIELDS
from kratos_lite.analysis.model import Model
from kratos_lite.io.formats.document import Properties
from kratos_lite.io.kratos.context import Omission
from kratos_lite.io.kratos.properties import reference_temperature
from kratos_lite.io.names import IDLE, LOADED
from kratos_lite.mesh import Block, Mesh, ids_of, with_rows
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.surface import SURFACES, ConditionLoads
from kratos_lite.model.loads.temperature import Temperature
from kratos_lite.typing import Array, Mask

LOADS = {
    "point": "POINT_LOAD",
    "line": "LINE_LOAD",
    "triangle": "SURFACE_LOAD",
    "quadrilateral": "SURFACE_LOAD",
}
"""Variable that loads a condition, by its cell."""
PRESSURES = ("POSITIVE_FACE_PRESSURE", "NEGATIVE_FACE_PRESSURE")
DISPLACEMENT, VELOCITY = (FIELDS[name].kratos for name in ("displacement", "velocity"))
VECTORS = (DISPLACEMENT, "VOLUME_ACCELERATION", "POINT_LOAD", "LINE_LOAD", "SURFACE_LOAD")
TEMPERATURE = "TEMPERATURE"
LOADING = {*(f"{v}_{a}" for v in VECTORS for a in "XYZ"), *PRESSURES, TEMPERATURE}
"""Components and scalars that a static linear solution uses."""
SPLIT = (*VECTORS, VELOCITY)
"""Vector variables that are kept by component; velocities are those at the start of a transient."""


def components(variable: str, values: ArrayLike) -> dict[str, Array]:
    """Return a vector variable as its three components, a scalar as itself.

    >>> sorted(components("POINT_LOAD", [[1.0, 2.0, 3.0]]))
    ['POINT_LOAD_X', 'POINT_LOAD_Y', 'POINT_LOAD_Z']
    """
    array = np.asarray(values, dtype=float)
    if variable in SPLIT and array.shape[-1:] == (3,):
        return {f"{variable}_{axis}": array[..., i] for i, axis in enumerate("XYZ")}
    return {variable: array}


def carries(block: Block) -> bool:
    """Whether conditions carry the loads of a file."""
    return block.shape is not None and len(block) > 0 and block.name.split("3D")[0] in LOADED


class Fields(dict[str, Array]):
    """Scalars and components by name, each with one number for every node or condition."""

    def __init__(self, count: int) -> None:
        super().__init__()
        self.count = count

    def put(self, variable: str, indices: ArrayLike, values: ArrayLike) -> None:
        """Set a scalar, component or vector variable at indices."""
        for name, value in components(variable, values).items():
            self.setdefault(name, np.zeros(self.count))[np.asarray(indices, dtype=np.int64)] = value

    def scalar(self, name: str) -> Array:
        """Return the values of a scalar or component, 0 where none were set."""
        return self.get(name, np.zeros(self.count))

    def vector(self, variable: str) -> Array:
        """Return the values (m, 3) of a vector variable."""
        return np.stack([self.scalar(f"{variable}_{axis}") for axis in "XYZ"], axis=1)

    def copy(self) -> Fields:
        """Return a copy whose values can be changed without changing these."""
        other = Fields(self.count)
        other.update((name, values.copy()) for name, values in self.items())
        return other

    def loaded(self, variable: str) -> Mask:
        """Return where a variable or a component of it is not 0."""
        loaded: Mask = (self.scalar(variable) != 0) | (self.vector(variable) != 0).any(axis=1)
        return loaded


class Variables:
    """Values of variables on the nodes and conditions of a mesh; later values replace earlier ones."""

    def __init__(self, mesh: Mesh, expanding: Sequence[Properties] = (), follows: bool = False) -> None:
        kinds = (block.name for block in mesh.conditions if len(block))
        self.follows = follows and any(kind.startswith(ConditionLoads.following) for kind in kinds)
        self.mesh, self.moves = mesh, False  # Kratos puts the loads of a step on the mesh as moved before
        self.expanding = expanding  # the properties of elements that a temperature strains
        self.nodal, self.conditional = Fields(mesh.n_nodes), Fields(mesh.n_conditions)
        self.fixed: dict[str, Mask] = {}

    def fix(self, component: str, indices: ArrayLike, fixed: ArrayLike = True) -> None:
        """Fix (or free) a component on nodes of these indices."""
        mask = self.fixed.setdefault(component, np.zeros(self.mesh.n_nodes, dtype=bool))
        mask[np.asarray(indices, dtype=np.int64)] = fixed

    def copy(self) -> Variables:
        """Return a copy that can be changed without changing this."""
        other = Variables(self.mesh, self.expanding, self.follows)
        other.nodal, other.conditional = self.nodal.copy(), self.conditional.copy()
        other.fixed = {name: fixed.copy() for name, fixed in self.fixed.items()}
        return other

    def drop(self, names: Iterable[str]) -> None:
        """Forget the values of some scalars and components."""
        for name in names:
            self.nodal.pop(name, None)
            self.conditional.pop(name, None)

    def gravity(self) -> Gravity | None:
        """Return the weight that the nodes state, or None."""
        g = self.nodal.vector("VOLUME_ACCELERATION")
        return Gravity(g) if g.any() else None

    def temperature(self, properties: Properties) -> Temperature | None:
        """Return the temperature of elements with these properties, or None; 0 at nodes that state none."""
        values = self.nodal.get(TEMPERATURE)
        if values is None:
            return None
        return Temperature(values, reference_temperature(properties, self.mesh.source), properties.id)

    def apply(self, model: Model) -> None:
        """Add the supports and loads that the values mean to a model, and note those without effect."""
        self._apply_supports(model)
        for load in (self.gravity(), self.condition_loads(), *map(self.temperature, self.expanding)):
            if load is not None:
                model.add(load)
        self.note_idle(model.notes)
        self.note_means(model.notes)
        idle = {*self.nodal, *self.conditional} - LOADING | {TEMPERATURE} & self.conditional.keys()
        for name in sorted(idle):
            if self.nodal.scalar(name).any() or self.conditional.scalar(name).any():
                model.notes.append(f"{name} is set in the file; a static linear solution does not use it")

    def _apply_supports(self, model: Model) -> None:
        for axis in "XYZ":
            name = f"{DISPLACEMENT}_{axis}"
            indices = np.flatnonzero(self.fixed.get(name, np.zeros(0, dtype=bool)))
            if len(indices):
                model.fix(indices, axis.lower(), self.nodal.scalar(name)[indices, None], override=True)
        others = [name for name, fixed in sorted(self.fixed.items()) if fixed.any()]
        if others := [name for name in others if not name.startswith((f"{DISPLACEMENT}_", TEMPERATURE))]:
            model.notes.append(f"fixed {', '.join(others)} ignored: solids have displacements only")

    def condition_loads(self) -> ConditionLoads | None:
        """Return the loads that conditions carry, or None."""
        force = np.zeros((self.mesh.n_conditions, 3))
        nodal_force = {cell: self.nodal.vector(name) for cell, name in LOADS.items()}
        carriers = [(block, at) for block, at in with_rows(self.mesh.conditions) if carries(block)]
        for block, at in carriers:
            force[at] = self.conditional.vector(LOADS[block.known_shape.cell])[at]
        positive, negative = PRESSURES
        pressure, nodal_pressure = (
            fields.scalar(positive) - fields.scalar(negative) for fields in (self.conditional, self.nodal)
        )
        values = (force, *nodal_force.values(), pressure, nodal_pressure)
        is_loaded = len(carriers) > 0 and any(value.any() for value in values)
        idle = [b.name for b in self.mesh.conditions if b.shape is not None and not carries(b)]
        given = force, nodal_force, pressure, nodal_pressure, self.follows, idle
        return ConditionLoads(*given) if is_loaded else None

    def note_idle(self, notes: list[str]) -> None:
        """Note loads where nothing carries them, and those that Kratos alone puts on a deformed body."""
        # Kratos adds the stiffness of such a pressure to K even in a linear analysis; its small-displacement
        # conditions do not.
        self._note_uncarried(notes)
        blocks = {block.name: block for block in self.mesh.conditions if len(block)}
        given = {*self.nodal, *self.conditional}
        for name in () if self.follows else sorted(blocks):
            presses = name.startswith("SurfaceLoadCondition") and not given.isdisjoint(PRESSURES)
            if presses:
                how = f"acts on the undeformed body, as that of SmallDisplacement{name} in Kratos"
                text = f"{name}: the pressure {how}; {name} adds a pressure stiffness there"
                notes.append(Omission(text))
            follows = name.startswith(ConditionLoads.following)
            loads = follows and any(v.startswith(LOADS[blocks[name].known_shape.cell]) for v in given)
            if self.moves and (presses or loads):
                text = f"{name}: Kratos puts the load of a step on the mesh as those before moved it"
                cure = f'SmallDisplacement{name}, or "move_mesh_flag": false, means the same'
                notes.append(Omission(f"{text}, kratos_lite on the undeformed one; {cure}"))

    def note_means(self, notes: list[str]) -> None:
        """Note linear elements in which the temperature varies."""
        T, ids = self.nodal.scalar(TEMPERATURE), [properties.id for properties in self.expanding]
        for block in self.mesh.blocks:
            nodes = block.nodes[np.isin(block.properties, ids)]
            if block.shape is not None and block.shape.degree == 1 and np.ptp(T[nodes], axis=1).any():
                text = f"TEMPERATURE varies in {block.name}: its mean strains an element"
                notes.append(Omission(f"{text}; Kratos takes that of each Gauss point"))

    def _note_uncarried(self, notes: list[str]) -> None:
        """Note load values on conditions of another kind, and on nodes without conditions that carry them."""
        mesh = self.mesh
        for variable in (*dict.fromkeys(LOADS.values()), *PRESSURES):
            cells = [c for c, load in LOADS.items() if load == variable] or SURFACES
            kinds = "faces" if cells[0] in SURFACES else f"{cells[0]} conditions"
            on_conditions, on_nodes = self.conditional.loaded(variable), self.nodal.loaded(variable)
            kind, other = str, ""
            for block, indices in with_rows(mesh.conditions):
                if carries(block):
                    if block.known_shape.cell in cells:
                        on_conditions[indices] = on_nodes[block.nodes] = False
                elif on_conditions[indices].any():
                    kind = kind if block.name.startswith(IDLE) else Omission  # Kratos may know more of it
                    other = f"; {block.name} carries no load"
            for word, idle, ids, more in (
                ("conditions", on_conditions, ids_of(mesh.conditions), other),
                ("nodes", on_nodes, mesh.node_ids, ", and none has these nodes"),
            ):
                if idle.any():
                    where = f"{idle.sum()} {word} (first {ids[idle].min()})"
                    notes.append(kind(f"{variable} on {where} has no effect: only {kinds} carry it{more}"))
