"""Deformable: what pseudo-rigid and finite-element bodies share: forces of deformation, and their tangent."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from kratos_lite.bodies.body import Body

Array = NDArray[np.float64]
Solve: TypeAlias = Callable[[Array], Array]


class Deformable(Body):
    """A body whose configurations form a linear space: q + h u is one again.

    `DEF_EXP`: explicit, momenta exact, energy bounded, steps up to `critical_step`.
    `DEF_LIM`: linearly implicit; linear momentum exact, angular momentum to O(h⁴), not safe for a stiff
    body that spins.  `ENERGY_MOMENTUM`: implicit; energy and both momenta exact whatever the step.
    """

    schemes: ClassVar[tuple[str, ...]] = ("ENERGY_MOMENTUM", "DEF_LIM", "DEF_EXP")

    def default_scheme(self) -> str:
        """Return ``ENERGY_MOMENTUM``."""
        return "ENERGY_MOMENTUM"

    @abstractmethod
    def load_over(self, q: Array, dq: Array, damping: float) -> Array:
        """Return the internal load over an increment dq, whose work is the change of internal energy.

        `damping` is the ratio η/h, which adds the viscous stress.
        """

    @abstractmethod
    def damping_load(self, q: Array, u: Array) -> Array:
        """Return K(q) u, the viscous load for η = 1."""

    @abstractmethod
    def mass_solver(self) -> Solve:
        """Return what solves M x = b."""

    @abstractmethod
    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c K(q)) x = b."""

    @abstractmethod
    def increment_solver(self, q: Array, dq: Array, damping: float, c: float) -> Solve:
        """Return what solves (M + c D) x = b, D the derivative of `load_over` with respect to dq."""

    @abstractmethod
    def highest_frequency(self) -> float:
        """Return an upper bound of the angular frequencies at the configuration, in rad/s."""

    def critical_step(self) -> float:
        """Return the largest step in s with which ``DEF_EXP`` is stable: 2/ω of `highest_frequency`."""
        return 2.0 / self.highest_frequency()
