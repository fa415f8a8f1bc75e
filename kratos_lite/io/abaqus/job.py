"""A deck run in place of ccx: `.frd`, `.dat` and `.sta` are written as CalculiX does."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.atomic import all_or_none, write_whole
from kratos_lite.io.abaqus.cards import Card
from kratos_lite.io.abaqus.deck import Deck, Step
from kratos_lite.io.abaqus.steps import cases_of
from kratos_lite.io.case import Case
from kratos_lite.io.run import prepare, run
from kratos_lite.io.writers import dat
from kratos_lite.io.writers.calculix import at_nodes, averaged
from kratos_lite.io.writers.frd import FrdStep, steps_of_modes, write_frd
from kratos_lite.io.writers.recorded import recorded
from kratos_lite.mesh import rows_of_ids
from kratos_lite.typing import Ints

if TYPE_CHECKING:
    from kratos_lite.analysis.harmonic import HarmonicResponse

FILED = {
    "U": "DISP", "V": "VELO", "NT": "NDTEMP", "S": "STRESS", "E": "TOSTRAIN", "ME": "MESTRAIN", "RF": "FORC",
    "PEEQ": "PE", "ENER": "ENER", "ERR": "ERROR",
}  # fmt: skip
"""Fields of `.frd` files by the words of *NODE FILE and *EL FILE, in order."""
OF_SET = {"NODEPRINT": "NSET", "ELPRINT": "ELSET"}
OF_FACES = ("SECTIONPRINT", "FACEPRINT")
"""Cards that print tables, of sets and of surfaces."""
STATUS = (
    "SUMMARY OF JOB INFORMATION\n  STEP      INC     ATT  ITRS     TOT TIME     STEP TIME      INC TIME\n"
)


class Job:
    """The steps of a deck, and what they write."""

    def __init__(self, path: Path, tell: Callable[[str], None]) -> None:
        self.deck, self.tell = Deck(path), tell
        self.frd, self.dat, self.sta = list[FrdStep](), list[str](), [STATUS]
        self.asked = list[Card]()  # cards of output; each kind holds until it is given anew
        self.fields = list[str]()

    def run(self) -> None:
        """Run all steps, and write the files, or none of them."""
        for case, steps in cases_of(self.deck):
            self._ask(steps[-1])
            for line in self._run(case, steps):
                self.tell(line)
        path = self.deck.path
        with all_or_none():
            write_frd(path.with_suffix(".frd"), case.model.mesh, self.frd)
            write_whole(path.with_suffix(".dat"), "\n".join([*self.dat, ""]).encode())
            write_whole(path.with_suffix(".sta"), "".join(self.sta).encode())

    def _ask(self, step: Step) -> None:
        """Take the cards of output of a step."""
        new = {card.keyword for card in step.outputs}
        self.asked = [card for card in self.asked if card.keyword not in new] + step.outputs
        for card in step.outputs:
            self._rows(card)
            known = {*FILED, *dat.VARIABLES} if card.keyword.endswith("PRINT") else FILED
            if other := [w for w in _words(card) if w not in known and card.keyword not in OF_FACES]:
                self.tell(f"{card.place}: *{card.keyword}: not written: {', '.join(other)}")
            if card.keyword.endswith("FILE") and card.options.get("GLOBAL", "YES").upper() == "NO":
                self.tell(f"{card.place}: *{card.keyword}: GLOBAL=NO is ignored, all axes are global")
            local = card.keyword == "ELPRINT" and card.options.get("GLOBAL", "NO").upper() == "NO"
            if local and any(axes for _, _, axes, _ in self.deck.sections):
                self.tell(f"{card.place}: *ELPRINT: tables have global axes, not those of *ORIENTATION")
        if np.ptp(self.deck.initial) and any("NT" in _words(card) for card in step.outputs):
            self.tell(f"{step.card.place}: *STEP: NT is the difference to the initial temperatures")
        words = [word for card in self.asked if card.keyword.endswith("FILE") for word in _words(card)]
        words += ["ERR"] if "S" in words else []  # as CalculiX does
        self.fields = [name for word, name in FILED.items() if word in ("U", *words)]

    def _run(self, case: Case, steps: list[Step]) -> Iterable[str]:
        """Run the case of some steps, keep what the files get, and return the lines of its summary."""
        if case.time is not None:
            return self._in_time(case, steps)
        outcome, step = run(case), self.deck.steps.index(steps[0]) + 1
        if outcome.result is not None:
            period = steps[0].period
            self.frd.append(
                FrdStep(at_nodes(outcome.result, self.fields), steps[0].start + period, step=step)
            )
            self._print(outcome.result, steps[0].start + period)
            self._tell_status(steps[0], 1, period, period)
        if outcome.modes is not None:
            values, shapes = outcome.modes
            if other := [name for name in self.fields if name not in ("DISP", "ERROR")]:
                self.tell(f"step {step}: not written of modes: {', '.join(other)}")
            self.frd += [replace(one, step=step) for one in steps_of_modes(values, shapes, case.buckling)]
            self.dat += dat.buckling(values) if case.buckling else self._frequencies(case, values, shapes)
        elif outcome.response is not None:
            self._swing(outcome.response, step)
        return outcome.summary()

    def _swing(self, response: HarmonicResponse, step: int) -> None:
        """Keep displacements and stresses at each frequency, complex."""
        for i, omega in enumerate(response.frequencies.tolist()):
            fields: dict[str, Any] = {"DISP": response.displacement(i)}
            if "STRESS" in self.fields:
                parts: Any = [averaged(response.fields(i, phase), "stress") for phase in (0.0, -pi / 2)]
                fields["STRESS"] = parts[0] + 1j * parts[1]
            self.frd.append(FrdStep(fields, omega / (2 * pi), "time", step, 0))

    def _in_time(self, case: Case, steps: list[Step]) -> Iterable[str]:
        """Take the increments of steps in time, which count anew in each."""
        subject, states = prepare(case)
        record, ends = recorded(subject, self.deck.path), np.cumsum([step.period for step in steps])
        before, number, last = 0, 0, 0.0
        for state in states:
            k = min(int(np.searchsorted(ends, state.time * (1 - 1e-9))), len(steps) - 1)
            before, number = k, 1 if k > before else number + 1
            step, total = steps[k], steps[0].start + state.time
            fields = {name: v for name, v in record.at_nodes(state).items() if name in self.fields}
            at = self.deck.steps.index(step) + 1, number
            self.frd.append(FrdStep(fields, total, record.kind, *at))
            self._print(subject.result(state), total)
            self._tell_status(step, number, total - step.start, state.time - last)
            last = state.time
        return [f"{len(steps)} steps to {last:g} s"]

    def _tell_status(self, step: Step, increment: int, time: float, length: float) -> None:
        """Note an increment at a time of its step."""
        words = f"{self.deck.steps.index(step) + 1:6d}{increment:11d}{1:7d}{1:6d}"
        self.sta.append(f"{words}{step.start + time:14.6E}{time:14.6E}{length:14.6E}\n")

    def _print(self, result: Any, time: float) -> None:
        """Print tables of a result."""
        mesh, axes = result.mesh, self.deck.axes
        for card in (card for card in self.asked if card.keyword in OF_SET):
            where, totals = (
                card.option(OF_SET[card.keyword]).upper(),
                card.options.get("TOTALS", "NO").upper(),
            )
            rows, frames = self._rows(card), None
            if card.keyword == "NODEPRINT" and card.options.get("GLOBAL", "NO").upper() == "NO":
                frames = axes.of_node[rows] >= 0, axes.directions(mesh, rows)
            for word in _words(card):
                if word in dat.VARIABLES:
                    self.dat += dat.prints(result, rows, word, where, time, totals, frames)
        for card in (card for card in self.asked if card.keyword in OF_FACES):
            name = card.option("SURFACE")
            blocks = self.deck.geometry.surface_blocks(name, card)
            self.dat += dat.section_print(result, blocks, name.upper(), time)

    def _rows(self, card: Card) -> Ints:
        """Return the nodes or elements that a card prints, in the order of their set."""
        mesh, geometry = self.deck.mesh, self.deck.geometry
        if card.keyword in OF_FACES:
            self.deck.geometry.surface_faces(card.option("SURFACE"), card)
        if card.keyword == "NODEPRINT":
            return geometry.nodes(card.option("NSET"), card)
        if card.keyword != "ELPRINT":
            return np.zeros(0, dtype=np.int64)
        rows = rows_of_ids(mesh.element_ids, geometry.elements_of(card.option("ELSET").upper(), card))
        return np.asarray(rows[rows >= 0])

    def _frequencies(self, case: Case, omega: Any, shapes: Any) -> list[str]:
        """Return the tables of frequencies."""
        matrices = case.model.matrices()
        free = np.flatnonzero(~case.model.supports.fixed.ravel())
        return dat.frequencies(omega, shapes, matrices.M, case.model.mesh.points, free)


def _words(card: Card) -> list[str]:
    """Return the words on the data lines of a card."""
    return [word.upper() for row in card.rows() for word in row.fields if word]
