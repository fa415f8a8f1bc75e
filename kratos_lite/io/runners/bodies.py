"""Bodies in time, and their description."""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter
from typing import Any

import numpy as np

from kratos_lite.analysis.state import State
from kratos_lite.analysis.stepping import integrate
from kratos_lite.bodies import Body
from kratos_lite.bodies.body import Deformable
from kratos_lite.io.case import Case
from kratos_lite.io.outputs import write_picture
from kratos_lite.io.runners.in_time import Kept, begun, follow, per_step
from kratos_lite.io.runners.outcome import Outcome
from kratos_lite.io.writers.recorded import Totals
from kratos_lite.io.writers.series import SeriesWriter
from kratos_lite.typing import Array, Progress


def prepare(case: Case, progress: Progress | None = None) -> tuple[Body, Iterator[State]]:
    """Return the body of a case and its states, checked, without a step."""
    body, time = case.body, case.time
    assert time is not None
    for path in case.outputs.results:
        SeriesWriter(path, body)

    def steps() -> Iterator[State]:
        options: dict[str, Any] = {"every": time.every, "substeps": time.substeps, "progress": progress}
        return integrate(body, time.step, time.steps, **options)

    return body, begun(time, body, steps)


def check(case: Case) -> list[str]:
    """Return the warnings of the body; no step is taken."""
    return prepare(case)[0].warnings()


def run(case: Case, progress: Progress | None = None) -> Outcome:
    """Take the steps of a body, and draw its path."""
    body, states = prepare(case, progress)
    summary, clock = _Summary(body, keep=case.outputs.picture is not None), perf_counter()
    follow(case, body, State.of(body), states, summary)
    seconds = perf_counter() - clock
    if case.outputs.picture is not None:
        title = case.files[0].stem.replace("_", " ") if case.files else ""
        write_picture(case.outputs.picture, body, states=summary.states, title=title)
    return Outcome(case, [*rows_of(body), *summary.rows(seconds)])


class _Summary(Kept):
    """What the summary says of a motion: energies at its start and end, and the largest between."""

    def __init__(self, body: Body, keep: bool) -> None:
        super().__init__(keep)
        self.body, self.largest = body, 0.0
        self.start = Totals(body)

    def add(self, state: State) -> None:
        """Take a state."""
        super().add(state)
        energy = float(np.sum(self.body.kinetic_energy() + self.body.internal_energy()))
        self.largest = max(self.largest, energy)

    def rows(self, seconds: float) -> list[tuple[str, str]]:
        """Return the rows of the table."""
        # What kinetic and internal energy gain beyond the external work is an error of the integrator, unless
        # damping takes it; potential energy stays out of this, as its loss is external work already.
        start, end = self.start, Totals(self.body)
        steps = end.step - start.step
        gained = end.kinetic - start.kinetic + end.internal - start.internal - (end.work - start.work)
        drift = gained / self.largest if self.largest else 0.0
        what = "of the largest energy: kinetic + internal less external work"
        balance = ("energy drift", f"{drift:+.1e} {what}")
        if self.body.damping > 0:
            balance = ("dissipated", f"{-gained:.7g} J, by damping and the integrator")
        rows = [
            ("time", f"{start.time:.6g} … {end.time:.6g} s, {steps} steps"),
            ("kinetic energy", f"{end.kinetic:.7g} J"),
            ("internal energy", f"{end.internal:.7g} J"),
            ("potential energy", f"{end.potential:.7g} J"),
            ("sum of energies", f"{end.energy:.7g} J"),
            ("external work", f"{end.work - start.work:.7g} J, of all loads, gravity too, and of reactions"),
            balance,
            ("linear momentum", f"{_vector(end.linear)} kg m/s"),
            ("angular momentum", f"{_vector(end.angular)} kg m²/s about the mass center"),
        ]
        if self.body.q.ndim == 1:
            rows.append(("mass center", f"{_vector(end.center)} m"))
        return [*rows, per_step(seconds, steps)]


def rows_of(body: Body) -> list[tuple[str, str]]:
    """Return what a body is, as rows of a table."""
    formulation = f" {word}" if (word := body.settings().get("formulation")) else ""
    many = f"{len(body.q)} × " if body.q.ndim > 1 else ""
    rows = [("body", f"{many}{body.kind}{formulation}, {body.dofs} velocities, {body.integrator}")]
    if body.mesh is not None:
        elements = ", ".join(f"{len(block)} {block.name}" for block in body.mesh.blocks if len(block))
        rows.append(("mesh", f"{body.mesh.n_nodes} nodes, {elements}"))
    if body.q.ndim == 1:
        rows.append(("mass", f"{float(body.mass):.7g} kg"))
    if body.damping:
        rows.append(("damping", f"{body.damping:g} s"))
    return rows + [("warning", text) for text in body.warnings()]


def describe(case: Case) -> Outcome:
    """Return what the body of a case is, what acts on it, and how it will move."""
    body, time = case.body, case.time
    assert time is not None
    rows = rows_of(body)
    if body.q.ndim == 1:
        moments = ", ".join(f"{value:.7g}" for value in body.mass_properties.inertia.diagonal())
        rows += [
            ("mass center", f"{_vector(body.mass_center())} m"),
            ("inertia xx, yy, zz", f"{moments} kg m²"),
            ("energy", f"{float(body.energy()):.7g} J"),
        ]
    if isinstance(body, Deformable):
        rows.append(("critical step", f"{body.critical_step():.4g} s, of explicit integration"))
    held = [f"{type(constraint).__name__} ({constraint.count})" for constraint in body.constraints]
    rows += [
        ("loads", str(len(body.loads)) if body.loads else "none"),
        ("constraints", ", ".join(held) or "none"),
        ("time", f"from {body.time:g} s, {time}"),
    ]
    outputs = [("output", path) for path in case.outputs.results]
    outputs += [(key, path) for key in ("picture", "state") if (path := getattr(case.outputs, key))]
    return Outcome(case, rows + outputs)


def _vector(values: Array) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
