"""The models of a deck: its elements and laws, and the supports and loads of steps on them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.model import Model
from kratos_lite.errors import InputError, ModelError
from kratos_lite.io.abaqus.deck import Deck, Step
from kratos_lite.io.abaqus.loads import Acting
from kratos_lite.io.abaqus.materials import Definition, material_of
from kratos_lite.io.abaqus.mesh import ELEMENT_TYPES, FINITE, with_faces
from kratos_lite.io.abaqus.supports import Nodal
from kratos_lite.mesh import NO_ROWS, Mesh, distinct, rows_of_ids, select, with_rows
from kratos_lite.model.loads.base import Load
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.nodal import NodalForces
from kratos_lite.model.loads.surface import ConditionLoads
from kratos_lite.model.loads.temperature import Temperature
from kratos_lite.quadrature import Rule, by_order
from kratos_lite.typing import Array, Ints, Rows


class Building:
    """Makes models of a deck."""

    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        pressed = np.any([step.acting.pressures.given for step in deck.steps], axis=0)
        faces = np.argwhere(pressed).reshape(-1, 2)
        self.mesh, self.faces = with_faces(deck.mesh, faces, "SmallDisplacementSurfaceLoadCondition")

    def model(self, large: bool = False, now: Array | None = None) -> Model:
        """Return the model without its loads and supports, at temperatures (n,) or those of the beginning."""
        deck = self.deck
        mesh = self._finite() if large else self.mesh
        model = Model(mesh)
        for block, at in with_rows(self.mesh.blocks):
            if rule := self._rule(block.name, large):
                model.use_rule(rule, np.arange(at.start, at.stop))
        assigned = np.zeros(mesh.n_elements, dtype=bool)
        for elset, name, axes, card in deck.sections:
            if name not in deck.materials:
                card.wrong(f"there is no *MATERIAL {name}")
            if axes and axes not in deck.orientations:
                card.wrong(f"there is no *ORIENTATION {axes}")
            deck.geometry.elements_of(elset, card)
            rows = mesh.parts[elset].elements if elset in mesh.parts else NO_ROWS
            definition = self._at(deck.materials[name], rows, now)
            material = material_of(definition, deck.orientations.get(axes), finite=large)
            model.assign(material, rows)
            assigned[rows] = True
        if not assigned.all():
            missing = mesh.element_ids[~assigned][0]
            place = next(cells.place for cells in deck.geometry.cells if missing in cells.ids)
            raise InputError(f"{place}: element {missing} is in no *SOLID SECTION")
        self._stress(model)
        model.recognize_units()
        model.notes += deck.notes
        return model

    def _at(self, definition: Definition, rows: Ints, now: Array | None) -> Definition:
        """Return a material at the temperatures of elements."""
        start = self.deck.initial
        if now is None and not start.any():
            return definition
        nodes = np.concatenate([NO_ROWS, *(b.nodes.ravel() for b in select(self.mesh.blocks, rows))])
        both = ((start if T is None else T)[self.deck.geometry.twin[nodes]] for T in (now, start))
        one, other = (float(T[0]) if len(T) and np.ptp(T) == 0 else None for T in both)
        return replace(definition, now=one, start=other)

    def hold(self, model: Model, held: Nodal, moves: dict[str, Any] | None = None) -> None:
        """Add supports and connections to a model; nodes that share axis, motion and axes are one call."""
        axes = self.deck.axes
        local = axes.of_node
        for system in np.unique(local[held.given.any(axis=1)]).tolist():
            of = held.given & (local == system)[:, None]
            frame = axes.each[system] if system >= 0 else None
            for axis in range(3):
                rows = np.flatnonzero(of[:, axis])
                numbers = held.amplitudes[rows, axis]
                for number in np.flatnonzero(np.bincount(numbers)):
                    some, name = rows[numbers == number], held.names[number]
                    letter = "xyz"[axis] if frame is None else frame.letters[axis]
                    value = moves[name] if name and moves else held.values[some, axis][:, None]
                    model.fix(some, letter, value, local=frame)
        self.deck.connections.connect(model)

    def loads(self, model: Model, acting: Acting, time: float = 0.0) -> Iterable[tuple[Load, str]]:
        """Yield the loads that act with the supports of a time, each with the name of its amplitude."""
        deck = self.deck
        for _, name, _, _ in deck.sections if acting.bodies else ():
            if "DENSITY" not in deck.materials[name].cards:
                deck.materials[name].card.wrong("GRAV and CENTRIF need its *DENSITY")
        mesh, n = model.mesh, model.mesh.n_nodes
        F, P, carried = acting.forces, acting.pressures, model.supports.acting(time).carried
        for name, of in F.by_amplitude():
            values = np.where(of, F.values, 0.0)
            turned = np.flatnonzero(values.any(axis=1) & (deck.axes.of_node >= 0))
            values[turned] = np.einsum("ni,nij->nj", values[turned], deck.axes.directions(mesh, turned))
            yield NodalForces(carried(values)), name
        for name, of in P.by_amplitude():
            some = np.where(of, P.values, 0.0)[tuple(self.faces.T)]
            none = {cell: np.zeros((n, 3)) for cell in ("point", "line", "triangle", "quadrilateral")}
            yield ConditionLoads(np.zeros((len(some), 3)), none, some, np.zeros(n)), name
        for (kind, at, places), (size, name, _) in acting.bodies.items():
            ids = distinct(deck.geometry.elements_of(at))
            where, masses = rows_of_ids(mesh.element_ids, ids), deck.geometry.masses_of(ids)
            where = where[where >= 0]
            if kind == "GRAV":
                force = size * np.array(places)
                if masses.any():
                    yield NodalForces(carried(masses[:, None] * force)), name
                yield Gravity(force, where), name
            elif masses.any():
                raise ModelError("*DLOAD: CENTRIF on masses is not supported; give their force by *CLOAD")
            else:
                yield _Centrifugal(model, size, places, where), name
        T, initial = acting.temperatures, deck.initial
        same = float(initial[0]) if (initial == initial[0]).all() else 0.0
        for name, of in T.by_amplitude():
            difference = np.where(of, T.values - initial[:, None], 0.0)[:, 0][deck.geometry.twin]
            yield Temperature(difference + same, same), name

    def is_nonlinear(self, step: Step) -> bool:
        """Return whether a step has large displacements or laws that are not linear."""
        names = {name for _, name, _, _ in self.deck.sections}
        laws = {k for n in names if n in self.deck.materials for k in self.deck.materials[n].cards}
        return step.large or bool(laws & {"PLASTIC", "HYPERELASTIC"})

    def count(self, step: Step) -> int:
        """Return the number of modes of a step."""
        numbers = step.numbers()
        if not numbers or numbers[0] != int(numbers[0]) or numbers[0] < 1:
            step.card.wrong(f"*{step.kind} needs the number of modes on its data line")
        return int(numbers[0])

    def earlier(self, step: Step) -> list[Step]:
        """Return the steps before one."""
        return self.deck.steps[: self.deck.steps.index(step)]

    def last(self, kind: str, step: Step) -> Step | None:
        """Return the last step of a kind before one, or None."""
        return next((s for s in reversed(self.earlier(step)) if s.kind == kind), None)

    def _rule(self, name: str, large: bool) -> Rule | int | None:
        """Return the Gauss points of CalculiX where they are others than ours."""
        if name == ELEMENT_TYPES["C3D6"]:
            thirds = np.array([(1 / 3, 1 / 3, -(3**-0.5)), (1 / 3, 1 / 3, 3**-0.5)])
            return Rule(thirds, np.full(2, 0.5), 1, "CalculiX C3D6")
        if name == ELEMENT_TYPES["C3D15"]:
            return by_order("wedge", 3)
        return 2 if large and name == ELEMENT_TYPES["C3D20R"] else None

    def _finite(self) -> Mesh:
        """Return the mesh with elements and loads of large displacements."""
        kinds = {name: kind for kind, name in ELEMENT_TYPES.items()}
        for block in self.mesh.blocks:
            if block.name not in FINITE:
                raise InputError(f"{self.deck.path}: NLGEOM with {kinds[block.name]} is not supported")
        blocks = [replace(b, name=FINITE[b.name]) for b in self.mesh.blocks]
        faces = [replace(b, name=b.name.removeprefix("SmallDisplacement")) for b in self.mesh.conditions]
        return self.mesh.replace(blocks=blocks, conditions=faces)

    def _stress(self, model: Model) -> None:
        """Add the stress of *INITIAL CONDITIONS, which is the same at all points of an element."""
        for card in self.deck.stresses:
            table = np.array([row.numbers(8) for row in card.rows()])
            rows = rows_of_ids(model.mesh.element_ids, table[:, 0].astype(np.int64))
            if (rows < 0).any():
                card.wrong(f"there is no element {table[rows < 0, 0][0]:g}")
            some, first, each = np.unique(rows, return_index=True, return_inverse=True)
            if np.abs(table[:, 2:] - table[first[each], 2:]).max() > 0:
                card.wrong("a stress that differs between the points of an element is not supported")
            model.add_prestress(table[first, 2:][:, voigt.ABAQUS], some)


class _Centrifugal(Gravity):
    """ω² times the distance from an axis, also of displaced elements."""

    def __init__(self, model: Model, square: float, places: tuple[float, ...], where: Ints) -> None:
        center, axis = np.array(places[:3]), np.array(places[3:]) / np.linalg.norm(places[3:])
        self._across = square * (np.eye(3) - np.outer(axis, axis))
        self._groups = model.element_groups()
        super().__init__(lambda X: (X - center) @ self._across, where)

    def follow(self, mesh: Mesh, x: Array) -> Iterator[tuple[Rows, Array, Array]]:
        """Yield what displacements add."""
        for part in self._carriers(mesh, self._groups):
            for chunk in part.chunks():
                nodes = part.nodes[chunk]
                M = part.at(mesh.points, chunk).scalar_mass(part.material.density)
                more = M @ (x - mesh.points)[nodes] @ self._across
                yield nodes, more, M[:, :, None, :, None] * self._across[:, None]
