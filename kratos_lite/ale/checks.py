"""Checks: materials alike wherever they move to, speeds of waves, how near a rate is to the critical one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kratos_lite.ale.matrices import MotionMatrices
from kratos_lite.ale.motion import Motion
from kratos_lite.errors import ModelError
from kratos_lite.voigt import acoustic_tensor

NEAR_CRITICAL = 0.9
"""Fraction of the critical rate from which a warning is given."""

HARMONICS = 12
"""Waves around the axis, or along the frame, that are looked for."""
UNEVEN = 1e-2
"""Fraction of a harmonic that is too much."""


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
    # (2 - x)² = 4 sqrt(1 - x) sqrt(1 - k x), squared and without x, with x = (c_R / c_s)² and k = s²/p².
    k = (s / p) ** 2
    roots = np.roots([1.0, -8.0, 24 - 16 * k, 16 * (k - 1)])
    return float(s * np.sqrt(min(roots[np.abs(roots.imag) < 1e-9].real)))


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


# ---- alike wherever material moves to ----------------------------------------------------------------


def check_materials(terms: MotionMatrices) -> None:
    """Raise ModelError if density or stiffness is not spread evenly about the axis, or along the frame."""
    if len({id(group.material) for group in terms.groups}) < 2:
        return
    volume, *integrals = _harmonics(terms)
    for what, values in zip(("density", *["stiffness"] * 3), integrals, strict=True):
        deviation = np.abs(values[1:] / values[0] - volume[1:] / volume[0])
        n = int(np.argmax(deviation))
        if deviation[n] > UNEVEN:
            raise ModelError(
                f"the {what} of the body is not spread evenly {terms.motion.alike[1]} (harmonic {n + 1} is "
                f"{deviation[n]:.1%}): shape, density and stiffness must be alike wherever material moves to"
            )


def _harmonics(terms: MotionMatrices) -> NDArray[np.complex128]:
    """Return the integrals (5, 13) of 1, density and measures of C times r² e^{i n φ}, n = 0 … 12."""
    integrals = np.zeros((5, HARMONICS + 1), dtype=complex)
    for group in terms.groups:
        C = group.material.C
        bulk, trace = C[:3, :3].sum(), np.trace(C)
        every = trace if terms.motion.A.any() else (C * np.arange(36, 72).reshape(6, 6)).sum()
        measures = np.array([1.0, group.material.density, bulk, trace, every])
        for chunk in group.chunks():
            element = group.at(terms.points, chunk)
            r, wave = terms.motion.phase(element.gauss_points(), terms.moving_points)
            powers = [((element.dV * r * r) * wave**n).sum() for n in range(HARMONICS + 1)]
            integrals += measures[:, None] * powers
    return integrals
