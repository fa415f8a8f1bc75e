"""Integrators of models, on one mode whose motion is a cosine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.analysis.integrators import HHT, Bossak, CentralDifference, GeneralizedAlpha, Newmark
from kratos_lite.analysis.integrators.base import ModelIntegrator
from kratos_lite.analysis.model import Model
from kratos_lite.analysis.stepping import integrate
from kratos_lite.analysis.transient import TransientAnalysis
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh.generators import box
from kratos_lite.typing import Array
from kratos_lite.verification.problem import Problem
from tests.verification.moving.known_values import bounded

SOLID = Isotropic3D(E=1e6, nu=0.0, density=1000.0)
INTEGRATORS: dict[str, tuple[ModelIntegrator, str]] = {
    "newmark": (Newmark(), "Newmark, β = 1/4, γ = 1/2"),
    "hht": (HHT(-0.1), "Hilber, α = -0.1"),
    "bossak": (Bossak(-0.1), "Bossak, α = -0.1"),
    "generalized_alpha": (GeneralizedAlpha(0.6), "Chung, ρ∞ = 0.6"),
    "central_difference": (CentralDifference(), "Hughes, chapter 9: second order"),
}


def column() -> Model:
    """Return one brick of 1 m that strains along z alone: its upper face moves as one."""
    model = Model(box(element="KinematicLinear3D8N"), SOLID)
    model.fix("z-")
    model.fix("z+", "xy")
    return model


def frequency(lumped: bool) -> float:
    """Return ω of the column: k = E A / L, and m = ρ A L / 3, or / 2 where it is lumped."""
    return float(np.sqrt(SOLID.E / (SOLID.density * (1 / 2 if lumped else 1 / 3))))


def released(integrator: ModelIntegrator) -> tuple[TransientAnalysis, float, Array]:
    """Return the column drawn by its mode and let go, its frequency, and the mode."""
    model = column()
    mode = np.zeros_like(model.mesh.points)
    mode[:, 2] = model.mesh.points[:, 2]
    omega = frequency(isinstance(integrator, CentralDifference))
    return model.transient(integrator=integrator, displacement=mode), omega, mode


def _error(integrator: ModelIntegrator, steps: int) -> float:
    """Return the error of u after ω t = 5."""
    transient, omega, mode = released(integrator)
    *_, end = integrate(transient, 5.0 / omega / steps, steps, every=steps)
    return float(np.abs(end.u - np.cos(omega * end.time) * mode).max())


def order(integrator: ModelIntegrator) -> Callable[[str], float]:
    """Return a function: the order of the error in the step."""
    return lambda _: float(np.log2(_error(integrator, 128) / _error(integrator, 256)))


def turn(integrator: ModelIntegrator, share: float) -> Callable[[str], float]:
    """Return a function: by how much a step of ω h = share turns the mode, in rad."""

    def of(kind: str) -> float:
        transient, omega, _ = released(integrator)
        *_, end = integrate(transient, share / omega, 1)
        return float(np.arccos(end.u[:, 2].max()))

    return of


def shrinking(integrator: ModelIntegrator) -> Callable[[str], float]:
    """Return a function: the factor by which a mode of ω h = 600 shrinks in a step, a mean over 20."""

    def of(kind: str) -> float:
        transient, omega, _ = released(integrator)
        list(integrate(transient, 600 / omega, 60, every=60))
        before = transient.energy()
        list(integrate(transient, 600 / omega, 20, every=20))
        return float((transient.energy() / before) ** (1 / 40))

    return of


def energy(_: str) -> float:
    """Return the relative change of energy over 1000 steps of the trapezoidal rule."""
    model = Model(
        box((1, 1, 2), (2, 2, 4), "KinematicLinear3D8N"), Isotropic3D(E=1e6, nu=0.3, density=1000.0)
    )
    model.fix("z-")
    x, y, z = model.mesh.points.T
    transient = model.transient(velocity=np.column_stack([z * z, x * z, y * z]))
    start = transient.energy()
    list(integrate(transient, 2.0**-9, 1000, every=1000))
    return float(transient.energy() / start - 1)


PROBLEMS: list[Problem] = [
    *(
        bounded(f"time/order_{name}", "order of the error of u in the step, one mode over ω t = 5", source, 2,
                0.05, order(integrator))
        for name, (integrator, source) in INTEGRATORS.items()
    ),
    bounded("time/turn_newmark", "angle by which a step ω h = 1 turns the mode, rad",
            "Hughes, chapter 9: 2 atan(ω h / 2)", 2 * np.arctan(0.5), 1e-10, turn(Newmark(), 1.0)),
    bounded("time/turn_central_difference", "angle by which a step ω h = 1 turns the mode, rad",
            "Hughes, chapter 9: acos(1 - (ω h)² / 2)", np.arccos(0.5), 1e-10,
            turn(CentralDifference(), 1.0)),
    *(
        bounded(f"time/radius_{rho:g}", f"factor of a step ω h = 600, generalized α, ρ∞ = {rho:g}",
                "Chung, ρ∞", rho, 0.03, shrinking(GeneralizedAlpha(rho)))
        for rho in (0.8, 0.5)
    ),
    bounded("time/radius_hht", "factor of a step ω h = 600, HHT, α = -0.1", "Hilber, (1 + α) / (1 - α)",
            0.9 / 1.1, 0.03, shrinking(HHT(-0.1))),
    bounded("time/energy", "relative change of energy over 1000 steps of the trapezoidal rule",
            "Hughes, chapter 9: conserved", 0, 1e-11, energy),
]  # fmt: skip
"""The rows of this family."""
