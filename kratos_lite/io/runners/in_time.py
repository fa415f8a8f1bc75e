"""What models and bodies in time share: files that are written step by step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any, Protocol

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.io.case import Case, Comparison, TimeIntegration
from kratos_lite.io.writers.series import SeriesWriter, make_folder
from kratos_lite.io.writers.state import read_state, write_state


class Monitor(Protocol):
    """Takes each state for the summary."""

    def add(self, state: Any) -> None:
        """Take a state."""


def placed(time: TimeIntegration, action: Callable[[], Iterator[Any]]) -> Iterator[Any]:
    """Return what an action returns; an InputError, as of a step that is too long, gets its place."""
    try:
        return action()
    except InputError as error:
        raise InputError(f"{time.place}: {error}" if time.place else str(error)) from None


def restart(path: str, subject: Any) -> None:
    """Let a body or a model go on from the state in a file; InputError, with its name, if it does not fit."""
    state = read_state(path)
    try:
        state.restore(subject)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def follow(
    case: Case, subject: Any, start: Any, states: Iterator[Any], monitor: Monitor
) -> dict[int, list[tuple[float, str]]]:
    """Take all steps of a case, and write its series and its last state; return what comparisons found.

    After an error or Ctrl-C the series hold the states up to there, and the last of them is written too.
    """
    outputs, last, found = case.outputs, [start], dict[int, list[tuple[float, str]]]()
    for path in outputs.paths():
        make_folder(path)
    with ExitStack() as stack:
        if outputs.state is not None:
            stack.callback(_save, last, outputs.state)
        series = [
            stack.enter_context(SeriesWriter(path, subject, mode=outputs.mode or "binary"))
            for path in outputs.results
        ]
        for output in outputs.in_steps:
            stack.callback(output.close)
        stack.enter_context(np.errstate(over="ignore", invalid="ignore"))
        for recorder in (*series, monitor):
            recorder.add(start)
        for last[0] in states:
            for recorder in (*series, monitor):
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


def _save(last: list[Any], path: str) -> None:
    write_state(path, last[0])
