"""Yield surfaces in tr σ, √J₂ and Lode's angle, with their derivatives, also of complex stress."""

# Source: Nayak & Zienkiewicz, J. Struct. Div. ASCE 98 (1972) 949, and the yield surfaces and plastic
# potentials of KratosConstitutiveLawsApplication.

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import cos, pi, radians, sin, tan
from typing import NamedTuple

import numpy as np

from kratos_lite import voigt
from kratos_lite.typing import Array

CORNER = 0.95
"""|sin 3θ| from which on a hexagon is a circle through its corner."""
ROUNDING = 1e-12
"""√J₂ in parts of the trace that is rounding: no direction."""
TIE = 1e-12
"""1 - |sin 3θ| of principal stresses that are equal."""


class Surface(NamedTuple):
    """An equivalent stress: mean tr σ + √J₂ (cosine cos θ - sine sin θ), with θ = ±30° if round."""

    mean: float
    cosine: float
    sine: float = 0.0
    is_round: bool = False

    @property
    def of_tension(self) -> float:
        """The equivalent stress of a bar under a tension of 1."""
        return self.mean + self.cosine / 2 + self.sine / 12**0.5


def _cone(angle: float, ratio: float) -> Surface:
    s = sin(radians(angle))
    return Surface(2 * s / (3 - 3 * s), (6 - 2 * s) / (3 - 3 * s), is_round=True)


def _pyramid(angle: float, ratio: float) -> Surface:
    s, t = sin(radians(angle)), tan(radians(45 + angle / 2))
    half, other, scale = (1 + ratio / t**2) / 2, (1 - ratio / t**2) / 2, 2 * t / cos(radians(angle))
    slope = scale * (half * s - other)
    return Surface(slope / 3, scale * (half - other * s), slope / 3**0.5)


SURFACES: dict[str, Callable[[float, float], Surface]] = {
    "VonMises": lambda angle, ratio: Surface(0.0, 2.0, is_round=True),
    "DruckerPrager": _cone,
    "Tresca": lambda angle, ratio: Surface(0.0, 2.0),
    "ModifiedMohrCoulomb": _pyramid,
}
"""Surfaces by their names in Kratos, of an angle in degrees and the ratio of compression to tension."""
WITH_ANGLE = {"DruckerPrager", "ModifiedMohrCoulomb"}


class Invariants:
    """Invariants of stresses (..., 6) and what their derivatives need."""

    def __init__(self, stress: Array) -> None:
        self.stress = stress
        self.trace = stress[..., :3].sum(axis=-1)
        self.s = stress - self.trace[..., None] / 3 * voigt.UNIT
        J2 = self.s**2 @ voigt.SHEAR_TWICE / 2
        self.some = np.abs(J2) > np.abs(ROUNDING * self.trace) ** 2
        self.root = np.sqrt(np.where(self.some, J2, 1))

    @cached_property
    def sine3(self) -> Array:
        """Sine of three times Lode's angle, -1 in tension and 1 in compression."""
        return np.where(self.some, -1.5 * 3**0.5 * voigt.determinant(self.s) / self.root**3, 0.0)

    def equivalent(self, surface: Surface, own: bool = True) -> tuple[Array, Array]:
        """Return an equivalent stress (...) and its derivative by the stress (..., 6).

        The circle of a potential, not `own`, goes through the corners of compression, as in Kratos.
        """
        if surface.is_round:
            value = by_root = np.array(surface.cosine * 3**0.5 / 2)
        else:
            is_round = np.abs(self.sine3.real) > CORNER
            sine3 = np.where(is_round, 0.0, self.sine3)
            corner = pi / 6 * np.where(own, np.sign(self.sine3.real), 1.0)
            angle = np.where(is_round, corner, np.arcsin(sine3) / 3)
            value = surface.cosine * np.cos(angle) - surface.sine * np.sin(angle)
            turn = np.where(is_round, 0.0, -surface.cosine * np.sin(angle) - surface.sine * np.cos(angle))
            turn = turn / np.sqrt(1 - sine3**2)
            by_root = value - turn * sine3
        gradient = (np.where(self.some, by_root, 0.0) / (2 * self.root))[..., None] * self.s
        if not surface.is_round:
            square = voigt.cofactor(self.s) / self.root[..., None] ** 2 + voigt.UNIT / 3  # ∂J₃/∂σ / J₂
            gradient = gradient - (3**0.5 / 2 * turn * self.some)[..., None] * square
        q = surface.mean * self.trace + np.where(self.some, self.root, 0.0) * value
        return q, gradient * voigt.SHEAR_TWICE + surface.mean * voigt.UNIT

    def tension(self) -> Array:
        """Return the part of tension in the sum of the absolute principal stresses."""
        is_tie = np.abs(self.sine3.real) > 1 - TIE
        sine3 = np.where(is_tie, 0.0, self.sine3)
        angle = np.where(is_tie, pi / 6 * np.sign(self.sine3.real), np.arcsin(sine3) / 3)
        parts = np.sin(angle[..., None] + np.array([2, 0, -2]) * pi / 3)
        root = np.where(self.some, self.root, 0.0)[..., None]
        principal = self.trace[..., None] / 3 + 2 / 3**0.5 * root * parts
        pulls = np.where(principal.real > 0, principal, 0.0).sum(axis=-1)
        total = np.where(principal.real > 0, principal, -principal).sum(axis=-1)
        return pulls / np.where(np.abs(total) > 0, total, 1.0)
