"""What models and bodies in time share: files that are written step by step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.io.case import Case, TimeIntegration
from kratos_lite.io.writers.pictures import is_film
from kratos_lite.io.writers.recorded import recorded
from kratos_lite.io.writers.series import SeriesWriter, make_folder
from kratos_lite.io.writers.state import read_state, write_state
from kratos_lite.validation import fits_memory

STATE = 400.0
"""Bytes of a state or of a row of a table beside its numbers, about."""


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


def follow(case: Case, subject: Any, start: Any, states: Iterator[Any], monitor: Monitor) -> None:
    """Take all steps of a case, and write its series and its last state.

    After an error or Ctrl-C the series hold the states up to there, and the last of them is written too.
    """
    outputs, last = case.outputs, [start]
    check_room(case, subject, start)
    for path in outputs.paths():
        make_folder(path)
    with ExitStack() as stack:
        if outputs.state is not None:
            stack.callback(_save, last, outputs.state)
        series = [
            stack.enter_context(SeriesWriter(path, subject, mode=outputs.mode or "binary"))
            for path in outputs.results
        ]
        stack.enter_context(np.errstate(over="ignore", invalid="ignore"))
        for recorder in (*series, monitor):
            recorder.add(start)
        for last[0] in states:
            for recorder in (*series, monitor):
                recorder.add(last[0])


def check_room(case: Case, subject: Any, start: Any) -> None:
    """Raise InputError, before any step, for states that memory or the disk cannot hold."""
    outputs, time = case.outputs, case.time
    assert time is not None
    kept = -(-time.steps // time.every) + 1
    cure = "keep fewer of them, with every or --time STEP:STEPS:EVERY"
    size = float(sum(np.asarray(values).nbytes for values in start.values.values()) + STATE)
    of_memory = sum(path.lower().endswith((".npz", ".html")) for path in outputs.results)
    of_memory += is_film(outputs.picture) or (outputs.picture is not None and not case.is_of_model)
    fits_memory(kept * (of_memory * size + STATE), f"a series of {kept} states", cure)
    for path in outputs.results:
        if path.lower().endswith(".pvd"):
            mesh = recorded(subject, path).mesh()
            needed = kept * 8.0 * (6 * mesh.n_nodes + sum(block.nodes.size for block in mesh.blocks))
            _check_disk(path, needed, f"{kept} frames", cure)


def _check_disk(path: str, needed: float, what: str, cure: str) -> None:
    """Raise InputError for files that need more room than the disk has."""
    with suppress(OSError):
        import shutil

        free = shutil.disk_usage(Path(path).absolute().parent).free
        if needed > free:
            text = f"{what} need about {needed / 1e9:.3g} GB; {free / 1e9:.3g} GB are free on the disk"
            raise InputError(f"{path}: {text}; {cure}")


def _save(last: list[Any], path: str) -> None:
    write_state(path, last[0])
