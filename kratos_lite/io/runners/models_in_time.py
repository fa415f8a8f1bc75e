"""Models in time, moving or in quasi-static steps."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.analysis.quasi_static import QuasiStaticAnalysis
from kratos_lite.analysis.report import vector
from kratos_lite.analysis.state import State
from kratos_lite.analysis.stepping import integrate
from kratos_lite.analysis.transient import TransientAnalysis
from kratos_lite.io.case import Case, TimeIntegration
from kratos_lite.io.outputs import is_film, write_picture
from kratos_lite.io.runners.in_time import Kept, begun, follow, per_step
from kratos_lite.io.runners.outcome import Outcome
from kratos_lite.model.loads import TimeDependentLoad
from kratos_lite.model.loads.nodal import NodalForces
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Progress

InTime: TypeAlias = TransientAnalysis | QuasiStaticAnalysis


def prepare(case: Case, progress: Progress | None = None) -> tuple[InTime, Iterator[State]]:
    """Return the analysis of a case and its states, checked, without a step."""
    time = case.time
    assert time is not None
    analysis: InTime = _transient(case, time, progress) if time.quasi_static is None else _steps(case, time)

    def steps() -> Iterator[State]:
        if time.quasi_static is None or not time.sizes:
            return integrate(analysis, time.step, time.steps, every=time.every, progress=progress)
        last = analysis.step + time.steps
        return (state for state in unlike(last) if state.step % time.every == 0 or state.step == last)

    def unlike(last: int) -> Iterator[State]:
        while analysis.step < last:
            h = time.sizes[min(analysis.step, len(time.sizes) - 1)]
            yield from integrate(analysis, h, 1, progress=progress)

    return analysis, begun(time, analysis, steps)


def _steps(case: Case, time: TimeIntegration) -> QuasiStaticAnalysis:
    """Return the analysis of quasi-static steps at their start."""
    analysis = case.model.quasi_static(**time.quasi_static or {})
    analysis.time = time.start
    return analysis


def _transient(case: Case, time: TimeIntegration, progress: Progress | None) -> TransientAnalysis:
    """Return the transient of a case at its start."""
    names = ("integrator", "rayleigh", "lumped", "displacement", "velocity")
    settings: dict[str, Any] = {name: getattr(time, name) for name in names} | {"progress": progress}
    if case.after is not None and case.after.end is not None:
        settings["displacement"] = case.after.end.u
    transient = case.model.transient(**settings)
    if time.balanced or (time.displacement is None and time.velocity is None):
        return transient
    return TransientAnalysis(_held_at_first(transient), **settings)


def check(case: Case) -> list[str]:
    """Return the warnings of the model and of its start; no step is taken."""
    analysis = prepare(case)[0]
    return analysis.equations.warnings if isinstance(analysis, TransientAnalysis) else analysis.warnings


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
    analysis, states = prepare(case, progress)
    start, picture, clock = analysis.state(), case.outputs.picture, perf_counter()
    film = is_film(picture)
    kept = _Summary(analysis, film) if isinstance(analysis, TransientAnalysis) else Kept(film)
    found = follow(case, analysis, start, states, kept)
    seconds, result = perf_counter() - clock, analysis.result()
    if picture is not None and kept.keep:
        write_picture(picture, analysis, states=kept.states)
    elif picture is not None:
        title = f"displacement at t = {analysis.time:g} s" if isinstance(kept, _Summary) else None
        write_picture(picture, result, values="displacement", title=title)
    if isinstance(kept, _Summary):
        return Outcome(case, kept.rows(case, seconds), result, found=found)
    assert isinstance(analysis, QuasiStaticAnalysis)
    steps, parts = analysis.step - start.step, len(analysis.reports)
    span = f"{start.time:.6g} … {analysis.time:.6g} s, {steps} steps in {parts} parts"
    return Outcome(case, [("time", span), per_step(seconds, steps), *result.table()], result, found=found)


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
            per_step(seconds, steps),
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
