"""Progress on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from kratos_lite.view.progress import PATIENCE, Line, Terminal


@contextmanager
def shown(phase: str = "", always: bool = False) -> Iterator[Line | None]:
    """Give a line that shows progress where standard error is a terminal, or `always`; None elsewhere."""
    if not (always or sys.stderr.isatty()):
        yield None
        return
    with Line(Terminal(), phase, patience=0.0 if always else PATIENCE) as line:
        yield line
