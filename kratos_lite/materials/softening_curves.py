"""Yield stresses over the fraction κ of the fracture energy that is dissipated: HARDENING_CURVE of Kratos."""

# Source: Oller, Nonlinear Dynamics of Structures (2014), and GenericConstitutiveLawIntegratorPlasticity of
# KratosConstitutiveLawsApplication, which has the same curves.

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kratos_lite.errors import MaterialError
from kratos_lite.typing import Array

LINEAR, EXPONENTIAL, PEAKED, PERFECT, POLYNOMIAL, LINEAR_EXPONENTIAL, POINTS = range(7)
"""HARDENING_CURVE of Kratos."""
UNTIL = {LINEAR: 0.99, LINEAR_EXPONENTIAL: 0.9}
"""κ up to which softening is linear, unless a law says another."""


def linear(law: Any, kappa: Array, energy: Array, p: Array) -> tuple[Array, Array]:
    """Return a yield stress that falls linearly with the strain, from some κ on exponentially."""
    end = law.linear_until or UNTIL[int(law.curve)]
    rate = 1.0 if law.curve == LINEAR else 2 / (1 + end)
    left = np.where(kappa.real <= end, np.sqrt(1 - rate * np.where(kappa.real <= end, kappa, 0)), 1)
    last = law.strength * (1 - rate * end) ** 0.5 / (1 - end)
    stress = np.where(kappa.real <= end, law.strength * left, last * (1 - kappa))
    return stress, np.where(kappa.real <= end, -rate / 2 * law.strength / left, -last)


def exponential(law: Any, kappa: Array, energy: Array, p: Array) -> tuple[Array, Array]:
    """Return a yield stress that falls exponentially with the strain."""
    return law.strength * (1 - kappa), np.full_like(kappa, -law.strength)


def peaked(law: Any, kappa: Array, energy: Array, p: Array) -> tuple[Array, Array]:
    """Return a yield stress that grows to its peak and falls exponentially."""
    ro = (1 - law.strength / law.peak) ** 0.5
    b = (3 - ro) * (1 + ro)
    a = ((1 - (1 - ro) ** 2) / (b * law.peak_at)) ** (1 / (1 - law.peak_at))
    rise = b * a ** (1 - kappa)
    root = np.sqrt((1 - ro) ** 2 + kappa * rise)
    return law.peak * (2 * root - root**2), law.peak * (1 / root - 1) * rise * (1 - np.log(a) * kappa)


def perfect(law: Any, kappa: Array, energy: Array, p: Array) -> tuple[Array, Array]:
    """Return the yield stress that stays."""
    return np.full_like(kappa, law.strength), np.zeros_like(kappa)


def polynomial(law: Any, kappa: Array, energy: Array, p: Array) -> tuple[Array, Array]:
    """Return a polynomial of the plastic strain p, then a constant, then a fall."""
    S, (end, last) = np.polynomial.Polynomial(law.stresses), law.strains
    top, used = S(end), S.integ()(end)
    used = used + top * (last - end)
    rest = _rest(law, energy, used)
    fallen = kappa.real > used / energy
    beta = 1.5 * top / rest
    a = np.sqrt(1 + np.where(fallen, (kappa - used / energy) * 2 * beta * energy / top, 0))
    growing = ~fallen & (p.real < end)
    stress = np.where(growing, S(np.where(growing, p, 0)), top * a * (2 - a))
    slope = np.where(growing, S.deriv()(np.where(growing, p, 0)) * energy / stress, 0)
    return stress, np.where(fallen, 2 * beta * energy * (1 / a - 1), slope)


def points(law: Any, kappa: Array, energy: Array, p: Array) -> tuple[Array, Array]:
    """Return a yield stress through points over the plastic strain, then an exponential fall."""
    p, s = np.array(law.strains), np.array(law.stresses)
    works = np.append(0.0, np.cumsum(np.diff(p) * (s[1:] + s[:-1]) / 2))  # in J/m³
    _rest(law, energy, works[-1])
    i = np.searchsorted(works[1:-1], kappa.real * energy, side="right")
    slope = (np.diff(s**2) / np.diff(works))[i] * energy  # of the square, which is linear in the work
    square = s[i] ** 2 + slope * (kappa - works[i] / energy)
    last = s[-1] / (1 - works[-1] / energy)
    before = kappa.real < works[-1] / energy
    stress = np.where(before, np.sqrt(np.where(before, square, 1)), last * (1 - kappa))
    return stress, np.where(before, slope / 2 / stress, -last)


def _rest(law: Any, energy: Array, used: float) -> Array:
    """Return the energy in J/m³ that a fall has left."""
    rest = energy - used
    if not (np.isfinite(energy) & (rest > 0)).all():
        least = f"{used:.3g} J/m³ times its radius" if np.isfinite(energy).all() else "0"
        raise MaterialError(
            f"{type(law).__name__} with HARDENING_CURVE {law.curve:g} needs an element_radius > 0 and a "
            f"fracture energy beyond {least}"
        )
    return rest


CURVES: dict[int, Callable[[Any, Array, Array, Array], tuple[Array, Array]]] = dict(
    enumerate((linear, exponential, peaked, perfect, polynomial, linear, points))
)
"""HARDENING_CURVE → the yield stress in Pa and its slope over κ, of a law, κ, g in J/m³ and p, (...)."""
