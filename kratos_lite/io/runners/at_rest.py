"""Models at rest: statics, and steady motion of the material through the mesh."""

from __future__ import annotations

from kratos_lite.io.case import Case
from kratos_lite.io.runners.outcome import Outcome
from kratos_lite.typing import Progress


def run(case: Case, progress: Progress | None = None) -> Outcome:
    """Solve the model."""
    return Outcome(case, [], case.model.solve(case.solver, case.tolerance, progress, error=case.error))
