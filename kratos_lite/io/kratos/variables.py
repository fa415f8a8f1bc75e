"""Variables: values of Kratos variables on nodes and conditions, and what they mean for a model.

Both the data blocks of a file and the processes of a run file put values here; `apply` then
turns them into supports and loads.
"""

from __future__ import annotations

from collections.abc import Container, Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.analysis.model import Model
from kratos_lite.mesh import Mesh, with_rows
from kratos_lite.model.loads import SURFACES, ConditionLoads, Gravity
from kratos_lite.typing import Array

LOADS = {
    "point": "POINT_LOAD",
    "line": "LINE_LOAD",
    "triangle": "SURFACE_LOAD",
    "quadrilateral": "SURFACE_LOAD",
}
"""Variable that loads a condition, by its cell."""
PRESSURES = ("POSITIVE_FACE_PRESSURE", "NEGATIVE_FACE_PRESSURE")
VECTORS = ("DISPLACEMENT", "VOLUME_ACCELERATION", "POINT_LOAD", "LINE_LOAD", "SURFACE_LOAD")
LOADING = {*(f"{v}_{a}" for v in VECTORS for a in "XYZ"), *PRESSURES}
"""Components and scalars that a static linear solution uses."""


SPLIT = (*VECTORS, "VELOCITY")
"""Vector variables that are kept by component; velocities are those at the start of a march."""


def components(variable: str, values: ArrayLike) -> dict[str, Array]:
    """Return a vector variable as its three components, a scalar as itself.

    >>> sorted(components("POINT_LOAD", [[1.0, 2.0, 3.0]]))
    ['POINT_LOAD_X', 'POINT_LOAD_Y', 'POINT_LOAD_Z']
    """
    array = np.asarray(values, dtype=float)
    if variable in SPLIT and array.shape[-1:] == (3,):
        return {f"{variable}_{axis}": array[..., i] for i, axis in enumerate("XYZ")}
    return {variable: array}


class Variables:
    """Values of variables on the nodes and conditions of a mesh; later values replace earlier ones."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.nodal: dict[str, Array] = {}
        self.fixed: dict[str, NDArray[np.bool_]] = {}
        self.conditional: dict[str, Array] = {}

    def set_nodes(self, variable: str, rows: ArrayLike, values: ArrayLike) -> None:
        """Set a scalar, component or vector variable on node rows."""
        for name, value in components(variable, values).items():
            field = self.nodal.setdefault(name, np.zeros(self.mesh.n_nodes))
            field[np.asarray(rows, dtype=np.int64)] = value

    def fix(self, component: str, rows: ArrayLike, fixed: ArrayLike = True) -> None:
        """Fix (or free) a component on node rows."""
        mask = self.fixed.setdefault(component, np.zeros(self.mesh.n_nodes, dtype=bool))
        mask[np.asarray(rows, dtype=np.int64)] = fixed

    def set_conditions(self, variable: str, rows: ArrayLike, values: ArrayLike) -> None:
        """Set a scalar, component or vector variable on condition rows."""
        for name, value in components(variable, values).items():
            field = self.conditional.setdefault(name, np.zeros(self.mesh.n_conditions))
            field[np.asarray(rows, dtype=np.int64)] = value

    def copy(self) -> Variables:
        """Return a copy that can be changed without changing this."""
        return self.only({*self.nodal, *self.fixed, *self.conditional})

    def only(self, names: Container[str]) -> Variables:
        """Return a copy of some scalars and components."""
        other = Variables(self.mesh)
        other.nodal = {k: v.copy() for k, v in self.nodal.items() if k in names}
        other.fixed = {k: v.copy() for k, v in self.fixed.items() if k in names}
        other.conditional = {k: v.copy() for k, v in self.conditional.items() if k in names}
        return other

    def drop(self, names: Iterable[str]) -> None:
        """Forget the values of some scalars and components."""
        for name in names:
            self.nodal.pop(name, None)
            self.conditional.pop(name, None)

    def vector(self, variable: str) -> Array:
        """Return the values (n, 3) of a vector variable on the nodes."""
        return self._vector(self.nodal, variable, self.mesh.n_nodes)

    def gravity(self) -> Gravity | None:
        """Return the weight that the nodes state, or None."""
        g = self.vector("VOLUME_ACCELERATION")
        return Gravity(g) if g.any() else None

    def apply(self, model: Model) -> None:
        """Add the supports and loads that the values mean to a model, and note those without effect."""
        self._apply_supports(model)
        for load in (self.gravity(), self.condition_loads()):
            if load is not None:
                model.add(load)
        self.note_idle(model.notes)
        for name in sorted({*self.nodal, *self.conditional} - LOADING):
            if any(name in fields and fields[name].any() for fields in (self.nodal, self.conditional)):
                model.notes.append(f"{name} is set in the file; a static linear solution does not use it")

    def _apply_supports(self, model: Model) -> None:
        for axis in "XYZ":
            name = f"DISPLACEMENT_{axis}"
            rows = np.flatnonzero(self.fixed.get(name, np.zeros(0, dtype=bool)))
            values = self.nodal.get(name, np.zeros(self.mesh.n_nodes))
            if len(rows):
                model.fix(rows, axis.lower(), values[rows, None], override=True)
        others = sorted(v for v in self.fixed if not v.startswith("DISPLACEMENT_") and self.fixed[v].any())
        if others:
            model.notes.append(f"fixed {', '.join(others)} ignored: solids have displacements only")

    @staticmethod
    def _vector(fields: dict[str, Array], variable: str, count: int) -> Array:
        zero = np.zeros(count)
        return np.stack([fields.get(f"{variable}_{axis}", zero) for axis in "XYZ"], axis=1)

    def condition_loads(self) -> ConditionLoads | None:
        """Return the loads that conditions carry, or None."""
        mesh = self.mesh
        force = np.zeros((mesh.n_conditions, 3))
        nodal_force = {cell: self._vector(self.nodal, name, mesh.n_nodes) for cell, name in LOADS.items()}
        carried: set[str] = set()
        for block, rows in with_rows(mesh.conditions):
            if block.shape is not None and len(block):
                variable = LOADS[block.shape.cell]
                carried.add(variable)
                force[rows] = self._vector(self.conditional, variable, mesh.n_conditions)[rows]
        zero, nodal_zero = np.zeros(mesh.n_conditions), np.zeros(mesh.n_nodes)
        positive, negative = PRESSURES
        pressure = self.conditional.get(positive, zero) - self.conditional.get(negative, zero)
        nodal_pressure = self.nodal.get(positive, nodal_zero) - self.nodal.get(negative, nodal_zero)
        values = (force, *nodal_force.values(), pressure, nodal_pressure)
        if not carried or not any(value.any() for value in values):
            return None
        return ConditionLoads(force, nodal_force, pressure, nodal_pressure)

    def _note_followers(self, notes: list[str]) -> None:
        """Note pressures that Kratos lets follow the deformed faces even in a linear analysis.

        It adds the stiffness of the pressure to K; its small-displacement conditions do not.
        """
        names = {block.name for block in self.mesh.conditions if len(block)}
        for name in sorted(n for n in names if n.startswith("SurfaceLoadCondition")):
            notes.append(
                f"{name}: the pressure acts on the undeformed body, as that of SmallDisplacement{name} in "
                f"Kratos; {name} adds a pressure stiffness there"
            )

    def note_idle(self, notes: list[str], names: Iterable[str] = LOADING) -> None:
        """Note loads where nothing carries them, and pressures that would follow the faces in Kratos."""
        shown = self.only(set(names))
        shown._note_uncarried(notes)
        loads = shown.condition_loads()
        if loads is not None and (loads.pressure.any() or loads.nodal_pressure.any()):
            shown._note_followers(notes)

    def _note_uncarried(self, notes: list[str]) -> None:
        """Note load values on conditions of another kind, and on nodes without conditions that carry them."""
        ids = np.concatenate([np.zeros(0, dtype=np.int64), *(b.ids for b in self.mesh.conditions)])
        for variable in (*dict.fromkeys(LOADS.values()), *PRESSURES):
            cells = [c for c, load in LOADS.items() if load == variable] or SURFACES
            on_conditions, on_nodes = self._carriers(cells)
            kinds = "faces" if cells[0] in SURFACES else f"{cells[0]} conditions"
            idle = _loaded(self.conditional, variable, on_conditions)
            if idle.any():
                where = f"{idle.sum()} conditions (first {ids[idle][0]})"
                notes.append(f"{variable} on {where} has no effect: only {kinds} carry it")
            idle = _loaded(self.nodal, variable, on_nodes)
            if idle.any():
                where = f"{idle.sum()} nodes (first {self.mesh.node_ids[idle][0]})"
                text = f"only {kinds} carry it, and none has these nodes"
                notes.append(f"{variable} on {where} has no effect: {text}")

    def _carriers(self, cells: Iterable[str]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which conditions are of these cells, and which nodes they have."""
        nodes, masks = np.zeros(self.mesh.n_nodes, dtype=bool), [np.zeros(0, dtype=bool)]
        for block in self.mesh.conditions:
            carries = block.shape is not None and block.shape.cell in cells
            masks.append(np.full(len(block), carries))
            if carries:
                nodes[block.nodes] = True
        return np.concatenate(masks), nodes


def _loaded(fields: dict[str, Array], variable: str, carried: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where a variable or a component of it is not 0 although nothing carries it."""
    loaded = np.zeros(len(carried), dtype=bool)
    for name in (variable, *(f"{variable}_{axis}" for axis in "XYZ")):
        if name in fields:
            loaded |= fields[name] != 0
    return loaded & ~carried
