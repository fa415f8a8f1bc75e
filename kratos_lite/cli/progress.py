"""Progress on a terminal."""

from __future__ import annotations

import sys
from time import perf_counter


class TerminalProgress:
    """Show the phase on a terminal once the work has taken more than two seconds."""

    def __init__(self, always: bool = False) -> None:
        self.start = perf_counter()
        self.last = 0.0 if always else self.start
        self.phase = ""
        self.shown, self.patience = False, 0.0 if always else 2.0
        self.wanted = always or sys.stderr.isatty()

    def __call__(self, phase: str, share: float) -> None:
        """Show a phase and the share of it that is done, when it begins and at most five times a second."""
        now = perf_counter()
        if (
            self.wanted
            and now - self.start > self.patience
            and (now - self.last > 0.2 or phase != self.phase)
        ):
            self.last, self.shown, self.phase = now, True, phase
            print(
                f"\r{phase:<10} {share:5.0%}  {now - self.start:6.1f} s", end="", file=sys.stderr, flush=True
            )

    def __enter__(self) -> TerminalProgress:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Wipe the line."""
        if self.shown:
            print("\r" + " " * 40 + "\r", end="", file=sys.stderr, flush=True)
