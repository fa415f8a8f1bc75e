"""The cases that the steps of a deck are: models at rest and their modes."""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path

from kratos_lite.analysis.model import Model
from kratos_lite.errors import naming
from kratos_lite.io.abaqus.deck import Deck, Step
from kratos_lite.io.abaqus.dynamics import MOVING, Dynamics
from kratos_lite.io.case import Case


def read_deck(path: Path) -> Case:
    """Return the case of the first step of a deck, which names those that follow."""
    cases = [case for case, _ in cases_of(Deck(path))]
    cases[0].then = cases[1:]
    return cases[0]


def cases_of(deck: Deck) -> list[tuple[Case, list[Step]]]:
    """Return the cases of a deck, each with its steps; those in time that follow each other are one."""
    with naming(str(deck.path)):
        return _Building(deck).cases()


class _Building(Dynamics):
    """Makes the cases of a deck."""

    def cases(self) -> list[tuple[Case, list[Step]]]:
        """Return the cases, each with its steps."""
        cases, steps = list[tuple[Case, list[Step]]](), self.deck.steps
        if not steps:
            model = self.model()
            self.hold(model, self.deck.held)
            cases.append((Case(model), []))
        while steps:
            kind, many = steps[0].kind, self._takes_time(steps[0])
            alike = list(takewhile(lambda step: step.kind == kind, steps)) if many else steps[:1]  # noqa: B023
            cases.append((getattr(self, f"_{kind.lower()}")(*alike), alike))
            steps = steps[len(alike) :]
        for case, _ in cases:
            case.files = [self.deck.path]
        return cases

    def _loaded(self, step: Step) -> Model:
        """Return the model with the supports and loads at the end of a linear step."""
        deck, model, held = self.deck, self.model(), step.held.copy()
        factor = {
            name: series(step.period + (step.start if name in deck.in_total_time else 0.0))
            for name, series in deck.amplitudes.items()
        }
        acting = step.acting.copy()
        held.settle(factor)
        acting.settle(factor)
        self.hold(model, held)
        for load, _ in self.loads(model, acting):
            model.add(load)
        return model

    def _static(self, *steps: Step) -> Case:
        """Return the case of a step, or of nonlinear ones in turn."""
        return self.nonlinear(steps) if self.is_nonlinear(steps[0]) else Case(self._loaded(steps[0]))

    def _frequency(self, step: Step) -> Case:
        before = self.last("STATIC", step) if step.perturbs else None
        if before is not None and self.is_nonlinear(before):
            step.card.wrong("frequencies about the state of a nonlinear step are not supported")
        if before is not None and (before.held.given != step.held.given).any():
            step.card.wrong("frequencies with other supports than their preload are not supported")
        model = self._loaded(before or step)
        if any(step.numbers()[1:]):
            model.notes.append("bounds of frequencies are ignored: the lowest ones are found")
        return Case(model, modes=self.count(step), preload=before is not None)

    def _buckle(self, step: Step) -> Case:
        return Case(self._loaded(step), modes=self.count(step), buckling=True)

    def _takes_time(self, step: Step) -> bool:
        """Whether steps of its kind go on from each other."""
        return step.kind in MOVING or (step.kind == "STATIC" and self.is_nonlinear(step))
