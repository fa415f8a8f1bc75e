"""Run a case: a table from the name of its analysis to the module that runs it."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import Any

from kratos_lite.errors import InputError, ModelError
from kratos_lite.io.case import Case, TimeIntegration
from kratos_lite.io.outputs import check_outputs
from kratos_lite.io.runners.outcome import Outcome
from kratos_lite.model.structure import Structure
from kratos_lite.tabular import aligned, in_units
from kratos_lite.typing import Progress
from kratos_lite.view.progress import watched

ANALYSES = {
    "static": ("at_rest", ""),
    "steady": ("at_rest", "a motion of the material"),
    "modal": ("modal", "natural frequencies"),
    "harmonic": ("modal", "a harmonic response"),
    "transient": ("models_in_time", "an integration in time"),
    "quasi_static": ("models_in_time", "quasi-static steps"),
    "bodies": ("bodies", "a body"),
}
"""The module of `kratos_lite.io.runners` that runs each analysis, and what it is if PETSc does not do it."""


def run(case: Case, progress: Progress | None = None) -> Outcome:
    """Run what an input describes.

    States in time are written as they come; `Outcome.write` writes what the end gives.

    Parameters
    ----------
    case : such as `kratos_lite.read_case` returns.
    progress : called with the phase and the fraction done, 0 … 1.

    Returns
    -------
    Outcome
        Summary, result and comparisons with expected values.

    Raises
    ------
    InputError, MeshError, ModelError, SolveError
        An output cannot be written, or the analysis cannot be done.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bar = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.0, density=1000.0))
    >>> bar.fix("z-")
    >>> bar.add(kl.Traction("z+", (0.0, 0.0, 1e6)))
    >>> outcome = kl.run(kl.Case(bar))
    >>> print(f"{outcome.result.u[:, 2].max():.3g} m")
    0.001 m
    """
    check_case(case)
    check_outputs(case)
    _run_before(case)
    with watched(progress) as shown:
        outcome: Outcome = runner_of(case).run(case, shown)
    case.end = outcome.result
    return outcome


def _run_before(case: Case) -> None:
    """Run the case at whose end a case begins, unless it has been."""
    if case.after is not None and case.after.end is None:
        run(case.after)


def check(case: Case) -> list[str]:
    """Return the warnings of a case, checked as `run` does, without solving or taking a step."""
    check_case(case)
    check_outputs(case)
    warnings: list[str] = runner_of(case).check(case)
    return warnings


def check_case(case: Case) -> None:
    """Raise InputError for a case that cannot be run as it stands."""
    if not isinstance(case, Case):
        raise InputError(f"a case is run, such as kl.read_case or kl.Case gives; got {type(case).__name__}")
    if not isinstance(case.outputs.results, list):
        raise InputError(f"the results of a case are a list of paths; got {case.outputs.results!r}")
    _check_analysis(case)
    if case.backend == "petsc":
        if what := ANALYSES[case.analysis][1]:
            raise InputError(f"backend='petsc' solves statics; this case has {what}; leave it out")
        if case.error is not None:
            raise InputError("backend='petsc' solves on the mesh as it is; leave the requested error out")
    if isinstance(case.subject, Structure):
        if case.time is not None and case.analysis == "quasi_static" and _moves(case.time):
            raise InputError("quasi-static steps have no integrator, damping and mass; leave them out")
        return
    from kratos_lite.bodies import Body  # a model at rest starts quicker without it

    if not isinstance(case.subject, Body):
        raise InputError(f"a case needs a model or a body; got {type(case.subject).__name__}")
    if case.modes or case.harmonic is not None or case.time is None:
        raise InputError(
            "a body needs a time integration, and has no natural frequencies: kl.Case(body, time=…)"
        )
    if _moves(case.time):
        raise InputError("a body has its own integrator, damping and mass: set them on the body")


def _check_analysis(case: Case) -> None:
    """Raise InputError for analyses that exclude each other."""
    if case.modes and case.time is not None:
        raise InputError("a case has natural frequencies or a time integration; give one of them")
    if case.harmonic is not None and (case.modes or case.time is not None):
        raise InputError("a harmonic response goes with no modes and no time integration; leave them out")
    if case.preload and (not case.modes or case.buckling):
        raise InputError("a preload is that of natural frequencies: kl.Case(model, modes=5, preload=True)")
    if case.buckling and not case.modes:
        cure = "kl.Case(model, modes=5, buckling=True)"
        raise InputError(f"buckling of a case needs the number of its modes: {cure}")


def _moves(time: TimeIntegration) -> bool:
    return time.integrator is not None or any(time.rayleigh) or time.lumped


def prepare(case: Case, progress: Progress | None = None) -> tuple[Any, Iterator[Any]]:
    """Return the transient or body of a case in time and its states, checked; no step is taken yet."""
    if case.time is None:
        raise ModelError("this case is not in time; give it a kl.TimeIntegration")
    _run_before(case)
    subject, states = runner_of(case).prepare(case, progress)
    return subject, states


def runner_of(case: Case) -> Any:
    """Return the module that runs the analysis of a case."""
    return import_module(f"kratos_lite.io.runners.{ANALYSES[case.analysis][0]}")


def describe_case(case: Case) -> str:
    """Return what a case is: its model or body, and how it moves through time."""
    name = case.files[0].name
    if not case.is_of_model:
        return f"{'file':<22}{name}\n{runner_of(case).describe(case)}"
    time = [("time", str(case.time))] if case.time else []
    from kratos_lite.io.describe import amounts

    known = [row for row in case.model.table() if row[0] != "load"]
    rows = [("file", name), *known, *amounts(case.model, case.time.end if case.time else 0.0), *time]
    return in_units(aligned(rows), case.model.units)
