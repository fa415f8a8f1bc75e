"""Deformable: what pseudo-rigid and finite-element bodies share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from kratos_lite.bodies.body import Body
from kratos_lite.bodies.linear_algebra import Solve
from kratos_lite.model.checks import check_wave_speeds
from kratos_lite.typing import Array


class Deformable(Body):
    """A body whose configurations form a linear space: q + h u is one again.

    Its integrators are ``"explicit"``: momenta exact, energy bounded, steps up to `critical_step`;
    ``"linearly_implicit"``: linear momentum exact, angular momentum to O(h⁴), not safe for stiff spinning
    bodies; ``"energy_momentum"``: implicit, energy and both momenta exact whatever the step.  Solfec's
    DEF_EXP and DEF_LIM, and ENERGY_MOMENTUM, are aliases.
    """

    jacobian_is_constant = True
    integrators: ClassVar[Mapping[str, str]] = {
        "energy_momentum": "ENERGY_MOMENTUM",
        "linearly_implicit": "DEF_LIM",
        "explicit": "DEF_EXP",
    }

    def warnings(self) -> list[str]:
        """Return materials whose waves are so slow or quick that their units may be wrong."""
        given = self.material
        materials = given.values() if isinstance(given, Mapping) else [] if given is None else [given]
        return check_wave_speeds(materials)

    @abstractmethod
    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c K(q)) x = b, with the tangent K of the internal force vector.

        Parameters
        ----------
        q : configuration.
        c : s².

        Returns
        -------
        function of columns b (dofs, k) or (dofs,) that returns x.
        """

    @abstractmethod
    def extent(self) -> float:
        """Return the size of what displacements are added to: coordinates in m, or the 1 of F."""

    @abstractmethod
    def highest_frequency(self) -> float:
        """Return an upper bound of the angular frequencies in rad/s at the configuration."""

    def critical_step(self) -> float:
        """Return the longest stable step in s of the explicit integrator: h²ω²/2 + h η ω² ≤ 2."""
        h = 2.0 / self.highest_frequency()
        return float(h * h / (np.hypot(h, self.damping) + self.damping))
