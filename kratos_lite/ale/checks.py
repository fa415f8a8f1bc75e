"""Checks: the speeds of waves in a body, and how near its motion is to the critical rate."""

from __future__ import annotations

import numpy as np

from kratos_lite.ale.matrices import MotionMatrices
from kratos_lite.ale.motion import Motion
from kratos_lite.voigt import acoustic_tensor

NEAR_CRITICAL = 0.9
"""Fraction of the critical rate from which a warning is given."""


def wave_speeds(terms: MotionMatrices) -> tuple[float, float, float]:
    """Return the lowest speeds c_p, c_s and c_R (Rayleigh) of the materials in m/s."""
    p, s = np.inf, np.inf
    for group in terms.groups:
        directions = terms.motion.wave_directions()
        squares = np.array([np.linalg.eigvalsh(acoustic_tensor(group.material.C, n)) for n in directions])
        speeds = np.sqrt(squares / group.material.density)
        p, s = min(p, float(speeds[:, 2].min())), min(s, float(speeds[:, 0].min()))
    return p, s, rayleigh_speed(p, s)


def rayleigh_speed(p: float, s: float) -> float:
    """Return the speed in m/s of Rayleigh waves for those of pressure and shear waves."""
    # Root of (2 - x)² = 4 sqrt(1 - x) sqrt(1 - x s²/p²) with x = (c_R / c_s)².
    low, high, k = 1e-6, 1.0 - 1e-12, (s / p) ** 2
    for _ in range(200):
        x = (low + high) / 2
        f = (2 - x) ** 2 - 4 * np.sqrt(1 - x) * np.sqrt(1 - k * x)
        low, high = (x, high) if f < 0 else (low, x)
    return float(s * np.sqrt((low + high) / 2))


def critical_rate_estimate(terms: MotionMatrices) -> float:
    """Return the rate in rad/s or m/s at which thick material is as fast as Rayleigh waves."""
    return terms.motion.critical_rate(wave_speeds(terms)[2], terms.moving_points)


def near_critical(motion: Motion, time: float, limit: float, of_mesh: bool) -> list[str]:
    """Return a warning if the rate at a time is near a critical one, that of the mesh or that of waves."""
    rate, unit = abs(motion.rate(time)), motion.unit
    if rate < NEAR_CRITICAL * limit:
        return []
    where = "above" if rate >= limit else "near"
    whose = f"{limit:.4g} {unit} on this mesh" if of_mesh else f"about {limit:.4g} {unit} by wave speeds"
    return [
        f"the rate {rate:g} {unit} is {where} the critical one, {whose}: a steady state resonates there, and "
        "motion may grow without bound"
    ]
