"""Time integration of a Kratos run file: integrator, damping, steps and initial state."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kratos_lite.errors import InputError, naming
from kratos_lite.io.case import TimeIntegration
from kratos_lite.io.kratos.time_dependent import ProcessesInTime
from kratos_lite.io.settings import Settings
from kratos_lite.validation import finite

if TYPE_CHECKING:
    from kratos_lite.analysis.integrators import ModelIntegrator

DYNAMIC = ("Dynamic", "dynamic")
"""Kratos' solver_type of what moves."""
DYNAMIC_KEYS = (
    "time_integration_method", "scheme_type", "damp_factor_m", "newmark_beta",
    "rayleigh_alpha", "rayleigh_beta",
)  # fmt: skip


def time_integration_of(settings: Settings, processes: ProcessesInTime) -> TimeIntegration:
    """Return the time integration of a dynamic run file; InputError with the place of what is wrong."""
    solver, problem = settings.section("solver_settings"), settings.section("problem_data")
    times = processes.context.times
    text = f"must be 0 for dynamic solutions; got {times[0]:g}: shift the times"
    problem.expect(times[0] == 0, "start_time", text)
    rayleigh = tuple(solver.number(key, 0.0) for key in ("rayleigh_alpha", "rayleigh_beta"))
    for key, value in zip(("rayleigh_alpha", "rayleigh_beta"), rayleigh, strict=True):
        solver.expect(value >= 0, key, f"must be ≥ 0; got {value:g}")
    with naming(settings.source):
        for name in ("displacement", "velocity"):
            if (value := getattr(processes, name)) is not None:
                finite(value, f"the initial {name}")
    return TimeIntegration(
        solver.section("time_stepping").number("time_step"),
        len(times) - 1,
        integrator=_integrator(solver),
        rayleigh=(rayleigh[0], rayleigh[1]),
        displacement=processes.displacement,
        velocity=processes.velocity,
        balanced=False,
    )


def _integrator(solver: Settings) -> ModelIntegrator:
    """Return the integrator that Kratos would take."""
    from kratos_lite.analysis.integrators import Bossak, Newmark

    method = solver.text("time_integration_method", "implicit")
    if method != "implicit":
        raise solver.error(
            "time_integration_method",
            f"time_integration_method {method!r} is not supported: take 'implicit' with 'newmark'; "
            "the option --integrator central_difference then integrates explicitly",
        )
    kind, beta = solver.text("scheme_type", "bossak"), solver.number("newmark_beta", 0.25)
    text = f"must be 0.25, which is stable; got {beta:g}"
    solver.expect(beta == 0.25, "newmark_beta", text)
    try:
        if kind == "newmark":
            return Newmark()
        if kind == "bossak":
            return Bossak(solver.number("damp_factor_m", -0.3))
    except InputError as error:
        raise solver.error("damp_factor_m", str(error)) from None
    raise solver.error(
        "scheme_type", f"scheme_type {kind!r} is not supported; take 'newmark' or 'bossak' (Kratos' default)"
    )
