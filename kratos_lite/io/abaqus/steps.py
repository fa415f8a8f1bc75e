"""The cases that the steps of a deck are: at rest, their modes, in time and in frequency."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy, deepcopy
from dataclasses import replace
from itertools import takewhile
from math import ceil, pi
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.analysis.integrators import HHT
from kratos_lite.analysis.model import Model
from kratos_lite.errors import naming
from kratos_lite.io.abaqus.building import MOVING, Building
from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.io.abaqus.deck import Deck, Step
from kratos_lite.io.case import Case, TimeIntegration
from kratos_lite.typing import Array

GROWTH = 1.5
"""Of automatic increments, from one to the next, as in CalculiX."""
FINER = 20
"""Our steps in an increment of *MODAL DYNAMIC, which answers exactly to loads that are linear in it."""


def read_deck(path: Path) -> Case:
    """Return the case of the first step of a deck, which names those that follow."""
    cases = [case for case, _ in cases_of(Deck(path))]
    cases[0].then = cases[1:]
    return cases[0]


def cases_of(deck: Deck) -> list[tuple[Case, list[Step]]]:
    """Return the cases of a deck, each with its steps; those in time that follow each other are one."""
    with naming(str(deck.path)):
        return _Cases(deck).cases()


class _Cases(Building):
    """Makes the cases of a deck."""

    def cases(self) -> list[tuple[Case, list[Step]]]:
        """Return the cases, each with its steps."""
        self.made = cases = list[tuple[Case, list[Step]]]()
        steps = self.deck.steps
        if not steps:
            rest = Step(Card("STEP", {}, str(self.deck.path), 1, b""), False, 0.0)
            rest.acting = self.deck.acting
            cases.append((Case(self._loaded(rest)), []))
        while steps:
            kind, many = steps[0].kind, self._takes_time(steps[0])
            alike = list(takewhile(lambda step: step.kind == kind, steps)) if many else steps[:1]  # noqa: B023
            with naming(f"{steps[0].card.place}: *STEP"):  # what is known of no other line
                cases.append((getattr(self, f"_{kind.lower()}")(*alike), alike))
            steps = steps[len(alike) :]
        for case, _ in cases:
            case.files = [self.deck.path]
        return cases

    def _loaded(self, step: Step) -> Model:
        """Return the model with the supports and loads at the end of a linear step."""
        end, start = replace(step), self.deck.initial
        end.acting = deepcopy(step.acting)
        end.acting.settle(step.ends)
        T = end.acting["TEMPERATURE"]
        model = self.model(now=np.where(T.given[:, 0], T.values[:, 0], start) if T.given.any() else None)
        self.act(model, [end], at_rest=True)
        return model

    def _static(self, *steps: Step) -> Case:
        """Return the case of a step, or of nonlinear ones in turn."""
        return self._nonlinear(steps) if self.is_nonlinear(steps[0]) else Case(self._loaded(steps[0]))

    def _frequency(self, step: Step) -> Case:
        before = self.last("STATIC", step) if step.perturbs else None
        held = [one.acting["BOUNDARY"].given for one in (before or step, step)]
        if (held[0] != held[1]).any():
            step.card.wrong("frequencies with other supports than their preload are not supported")
        after = self._case_of(before) if before is not None and self.is_nonlinear(before) else None
        if after is None:
            model = self._loaded(before or step)
        else:
            assert after.time is not None
            model = copy(after.model)
            model.supports = model.supports.acting(after.time.end)
        if any(step.numbers()[1:]):
            model.notes.append("bounds of frequencies are ignored: the lowest ones are found")
        preload = before is not None and after is None and _is_stressed(model)
        return Case(model, modes=self.count(step), preload=preload, after=after)

    def _case_of(self, step: Step) -> Case:
        """Return the case that is made of a step already."""
        return next(case for case, steps in self.made if step in steps)

    def _buckle(self, step: Step) -> Case:
        return Case(self._loaded(step), modes=self.count(step), buckling=True)

    def _takes_time(self, step: Step) -> bool:
        """Whether steps of its kind go on from each other."""
        return step.kind in MOVING or (step.kind == "STATIC" and self.is_nonlinear(step))

    # ---- in time and in frequency ---------------------------------------------------------------------

    def _nonlinear(self, steps: Sequence[Step]) -> Case:
        """Return the case of steps at rest in turn, whose loads grow from those of the step before."""
        sizes = [size for step in steps for size in self._increments(step)]
        time = TimeIntegration(sizes[0], len(sizes), quasi_static={}, sizes=tuple(sizes))
        return Case(self._in_turn(steps, any(step.large for step in steps)), time)

    def _dynamic(self, *steps: Step) -> Case:
        model = self._in_turn(steps, any(step.large for step in steps))
        card = steps[0].procedure
        assert card is not None
        alpha = Row(card.place, (card.option("ALPHA", "-0.05"),)).number(0)
        time = self._time(model, steps, 1, HHT(alpha), self._damping_of_materials())
        before = self.last("STATIC", steps[0])
        if before and steps[0].ramps:
            steps[0].card.wrong("AMPLITUDE=RAMP after a static step is not supported")
        if before and any("PLASTIC" in material.cards for material in self.deck.materials.values()):
            steps[0].card.wrong("to go on from the state of a law with history is not supported")
        return Case(model, time, after=self._case_of(before) if before else None)

    def _modaldynamic(self, *steps: Step) -> Case:
        model = self._in_turn(steps, False)
        rayleigh = {self._rayleigh(step) for step in steps}
        if len(rayleigh) > 1:
            steps[1].card.wrong("another damping than that of the step before is not supported")
        self._modes(steps[0])
        if any(damping := rayleigh.pop()) and steps[0].acting["BOUNDARY"].values.any():
            steps[0].card.wrong("supports that move with *MODAL DAMPING are not supported")
        model.notes.append("*MODAL DYNAMIC: all modes answer, not those of *FREQUENCY alone")
        return Case(model, self._time(model, steps, FINER if steps[0].is_direct else 1, None, damping))

    def _steadystatedynamics(self, step: Step) -> Case:
        """Return the case of a harmonic response."""
        assert step.procedure is not None
        if step.procedure.option("HARMONIC", "YES").upper() != "YES":
            step.procedure.wrong("HARMONIC=NO is not supported; loads are harmonic")
        if any(one.amplitudes.any() for one in step.acting.values()) or step.acting["BOUNDARY"].values.any():
            step.card.wrong("amplitudes over the frequency and supports that move are not supported")
        modes, model = self._modes(step), self.model()
        self.act(model, [step], at_rest=True)
        loads: list[Any] = [*model.loads]
        loads += [(load, 1j) for load, _ in self.loads(model, [step], True, {"IMAGINARY": "_forces"})]
        options: dict[str, Any] = {"loads": loads, "modes": modes}
        if step.damping is not None and "RAYLEIGH" not in step.damping.options:
            options["damping"] = damping = np.zeros(modes)
            for row in step.damping.rows():
                damping[row.integer(0) - 1 : row.integer(1)] = row.number(2)
        else:
            options["rayleigh"] = self._rayleigh(step)
        low, high, count, bias = [*step.numbers(), *[20.0, 3.0][max(len(step.numbers()) - 2, 0) :]][:4]
        return Case(model, harmonic=options | {"frequencies": _sweep(low, high, int(count), bias, modes)})

    def _modes(self, step: Step) -> int:
        """Return how many modes the *FREQUENCY before a step finds."""
        before = self.last("FREQUENCY", step)
        if before is None:
            step.card.wrong(f"*{step.kind} needs a step with *FREQUENCY before it")
        if before.perturbs:
            step.card.wrong("the response about a stressed state is not supported")
        return self.count(before)

    def _rayleigh(self, step: Step) -> tuple[float, float]:
        """Return α and β of *MODAL DAMPING."""
        if step.damping is None:
            return 0.0, 0.0
        row = next(step.damping.rows(), None)
        if "RAYLEIGH" not in step.damping.options or row is None:
            step.damping.wrong("in time RAYLEIGH with α and β on its data line is supported alone")
        return row.number(2, 0.0), row.number(3, 0.0)

    def _damping_of_materials(self) -> tuple[float, float]:
        """Return α and β that all materials share."""
        cards = [self.deck.materials[name].cards.get("DAMPING") for _, name, _, _ in self.deck.sections]
        every = [(c.option("ALPHA", "0"), c.option("BETA", "0")) if c else ("0", "0") for c in cards]
        if len(set(every)) > 1:
            self.deck.steps[0].card.wrong("materials with different *DAMPING are not supported")
        alpha, beta = Row(cards[0].place if cards[0] else "", every[0]).numbers(2)
        return alpha, beta

    def _increment(self, step: Step) -> float:
        """Return the first increment of a step."""
        return min((step.numbers() or [step.period])[0] or step.period, step.period)

    def _increments(self, step: Step) -> list[float]:
        """Return the increments of a step at rest, which grow unless they are DIRECT."""
        h, rest, sizes = self._increment(step), step.period, list[float]()
        largest = [*step.numbers(), 0.0, 0.0, 0.0, 0.0][3] or step.period
        while rest > 1e-6 * h:
            sizes.append(min(h, rest))
            rest -= sizes[-1]
            if len(sizes) > 1 and not step.is_direct:
                h = min(GROWTH * h, largest)
        return sizes

    def _time(
        self, model: Model, steps: Sequence[Step], finer: int, integrator: HHT | None, rayleigh: Any
    ) -> TimeIntegration:
        """Return equal steps in time over some steps, whose increments are divided."""
        sizes = [step.period / ceil(step.period / self._increment(step) - 1e-6) for step in steps]
        if np.ptp(sizes) > 1e-6 * sizes[0]:
            steps[1].card.wrong("increments that differ between dynamic steps are not supported")
        h, count = sizes[0] / finer, round(sum(step.period for step in steps) / sizes[0])
        model.notes.append(f"steps of {h:g}, without automatic increments")
        if len(steps) > 1:
            model.notes.append("loads that change at once between steps are integrated with order 1")
        more: dict[str, Any] = {name.lower(): values for name, values in self.deck.start.items()}
        more |= {"integrator": integrator, "rayleigh": rayleigh}
        return TimeIntegration(h, finer * count, finer, **more)

    def _in_turn(self, steps: Sequence[Step], large: bool) -> Model:
        """Return the model whose loads and supports are those of steps in turn."""
        goes_on = {"STATIC": not any(map(self.is_nonlinear, self.earlier(steps[0]))), "DYNAMIC": True}
        for before in self.earlier(steps[0]):
            if before.period and (before.kind in MOVING or not goes_on.get(steps[0].kind)):
                steps[0].card.wrong("to go on from the state of another kind of step is not supported")
        T = [step.acting["TEMPERATURE"] for step in steps]
        if self.deck.initial.any() and any(one.amplitudes.any() for one in T):
            steps[0].card.wrong("amplitudes of temperatures need initial temperatures of 0 in this step")
        given = np.any([one.given[:, 0] for one in T], axis=0)
        now = np.where(given, np.nan, self.deck.initial) if given.any() else None  # those of each are several
        model = self.model(large, now)
        self.act(model, steps)
        return model


def _is_stressed(model: Model) -> bool:
    """Return whether stress, loads, temperatures or displacements are given to a linear model."""
    loads, groups = model.loads, model.element_groups()
    acts = model.supports.values.any() or any(load.forces(model.mesh, groups).any() for load in loads)
    return bool(acts or model.prestress is not None)


def _sweep(low: float, high: float, count: int, bias: float, modes: int) -> Callable[[Model], Array]:
    """Return what gives the frequencies between bounds in Hz, which gather at the natural ones of a model."""
    x = np.linspace(-1.0, 1.0, max(count, 2))
    x = np.sign(x) * np.abs(x) ** (1 / bias)

    def frequencies(model: Model) -> Array:
        natural = model.modes(modes)[0] / (2 * pi)
        natural = natural[np.diff(natural, prepend=-1.0) > 1e-8 * natural]  # of several modes one
        ends = np.array([low, *natural[(natural > low) & (natural < high)], high])
        middle, half = (ends[1:] + ends[:-1]) / 2, np.diff(ends) / 2
        between = middle[:, None] + half[:, None] * x[1:-1]
        return np.asarray(2 * pi * np.unique(np.append(ends, between)))

    return frequencies
