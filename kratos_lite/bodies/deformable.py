"""Deformable: what pseudo-rigid and finite-element bodies share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import ClassVar, TypeAlias

import numpy as np

from kratos_lite.bodies.body import Body
from kratos_lite.model.checks import check_wave_speeds
from kratos_lite.typing import Array

Solve: TypeAlias = Callable[[Array], Array]


class Deformable(Body):
    """A body whose configurations form a linear space: q + h u is one again.

    ``DEF_EXP``: explicit, momenta exact, energy bounded, steps up to `critical_step`.
    ``DEF_LIM``: linearly implicit; linear momentum exact, angular momentum to O(h⁴), not safe for a stiff
    body that spins.  ``ENERGY_MOMENTUM``: implicit; energy and both momenta exact whatever the step.
    """

    jacobian_is_constant = True
    schemes: ClassVar[tuple[str, ...]] = ("ENERGY_MOMENTUM", "DEF_LIM", "DEF_EXP")

    def default_scheme(self) -> str:
        """Return ``ENERGY_MOMENTUM``."""
        return "ENERGY_MOMENTUM"

    def warnings(self) -> list[str]:
        """Return materials whose waves are so slow or quick that their units may be wrong."""
        given = self.material
        materials = given.values() if isinstance(given, Mapping) else [] if given is None else [given]
        return check_wave_speeds(materials)

    @abstractmethod
    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c K(q)) x = b, with the tangent K of the internal load."""

    @abstractmethod
    def highest_frequency(self) -> float:
        """Return an upper bound of the angular frequencies at the configuration, in rad/s."""

    def critical_step(self) -> float:
        """Return the largest step in s with which ``DEF_EXP`` is stable: 2/ω, and less with damping.

        The damping force is that of the old velocity, so that h²ω²/2 + h η ω² must not exceed 2.
        """
        h = 2.0 / self.highest_frequency()
        return float(h * h / (np.hypot(h, self.damping) + self.damping))
