"""What models and bodies in time share: files that are written step by step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np

from kratos_lite.errors import naming
from kratos_lite.io.case import Case, Comparison, TimeIntegration
from kratos_lite.io.writers.series import SeriesWriter, make_folder
from kratos_lite.io.writers.state import read_state, write_state


class Kept:
    """The states of a film or of a path, or none; what a summary says of all states builds on it."""

    def __init__(self, keep: bool) -> None:
        self.keep, self.states = keep, list[Any]()

    def add(self, state: Any) -> None:
        """Take a state."""
        if self.keep:
            self.states.append(state)


def per_step(seconds: float, steps: int) -> tuple[str, str]:
    """Return the row of a summary that says how long steps took."""
    return "time per step", f"{seconds / max(steps, 1):.3g} s, {seconds:.3g} s in all"


def begun(time: TimeIntegration, subject: Any, steps: Callable[[], Iterator[Any]]) -> Iterator[Any]:
    """Return the states of the steps of a body or model, which goes on from one in a file if it is given."""
    with naming(time.restart or ""):
        if time.restart is not None:
            read_state(time.restart).restore(subject)
    with naming(time.place):
        return steps()


def follow(
    case: Case, subject: Any, start: Any, states: Iterator[Any], monitor: Kept
) -> dict[int, list[tuple[float, str]]]:
    """Take all steps of a case, and write its series and its last state; return what comparisons found.

    After an error or Ctrl-C the series hold the states up to there, and the last of them is written too.
    """
    outputs, last, found = case.outputs, [start], dict[int, list[tuple[float, str]]]()
    for path in outputs.paths():
        make_folder(path)
    with ExitStack() as stack:
        if outputs.state is not None:
            stack.callback(lambda path: write_state(path, last[0]), outputs.state)
        series = [
            stack.enter_context(SeriesWriter(path, subject, mode=outputs.mode or "binary"))
            for path in outputs.results
        ]
        for output in outputs.in_steps:
            stack.callback(output.close)
        stack.enter_context(np.errstate(over="ignore", invalid="ignore"))
        recorders: list[SeriesWriter | Kept] = [*series, monitor]
        for recorder in recorders:
            recorder.add(start)
        for last[0] in states:
            for recorder in recorders:
                recorder.add(last[0])
            _at_step(case, subject, last[0], found)
    return found


def _at_step(case: Case, subject: Any, state: Any, found: dict[int, list[tuple[float, str]]]) -> None:
    """Write the outputs that are due after a step, and add what comparisons find."""
    outputs = [each for each in case.outputs.in_steps if each.is_due(state.time)]
    expected = enumerate(case.expected)
    due = {i: each for i, each in expected if isinstance(each, Comparison) and each.is_due(state.time)}
    if not (outputs or due):
        return
    result = subject.result()
    for output in outputs:
        output.add(result, state.time, state)
    for i, comparison in due.items():
        found.setdefault(i, []).append(comparison.found(result, state.time))
