"""Progress: a line in a terminal or a notebook that shows what takes long, and vanishes at the end.

The library calls ``progress(phase, fraction)``; here that becomes a line, written by a thread of its own, so
that it also moves where nobody calls: while a file is read, a matrix factorized or multigrid set up.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import perf_counter
from typing import Any

from kratos_lite.typing import Progress

PATIENCE = 0.5
"""Seconds that work takes before it is shown."""
EVERY = 0.2
"""Seconds between two lines."""
SWITCH = "KRATOS_LITE_PROGRESS"
"""Variable of the environment; ``off`` shows no progress in notebooks."""


@contextmanager
def watched(progress: Progress | None, phase: str = "") -> Iterator[Progress | None]:
    """Give what shows the progress of some work: what the caller has, a line in a notebook, or None."""
    # Nothing is imported, and nothing shown in a script: whoever works in a notebook has IPython already.
    if progress is not None or "IPython" not in sys.modules or os.environ.get(SWITCH) == "off":
        yield progress
        return
    write = _of_notebook()
    if write is None:
        yield None
        return
    with Line(write, phase) as line:
        yield line


@contextmanager
def in_terminal(phase: str = "", always: bool = False) -> Iterator[Line | None]:
    """Give a line that shows progress where standard error is a terminal, or `always`; None elsewhere."""
    if not (always or sys.stderr.isatty()):
        yield None
        return
    with Line(Terminal(), phase, patience=0.0 if always else PATIENCE) as line:
        yield line


def _of_notebook() -> Callable[[str], None] | None:
    """Return what writes a line in a notebook or in an IPython terminal, or None outside of both."""
    shell = getattr(sys.modules["IPython"], "get_ipython", lambda: None)()
    if shell is None:
        return None
    if getattr(shell, "kernel", None) is not None:
        return Cell()
    return Terminal() if sys.stderr.isatty() else None


class Cell:
    """A line below a cell of a notebook."""

    def __init__(self) -> None:
        self._shown: Any = None

    def __call__(self, text: str) -> None:
        """Show a text in place of the last one."""
        from IPython.display import display  # whoever comes here has imported it

        show: Any = display
        data = {"text/plain": text}
        if self._shown is not None:
            self._shown.update(data, raw=True)
        elif text:
            self._shown = show(data, raw=True, display_id=True)


class Terminal:
    """The last line of a terminal."""

    def __init__(self) -> None:
        self._width = 0

    def __call__(self, text: str) -> None:
        """Show a text in place of the last one; an empty one wipes the line."""
        end = "" if text else "\r"
        sys.stderr.write(f"\r{text:<{self._width}}{end}")
        sys.stderr.flush()
        self._width = len(text)


class Line:
    """The phase of some work, its fraction that is done and the seconds that it takes, once it takes long.

    `write` takes each text, and an empty one at the end, after `patience` and then `every` so many seconds;
    without patience each phase is shown.
    """

    def __init__(
        self, write: Callable[[str], None], phase: str = "", patience: float = PATIENCE, every: float = EVERY
    ) -> None:
        from contextvars import copy_context  # rarely needed
        from threading import Event, RLock, Thread

        self._write, self._phase, self._fraction = write, phase, 0.0
        self._patience, self._every, self._start = patience, every, perf_counter()
        self._over, self._lock, self._shown = Event(), RLock(), False
        # The context says below which cell of a notebook to write.
        self._thread = Thread(target=copy_context().run, args=(self._tick,), daemon=True)
        with suppress(RuntimeError):  # where there are no threads
            self._thread.start()
        if not patience:
            self._show()

    def __call__(self, phase: str, fraction: float) -> None:
        """Take a phase and the fraction of it that is done, 0 … 1."""
        is_new = phase != self._phase
        self._phase, self._fraction = phase, fraction
        if is_new and not self._patience:
            self._show()

    def _tick(self) -> None:
        wait = self._patience or self._every
        while not self._over.wait(wait):
            self._show()
            wait = self._every

    def _show(self) -> None:
        with self._lock, suppress(OSError, ValueError):  # a display that is gone
            if self._phase and not self._over.is_set():
                fraction = f"{self._fraction:5.0%}" if self._fraction else " " * 5
                self._shown = True
                self._write(f"{self._phase:<10} {fraction}  {perf_counter() - self._start:6.1f} s")

    @contextmanager
    def hidden(self) -> Iterator[None]:
        """Wipe the line while something else is printed."""
        with self._lock:
            if self._shown:
                self._shown = False
                with suppress(OSError, ValueError):
                    self._write("")
            yield

    def close(self) -> None:
        """Wipe the line for good."""
        self._over.set()
        with self.hidden():
            pass

    def __reduce__(self) -> tuple[type, tuple[()]]:
        """Become None in a copy: a result that is copied or pickled shows nothing."""
        return type(None), ()

    def __enter__(self) -> Line:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
