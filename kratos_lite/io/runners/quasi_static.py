"""Models in quasi-static steps."""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter

from kratos_lite.analysis.quasi_static import QuasiStaticAnalysis
from kratos_lite.analysis.state import State
from kratos_lite.analysis.stepping import integrate
from kratos_lite.io.case import Case
from kratos_lite.io.outputs import is_film, write_picture
from kratos_lite.io.runners.in_time import Kept, begun, follow
from kratos_lite.io.runners.outcome import Outcome
from kratos_lite.typing import Progress


def prepare(case: Case, progress: Progress | None = None) -> tuple[QuasiStaticAnalysis, Iterator[State]]:
    """Return the analysis of a case and its states, checked, without a step."""
    time = case.time
    assert time is not None
    analysis = case.model.quasi_static(**time.quasi_static or {})
    analysis.time = time.start

    def steps() -> Iterator[State]:
        if not time.sizes:
            return integrate(analysis, time.step, time.steps, every=time.every, progress=progress)
        last = analysis.step + time.steps
        return (state for state in unlike(last) if state.step % time.every == 0 or state.step == last)

    def unlike(last: int) -> Iterator[State]:
        while analysis.step < last:
            h = time.sizes[min(analysis.step, len(time.sizes) - 1)]
            yield from integrate(analysis, h, 1, progress=progress)

    return analysis, begun(time, analysis, steps)


def check(case: Case) -> list[str]:
    """Return the warnings of the model; no step is taken."""
    return prepare(case)[0].warnings


def run(case: Case, progress: Progress | None = None) -> Outcome:
    """Take the steps of a model; its result is that of the end."""
    analysis, states = prepare(case, progress)
    kept, clock, picture = Kept(is_film(case.outputs.picture)), perf_counter(), case.outputs.picture
    start = analysis.state()
    found = follow(case, analysis, start, states, kept)
    seconds, result = perf_counter() - clock, analysis.result()
    if picture is not None:
        film = {"states": kept.states} if kept.keep else {"values": "displacement"}
        write_picture(picture, analysis if kept.keep else result, **film)
    steps, parts = analysis.step - start.step, len(analysis.reports)
    rows = [
        ("time", f"{start.time:.6g} … {analysis.time:.6g} s, {steps} steps in {parts} parts"),
        ("time per step", f"{seconds / max(steps, 1):.3g} s, {seconds:.3g} s in all"),
    ]
    return Outcome(case, [*rows, *result.table()], result, found=found)
