"""Models at rest: statics, and steady motion of the material through the mesh."""

from __future__ import annotations

from kratos_lite.analysis.static import StaticAnalysis
from kratos_lite.io.case import Case
from kratos_lite.io.runners.outcome import Outcome
from kratos_lite.typing import Progress


def check(case: Case) -> list[str]:
    """Return the warnings of the model, checked as its solution does."""
    model = case.model
    if model.motion is not None or model.is_nonlinear:
        return model.check()
    analysis = StaticAnalysis(model, case.solver, case.tolerance, backend=case.backend, petsc=case.petsc)
    return analysis.check()


def run(case: Case, progress: Progress | None = None) -> Outcome:
    """Solve the model."""
    names = ("error", "most_unknowns", "backend", "petsc")
    options = {name: getattr(case, name) for name in names}
    result = case.model.solve(case.solver, case.tolerance, progress, **options)
    return Outcome(case, [], result)
