"""A deck run in place of ccx: `.frd`, `.dat` and `.sta` are written as CalculiX does."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.analysis.element_fields import ElementFields
from kratos_lite.atomic import all_or_none, write_whole
from kratos_lite.errors import InputError, naming
from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.io.abaqus.deck import FILES, Deck, Step
from kratos_lite.io.abaqus.steps import cases_of
from kratos_lite.io.case import Case
from kratos_lite.io.run import prepare, run
from kratos_lite.io.writers import dat
from kratos_lite.io.writers.calculix import at_nodes, displacements, forces
from kratos_lite.io.writers.frd import FIELDS, FrdStep, steps_of_modes, write_frd
from kratos_lite.io.writers.recorded import recorded
from kratos_lite.materials.anisotropic3d import Anisotropic3D
from kratos_lite.mesh import rows_of_ids
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.typing import Array, Ints

if TYPE_CHECKING:
    from kratos_lite.analysis.harmonic import HarmonicResponse
    from kratos_lite.analysis.model import Model

FILED = {
    "U": "DISP", "V": "VELO", "NT": "NDTEMP", "S": "STRESS", "E": "TOSTRAIN", "ME": "MESTRAIN", "RF": "FORC",
    "PEEQ": "PE", "ENER": "ENER", "ERR": "ERROR",
}  # fmt: skip
"""Fields of `.frd` files by the words of *NODE FILE and *EL FILE, in order."""
OF_SET = {"NODEPRINT": "NSET", "ELPRINT": "ELSET"}
OF_FACES = ("SECTIONPRINT", "FACEPRINT")
"""Cards that ask for tables of sets and of surfaces."""
PRINTED = {
    card: [word for word, (field, *_) in dat.VARIABLES.items() if (field in FIELDS) == (card == "NODEPRINT")]
    for card in OF_SET
}
"""Words of *NODE PRINT and *EL PRINT."""
STATUS = (
    "SUMMARY OF JOB INFORMATION\n  STEP      INC     ATT  ITRS     TOT TIME     STEP TIME      INC TIME\n"
)


class Job:
    """The steps of a deck, and what they write."""

    def __init__(self, path: Path, tell: Callable[[str], None]) -> None:
        self.deck, self.tell = Deck(path), tell
        self.frd, self.dat, self.sta = list[FrdStep](), list[str](), [STATUS]
        self.asked = list[Card]()  # cards of output; each kind holds until it is given anew
        self.every = 1  # after how many increments there is output
        self.filed: dict[str, Ints | None] = {}  # fields of the `.frd` file, and their nodes if not all
        self.names = set[str]()  # fields of files and tables

    def run(self) -> None:
        """Run all steps, and write the files, or none of them."""
        if not self.deck.steps:
            raise InputError(f"{self.deck.path}: there is no *STEP, which says what is solved")
        for card in (card for step in self.deck.steps for card in step.outputs):
            self._rows(card)  # what is not there is told before anything is solved
        for case, steps in cases_of(self.deck):
            self._ask(steps[0])
            with naming(f"{steps[0].card.place}: *STEP"):  # what is known of no other line
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
            self.every = _every(card) or self.every  # the last one counts for all
            known = FILED if card.keyword in FILES else PRINTED.get(card.keyword, ())
            if other := [w for w in _words(card) if w not in known and card.keyword not in OF_FACES]:
                self.tell(f"{card.place}: *{card.keyword}: not written: {', '.join(other)}")
        if np.ptp(self.deck.initial) and any("NT" in _words(card) for card in step.outputs):
            self.tell(f"{step.card.place}: *STEP: NT is the difference to the initial temperatures")
        rows = {w: self._rows(card) for card in self.asked if card.keyword in FILES for w in _words(card)}
        if "S" in rows:  # as CalculiX does
            rows.setdefault("ERR", rows["S"])
        self.filed = {name: rows[word] for word, name in FILED.items() if word in rows}
        printed = [w for card in self.asked if card.keyword in OF_SET for w in _words(card)]
        self.names = {*self.filed, *(dat.VARIABLES[w][0] for w in printed if w in dat.VARIABLES)}

    def _run(self, case: Case, steps: list[Step]) -> Iterable[str]:
        """Run the case of some steps, keep what the files get, and return the lines of its summary."""
        if case.time is not None:
            return self._in_time(case, steps)
        outcome, step = run(case), steps[0]
        if outcome.result is not None:
            at = FrdStep({}, step.start + step.period, step=self._number(step))
            self._keep(at, at.value, (outcome.result, at_nodes(outcome.result, self.names)))
            self._tell_status(step, 1, step.period, step.period)
        elif outcome.modes is not None:
            self._modes(case, step, *outcome.modes)
        elif outcome.response is not None:
            self._swing(case.model, step, outcome.response)
        return outcome.summary()

    def _keep(self, at: FrdStep, time: float, *parts: tuple[ElementFields, dict[str, Array]]) -> None:
        """Keep a result with fields of its nodes, and tables at a time; of a complex one both parts."""
        fields = dict[str, Any](parts[0][1])
        for _, imaginary in parts[1:]:
            fields |= {name: fields[name] + 1j * imaginary[name] for name in imaginary if name != "ENER"}
        rows = {name: some for name, some in self.filed.items() if some is not None}
        fields = {name: fields[name] for name in self.filed if name in fields}
        self.frd.append(replace(at, fields=fields, rows=rows))
        for result, known in parts:
            if "FORC" in known:
                known["FORC"] = self.deck.connections.at_references(known["FORC"])
            self._print(result, known, time)

    def _modes(self, case: Case, step: Step, values: Any, shapes: Any) -> None:
        """Keep modes, and before those of buckling the state at rest."""
        model, buckles, number = case.model, case.buckling, self._number(step)
        time, part = step.start if buckles else step.start + 1.0, self._parts(model)
        if buckles:
            result = model.solve()
            self._keep(FrdStep({}, 0.0, "buckling", number), time, (result, at_nodes(result, self.names)))
            sizes = [(forces(part(u)[0]) * u).sum() ** -0.5 for u in shapes]
            shapes = np.array(sizes)[:, None, None] * shapes  # φ K φ = 1
        self.dat += dat.buckling(values) if buckles else self._frequencies(case, values, shapes)
        for i, at in enumerate(steps_of_modes(values, shapes, buckles)):
            if any(card.keyword in OF_SET for card in self.asked):
                self.dat += dat.mode(i + 1)
            self._keep(replace(at, step=number), time, part(shapes[i]))

    def _swing(self, model: Model, step: Step, response: HarmonicResponse) -> None:
        """Keep the response at each frequency, complex."""
        part = self._parts(model)
        for i, hertz in enumerate((response.frequencies / (2 * pi)).tolist()):
            u, at = response.displacement(i), FrdStep({}, hertz, "time", self._number(step), 0)
            self._keep(at, hertz, part(u.real), part(u.imag))

    def _parts(self, model: Model) -> Callable[[Array], tuple[ElementFields, dict[str, Array]]]:
        """Return what makes fields of displacements (n, 3) of a mode or a vibration, also those of nodes."""
        groups = model.element_groups()
        for i, group in enumerate(groups):
            if not group.is_linear:  # of small strains by the elasticity at rest
                element: Any = group.element.__base__ if group.element.finite else group.element
                groups[i] = replace(group, element=element, material=Anisotropic3D(group.material.C))

        def part(u: Array) -> tuple[ElementFields, dict[str, Array]]:
            fields = ElementFields(model.mesh, groups, np.ascontiguousarray(u))
            fields._springs = model.supports.springs
            moved = displacements(model, u) - displacements(model, 0 * u)  # what is prescribed rests
            return fields, {"DISP": moved, **at_nodes(fields, self.names - {"DISP", "NDTEMP"})}

        return part

    def _in_time(self, case: Case, steps: list[Step]) -> Iterable[str]:
        """Take the increments of steps in time, which count anew in each."""
        subject, states = prepare(case)
        record, ends = recorded(subject, self.deck.path), np.cumsum([step.period for step in steps])
        before, number, last = 0, 0, 0.0
        for state in states:
            k = min(int(np.searchsorted(ends, state.time * (1 - 1e-9))), len(steps) - 1)
            if k > before:
                self._ask(steps[k])
            before, number = k, 1 if k > before else number + 1
            step, total = steps[k], steps[0].start + state.time
            result = subject.result(state)
            if number % self.every == 0 or state.time >= ends[k] * (1 - 1e-9):
                at = FrdStep({}, total, record.kind, self._number(step), number)
                self._keep(at, total, (result, record.at_nodes(state, self.names)))
            count = sum(report.iterations for report in result.report.steps if report.time > last)
            self._tell_status(step, number, total - step.start, state.time - last, count)
            last = state.time
        case.end = result
        return [f"{len(steps)} steps to {last:g} s"]

    def _number(self, step: Step) -> int:
        """Return the number of a step, from 1."""
        return self.deck.steps.index(step) + 1

    def _tell_status(self, step: Step, increment: int, time: float, length: float, count: int = 1) -> None:
        """Note an increment at a time of its step, and the number of its iterations."""
        words = f"{self._number(step):6d}{increment:11d}{1:6d}{max(count, 1):6d}"
        times = (dat.fortran(value, 6) for value in (step.start + time, time, length))
        self.sta.append(words + "".join(f"{number:>14}" for number in times) + "\n")

    def _print(self, result: ElementFields, known: dict[str, Array], time: float) -> None:
        """Print tables of a result and the fields of its nodes."""
        for card in (card for card in self.asked if card.keyword in OF_SET):
            where = card.options.get(OF_SET[card.keyword], "").upper()
            totals, is_local = (card.options.get(word, "NO").upper() for word in ("TOTALS", "GLOBAL"))
            local, rows = self._local(card) if is_local == "NO" else (), self._rows(card)
            for word in _words(card):
                if word in PRINTED[card.keyword] and rows is not None:
                    self.dat += dat.prints(result, rows, word, where, time, totals, local, known)
        for card in (card for card in self.asked if card.keyword in OF_FACES and _every(card) != 0):
            name = card.option("SURFACE")
            blocks = self.deck.geometry.surface_blocks(name, card)
            self.dat += dat.section_print(result, blocks, name.upper(), time)

    def _local(self, card: Card) -> list[tuple[str, LocalAxes, Ints]]:
        """Return the axes of nodes or elements that a card prints, with their marks."""
        deck, parts = self.deck, self.deck.mesh.parts
        if card.keyword == "NODEPRINT":
            return [
                (" L", axes, np.flatnonzero(deck.axes.of_node == i)) for i, axes in enumerate(deck.axes.each)
            ]
        return [(f" {n:20}", deck.orientations[n], parts[e].elements) for e, _, n, _ in deck.sections if n]

    def _rows(self, card: Card) -> Ints | None:
        """Return the nodes or elements of a card, in the order of their set, or None for all of them."""
        mesh, geometry = self.deck.mesh, self.deck.geometry
        if card.keyword in OF_FACES:
            geometry.surface_faces(card.option("SURFACE"), card)
        if not _words(card):
            return None
        if card.keyword == "NODEPRINT" or "NSET" in card.options:
            return geometry.nodes(card.option("NSET"), card)
        if card.keyword != "ELPRINT":
            return None
        rows = rows_of_ids(mesh.element_ids, geometry.elements_of(card.option("ELSET").upper(), card))
        return np.asarray(rows[rows >= 0])

    def _frequencies(self, case: Case, omega: Any, shapes: Any) -> list[str]:
        """Return the tables of frequencies."""
        matrices = case.model.matrices()
        free = np.flatnonzero(~case.model.supports.fixed.ravel())
        return [*dat.frequencies(omega, shapes, matrices.M, case.model.mesh.points, free), ""]


def _every(card: Card) -> int | None:
    """Return after how many increments a card asks for results, if it says so; 0 for never."""
    word = card.options.get("FREQUENCY")
    return None if word is None else Row(card.place, (word,)).integer(0)


def _words(card: Card) -> list[str]:
    """Return the words on the data lines of a card, none if it asks for nothing."""
    return [] if _every(card) == 0 else [word.upper() for row in card.rows() for word in row.fields if word]
