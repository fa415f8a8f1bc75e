"""The cases that the steps of a deck are."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.errors import InputError, naming
from kratos_lite.io.abaqus.deck import Deck, Step
from kratos_lite.io.abaqus.loads import loads_of, with_faces
from kratos_lite.io.abaqus.materials import material_of
from kratos_lite.io.abaqus.mesh import ELEMENT_TYPES, FINITE
from kratos_lite.io.abaqus.supports import apply, constrain
from kratos_lite.io.case import Case, TimeIntegration
from kratos_lite.mesh import Mesh
from kratos_lite.model.loads.base import Load
from kratos_lite.time_series import Factor, TimeSeries


def read_deck(path: Path) -> Case:
    """Return the case of the first step of a deck, which names those that follow."""
    cases = [case for case, _ in cases_of(Deck(path))]
    cases[0].then = cases[1:]
    return cases[0]


def cases_of(deck: Deck) -> list[tuple[Case, list[Step]]]:
    """Return the cases of a deck, each with its steps; nonlinear ones at rest in turn are one case."""
    with naming(str(deck.path)):
        return _Building(deck).cases()


class _Building:
    """Makes the cases of a deck."""

    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        faces = [face for step in deck.steps for _, face in step.acting.faces]
        large = any(step.large for step in deck.steps)
        name = "SurfaceLoadCondition" if large else "SmallDisplacementSurfaceLoadCondition"
        self.mesh, self.number = with_faces(deck.mesh, faces, name)

    def cases(self) -> list[tuple[Case, list[Step]]]:
        """Return the cases with their steps; nonlinear ones at rest that follow each other are one."""
        cases, steps = list[tuple[Case, list[Step]]](), self.deck.steps
        while steps:
            count, case = 1, None
            if steps[0].kind == "STATIC" and self._is_nonlinear(steps[0]):
                while count < len(steps) and steps[count].kind == "STATIC" and not steps[count].perturbs:
                    count += 1
                case = self._nonlinear(steps[:count])
            case = case or getattr(self, f"_{steps[0].kind.lower()}")(steps[0])
            case.files = [self.deck.path]
            cases.append((case, steps[:count]))
            steps = steps[count:]
        return cases

    def _model(self, large: bool = False) -> Model:
        """Return the model without its loads and supports."""
        deck, mesh = self.deck, self.mesh
        if large:
            mesh = self._finite(mesh)
        model = Model(mesh)
        assigned = np.zeros(mesh.n_elements, dtype=bool)
        for elset, name, axes, card in deck.sections:
            if name not in deck.materials:
                card.wrong(f"there is no *MATERIAL {name}")
            if axes and axes not in deck.orientations:
                card.wrong(f"there is no *ORIENTATION {axes}")
            deck.cards.elements_of(elset, card)
            rows = mesh.parts[elset].elements if elset in mesh.parts else np.zeros(0, dtype=np.int64)
            material = material_of(deck.materials[name], deck.orientations.get(axes), finite=large)
            model.assign(material, rows)
            assigned[rows] = True
        if not assigned.all():
            missing = mesh.element_ids[~assigned][0]
            raise InputError(f"{deck.path}: element {missing} is in no *SOLID SECTION")
        model.notes += deck.notes
        return model

    def _finite(self, mesh: Mesh) -> Mesh:
        """Return the mesh with elements of large displacements."""
        names = {ELEMENT_TYPES[kind]: name for kind, name in FINITE.items()}
        for block in mesh.blocks:
            if block.name not in names:
                raise InputError(f"{self.deck.path}: NLGEOM with {block.name} is not supported")
        return mesh.replace(blocks=[replace(b, name=names[b.name]) for b in mesh.blocks])

    def _loads(self, model: Model, step: Step) -> Iterable[tuple[Load, str]]:
        deck = self.deck
        return loads_of(model, step.acting, self.number, deck.axes, deck.initial)

    def _loaded(self, step: Step) -> Model:
        """Return the model with the supports and loads at the end of a linear step."""
        deck, model, held = self.deck, self._model(), step.held.copy()
        numbers = step.numbers()
        end = numbers[1] if step.kind == "STATIC" and len(numbers) > 1 else 1.0
        factor = {name: series(end) for name, series in deck.amplitudes.items()}
        for name, value in factor.items():
            held.values[held.amplitudes == name] *= value
        held.amplitudes[:] = ""
        apply(model, held, deck.axes, {})
        constrain(model, deck.equations, deck.axes)
        for load, name in self._loads(model, step):
            model.add(load, amplitude=factor.get(name))
        return model

    def _static(self, step: Step) -> Case:
        return Case(self._loaded(step))

    def _frequency(self, step: Step) -> Case:
        if step.perturbs:
            step.card.wrong("natural frequencies of a stressed body are not read from decks")
        return Case(self._loaded(step), modes=self._count(step))

    def _buckle(self, step: Step) -> Case:
        return Case(self._loaded(step), modes=self._count(step), buckling=True)

    def _count(self, step: Step) -> int:
        """Return the number of modes of a step."""
        numbers = step.numbers()
        if not numbers or numbers[0] != int(numbers[0]) or numbers[0] < 1:
            step.card.wrong(f"*{step.kind} needs the number of modes on its data line")
        return int(numbers[0])

    def _nonlinear(self, steps: list[Step]) -> Case:
        """Return the case of steps at rest in turn, whose loads grow from those of the step before."""
        deck, large = self.deck, any(step.large for step in steps)
        times, sizes = [0.0], list[float]()
        for step in steps:
            first, period, *_ = [*step.numbers(), 1.0, 1.0][:2] if len(step.numbers()) != 1 else (1.0, 1.0)
            count = max(round(period / min(first, period)), 1)
            sizes += [period / count] * count
            times.append(times[-1] + period)
        model = self._model(large)
        for k, step in enumerate(steps):
            ramp = TimeSeries(times[k : k + 3], [0.0, 1.0, 0.0][: len(times[k : k + 3])])
            factor: dict[str, Factor] = {"": ramp}
            for name, series in deck.amplitudes.items():
                factor[name] = TimeSeries(times[k] + series.times, series.values)
            if len(steps) > 1 and step.acting.names():
                step.card.wrong("amplitudes in one of several nonlinear steps are not supported")
            for load, name in self._loads(model, step):
                model.add(load, amplitude=factor[name])
        self._hold(model, steps, times)
        constrain(model, deck.equations, deck.axes)
        time = TimeIntegration(sizes[0], len(sizes), quasi_static={}, sizes=tuple(sizes))
        return Case(model, time)

    def _hold(self, model: Model, steps: list[Step], times: list[float]) -> None:
        """Support a model in steps in turn, in which prescribed displacements grow."""
        given = steps[0].held.given
        for step in steps:
            if (step.held.given != given).any():
                step.card.wrong("supports that change between nonlinear steps are not supported")
        held, series = steps[0].held.copy(), dict[str, TimeSeries]()
        values = np.stack([np.zeros_like(held.values), *(step.held.values for step in steps)], axis=-1)
        moved = given & values.any(axis=-1)
        for key in np.unique(values[moved], axis=0):
            name = f"ramp {len(series)}"
            alike = moved & (values == key).all(axis=-1)
            held.amplitudes[alike & (held.amplitudes == "")] = name
            held.values[alike & (held.amplitudes == name)] = 1.0
            series[name] = TimeSeries(times, key)
        held.amplitudes[~moved] = ""
        apply(model, held, self.deck.axes, {**self.deck.amplitudes, **series})

    def _is_nonlinear(self, step: Step) -> bool:
        names = {name for _, name, _, _ in self.deck.sections}
        laws = {k for n in names if n in self.deck.materials for k in self.deck.materials[n].cards}
        return step.large or bool(laws & {"PLASTIC", "HYPERELASTIC"})
