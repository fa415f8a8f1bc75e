"""The models of a deck: its elements and laws, and the supports and loads of steps on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.analysis.model import Model
from kratos_lite.errors import InputError, ModelError
from kratos_lite.io.abaqus.deck import Deck, Step
from kratos_lite.io.abaqus.loads import courses
from kratos_lite.io.abaqus.materials import Definition, material_of
from kratos_lite.io.abaqus.mesh import ELEMENT_TYPES, FINITE, with_faces
from kratos_lite.mesh import NO_ROWS, Mesh, distinct, rows_of_ids, select, with_rows
from kratos_lite.model.loads.base import Load
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.nodal import NodalForces
from kratos_lite.model.loads.surface import ConditionLoads
from kratos_lite.model.loads.temperature import Temperature
from kratos_lite.model.reference_nodes import carried
from kratos_lite.quadrature import Rule, by_order
from kratos_lite.time_series import TimeSeries
from kratos_lite.typing import Array, Ints, Mask, Rows

AT_ONCE = 1e-9
"""Fraction of a step in which loads act that do not grow over it."""
MOVING = ("DYNAMIC", "MODALDYNAMIC")
LOADS = {"CLOAD": "_forces", "DLOAD": "_pressures", "BODIES": "_weights", "TEMPERATURE": "_temperatures"}
"""What makes the loads of each kind."""


class Building:
    """Makes models of a deck."""

    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        pressed = np.any([step.acting["DLOAD"].given for step in deck.steps], axis=0)
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

    def act(self, model: Model, steps: Sequence[Step], at_rest: bool = False) -> None:
        """Add the supports, connections and loads of steps in turn, or what acts at the end of one."""
        self._hold(model, steps, at_rest)
        for load, course in self.loads(model, steps, at_rest):
            model.add(load, amplitude=course)

    def _hold(self, model: Model, steps: Sequence[Step], at_rest: bool) -> None:
        """Add supports and connections; nodes that share axis, motion and axes are one call."""
        each = [step.acting["BOUNDARY"] for step in steps]
        given, numbers, rows = courses(each, none=-1)
        values = np.stack([np.where(one.given, one.values, 0.0) for one in each], axis=-1)
        changed = given & ~np.all([one.given for one in each], axis=0)
        moves = (values.any(axis=-1) | changed) & (not at_rest)
        if changed.any() and steps[0].kind in MOVING:
            steps[1].card.wrong("supports that change between steps in time are not supported")
        if (changed.any(axis=1) & ~model.mesh.used_nodes()).any() and self.deck.connections.springs:
            steps[1].card.wrong("supports of reference nodes that change are not supported with springs")
        axes = self.deck.axes
        for system in np.unique(axes.of_node[given.any(axis=1)]).tolist():
            frame = axes.each[system] if system >= 0 else None
            for axis, letter in enumerate("xyz" if frame is None else frame.letters):
                of = given[:, axis] & (axes.of_node == system)
                for number in np.unique(numbers[of, axis]).tolist():
                    some = of & (numbers[:, axis] == number)
                    still, moved = (np.flatnonzero(some & (moves[:, axis] == one)) for one in (False, True))
                    if len(still):
                        model.fix(still, letter, values[still, axis, :1], local=frame)
                    if len(moved):
                        motion = _motion(values[:, axis], self._courses(steps, rows[number]))
                        model.fix(moved, letter, motion, local=frame)
        self.deck.connections.connect(model)

    def loads(
        self, model: Model, steps: Sequence[Step], at_rest: bool, kinds: Mapping[str, str] = LOADS
    ) -> Iterator[tuple[Load, Any]]:
        """Yield the loads of steps with what multiplies each over the time, or None at rest."""
        ends = np.cumsum([step.period for step in steps]).tolist()
        for kind, maker in kinds.items():
            each = [step.acting[kind] for step in steps]
            given, numbers, rows = courses(each)
            for number in np.unique(numbers[given]).tolist():
                over = [None] if at_rest else self._courses(steps, rows[number])
                for one, course, end in zip(each, over, ends, strict=True):
                    if (of := one.given & (numbers == number)).any():
                        values = np.where(of, one.values, 0.0)
                        for load in getattr(self, maker)(model, values, of, end):
                            yield load, course

    def _courses(self, steps: Sequence[Step], numbers: Ints) -> list[Any]:
        """Return what multiplies the values of each step over the time, by the amplitudes in turn."""
        series = [step.amplitudes[n - 1] if n > 0 else None for step, n in zip(steps, numbers, strict=True)]
        return [_course(steps, np.where(numbers < 0, np.nan, size), series) for size in np.eye(len(steps))]

    def _forces(self, model: Model, values: Array, of: Mask, time: float) -> Iterator[Load]:
        """Yield forces; those on reference nodes go to what follows these with the supports of a time."""
        axes = self.deck.axes
        turned = np.flatnonzero(values.any(axis=1) & (axes.of_node >= 0))
        values[turned] = np.einsum("ni,nij->nj", values[turned], axes.directions(model.mesh, turned))
        yield NodalForces(carried(model.supports.acting(time), values))

    def _pressures(self, model: Model, values: Array, of: Mask, time: float) -> Iterator[Load]:
        n, some = model.mesh.n_nodes, values[tuple(self.faces.T)]
        none = {cell: np.zeros((n, 3)) for cell in ("point", "line", "triangle", "quadrilateral")}
        yield ConditionLoads(np.zeros((len(some), 3)), none, some, np.zeros(n), model.is_nonlinear)

    def _temperatures(self, model: Model, values: Array, of: Mask, time: float) -> Iterator[Load]:
        initial = self.deck.initial
        same = float(initial[0]) if (initial == initial[0]).all() else 0.0
        difference = np.where(of, values - initial[:, None], 0.0)[:, 0][self.deck.geometry.twin]
        yield Temperature(difference + same, same)

    def _weights(self, model: Model, values: Array, of: Mask, time: float) -> Iterator[Load]:
        """Yield weights and centrifugal forces."""
        geometry, materials = self.deck.geometry, self.deck.materials
        for _, name, _, _ in self.deck.sections:
            if "DENSITY" not in materials[name].cards:
                materials[name].card.wrong("GRAV and CENTRIF need its *DENSITY")
        for i in np.flatnonzero(of):
            (kind, at, places), size = geometry.bodies[i], float(values[i, 0])
            ids = distinct(geometry.elements_of(at))
            where, masses = rows_of_ids(model.mesh.element_ids, ids), geometry.masses_of(ids)
            where = where[where >= 0]
            if kind == "GRAV":
                force = size * np.array(places)
                if masses.any():
                    yield NodalForces(carried(model.supports.acting(time), masses[:, None] * force))
                yield Gravity(force, where)
            elif masses.any():
                raise ModelError("*DLOAD: CENTRIF on masses is not supported; give their force by *CLOAD")
            else:
                yield _Centrifugal(model, size, places, where)

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


def _motion(values: Array, factors: Sequence[Callable[[float], float | None]]) -> Callable[[float], Any]:
    """Return displacements (n,) by the time, of values (n, steps) with the factors of each."""

    def motion(time: float) -> Array | None:
        now = [factor(time) for factor in factors]
        return None if None in now else values @ np.array(now)

    return motion


def _course(steps: Sequence[Step], sizes: Array, amplitudes: Sequence[TimeSeries | None]) -> Any:
    """Return, by the time, what has a size in each of some steps, with an amplitude or without.

    Without, it keeps it.  A size nan is None up to the end of its step; what follows it acts at once.
    """
    first = amplitudes[0](0.0) if amplitudes[0] else 0.0 if steps[0].ramps else 1.0
    times, values, start, known = [0.0], [first * np.nan_to_num(sizes[0])], 0.0, np.isfinite(sizes)
    for step, size, amplitude, grows in zip(steps, sizes, amplitudes, [True, *known], strict=False):
        whole = step.period * (1.0 if step.ramps and grows else AT_ONCE)
        inner, factors = np.zeros(0), [1.0, 1.0]
        if amplitude is not None:
            some = (amplitude.times > 0) & (amplitude.times < step.period)
            whole, inner = AT_ONCE * step.period, amplitude.times[some]
            factors = [amplitude(0.0), *amplitude.values[some], amplitude(step.period)]
        times += [start + whole, *(start + inner), start + step.period]
        values += [np.nan_to_num(size) * factor for factor in factors]
        start += step.period
    knots, at = np.unique(times, return_index=True)
    course, ends = TimeSeries(knots, np.array(values)[at]), np.cumsum([step.period for step in steps])

    def while_known(time: float) -> float | None:
        k = min(int(np.searchsorted(ends, time * (1 - 1e-9))), len(steps) - 1)
        return course(time) if known[k] or time <= 0 else None

    return course if known.all() else while_known
