"""Models in time."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from time import perf_counter
from typing import Any

import numpy as np

from kratos_lite.analysis.report import vector
from kratos_lite.analysis.state import State
from kratos_lite.analysis.stepping import integrate
from kratos_lite.analysis.transient import TransientAnalysis
from kratos_lite.io.case import Case
from kratos_lite.io.outputs import is_film, write_picture
from kratos_lite.io.runners.in_time import Kept, begun, follow
from kratos_lite.io.runners.outcome import Outcome
from kratos_lite.model.loads import TimeDependentLoad
from kratos_lite.model.loads.nodal import NodalForces
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Progress


def prepare(case: Case, progress: Progress | None = None) -> tuple[TransientAnalysis, Iterator[State]]:
    """Return the transient of a case and its states, checked, without a step."""
    time = case.time
    assert time is not None
    names = ("integrator", "rayleigh", "lumped", "displacement", "velocity")
    settings: dict[str, Any] = {name: getattr(time, name) for name in names} | {"progress": progress}
    if case.after is not None and case.after.end is not None:
        settings["displacement"] = case.after.end.u
    transient = case.model.transient(**settings)
    if not time.balanced and not (time.displacement is None and time.velocity is None):
        transient = TransientAnalysis(_held_at_first(transient), **settings)

    def steps() -> Iterator[State]:
        return integrate(transient, time.step, time.steps, every=time.every, progress=progress)

    return transient, begun(time, transient, steps)


def check(case: Case) -> list[str]:
    """Return the warnings of the model and of its start; no step is taken."""
    return prepare(case)[0].equations.warnings


def _held_at_first(transient: TransientAnalysis) -> Structure:
    """Return the model of a transient with a load at its start that balances stiffness and damping there."""
    e = transient.equations
    inner = e.times_stiffness(transient.u, 0.0) + e.times_damping(transient.v, 0.0) - e.load(0.0)
    balance = NodalForces(e.system.scatter(inner))
    model = copy(e.model)
    model.loads = [*model.loads, TimeDependentLoad(lambda time: None if time > 0 else balance)]
    return model


def run(case: Case, progress: Progress | None = None) -> Outcome:
    """Take the steps of a model; its result is that of the end."""
    transient, states = prepare(case, progress)
    start = transient.state()
    picture = case.outputs.picture
    summary, clock = _Summary(transient, keep=is_film(picture)), perf_counter()
    found = follow(case, transient, start, states, summary)
    rows, result = summary.rows(case, perf_counter() - clock), transient.result(summary.last)
    if picture is not None and is_film(picture):
        write_picture(picture, transient, states=summary.states)
    elif picture is not None:
        title = f"displacement at t = {summary.last.time:g} s"
        write_picture(picture, result, values="displacement", title=title)
    return Outcome(case, rows, result, found=found)


class _Summary(Kept):
    """What the summary says of a transient: its start, its last state and the one that moved farthest."""

    def __init__(self, transient: TransientAnalysis, keep: bool) -> None:
        super().__init__(keep)
        self.transient, self.energy = transient, transient.energy()
        self.count, self.largest, self.row = 0, 0.0, 0
        self.start = self.last = self.farthest = transient.state()

    def add(self, state: State) -> None:
        """Take a state."""
        super().add(state)
        self.last, self.count = state, self.count + 1
        length = np.linalg.norm(state.u, axis=1)
        row = int(length.argmax())
        if length[row] > self.largest:
            self.largest, self.farthest, self.row = float(length[row]), state, row

    def rows(self, case: Case, seconds: float) -> list[tuple[str, str]]:
        """Return the rows of the table."""
        e, mesh, time = self.transient.equations, case.model.mesh, case.time
        assert time is not None
        kinds = ", ".join(f"{len(block)} {block.name}" for block in mesh.blocks if len(block))
        steps = self.last.step - self.start.step
        span = f"{self.start.time:.6g} … {self.last.time:.6g} s, {steps} steps of {time.step:g} s"
        force, scale = self.last.reactions.sum(axis=0), float(np.abs(self.last.reactions).sum())
        where = f"at node {mesh.node_ids[self.row]}, t = {self.farthest.time:.6g} s, of {self.count} kept"
        rows = [
            ("nodes", str(mesh.n_nodes)),
            ("elements", kinds),
            ("unknowns", str(len(e.system.constraint_map.free))),
            ("integrator", str(self.transient.integrator) + (", lumped mass" if e.mass.lumped else "")),
            ("time", span),
            ("largest displacement", f"{self.largest:.6e} m {where}"),
            ("energy", f"{self.energy:.6e} J at the start, {self.transient.energy():.6e} J at the end"),
            ("total reaction", f"{vector(force, scale)} N at the end"),
            ("time per step", f"{seconds / max(steps, 1):.3g} s, {seconds:.3g} s in all"),
        ]
        if any(time.rayleigh):
            rows.insert(4, ("damping", "{:g} 1/s × M + {:g} s × K".format(*e.rayleigh)))
        rows += self.transient.result(self.last).report.motion_rows()
        still = [] if self.largest else ["no load, no support that moves and no velocity: nothing moves"]
        if free := e.free_motions.described():
            still.append(f"rigid motions are held by inertia alone: {free}")
        report = self.transient.result(self.farthest).report
        rows += [("warning", text) for text in (*report.warnings, *still)]
        return rows + [("note", text) for text in report.notes]
