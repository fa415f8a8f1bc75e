"""Central differences (velocity Verlet) with lumped mass.

Source: Newmark, J. Eng. Mech. Div. ASCE 85 (1959) 67-94; Belytschko, Liu & Moran, Nonlinear Finite Elements
(2000), chapter 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.integrators.base import ModelIntegrator
from kratos_lite.analysis.prescribed_motion import Kinematics
from kratos_lite.assembly.finite_strain import highest_frequency
from kratos_lite.errors import ModelError


@dataclass(frozen=True)
class CentralDifference(ModelIntegrator):
    """Central differences with lumped mass: explicit, order 2, stable for steps below 2/ω.

    It takes neither a motion of the material nor constraints, springs or added masses.
    """

    name = "central_difference"
    lumps_mass = True

    def check(self, e: EquationsOfMotion) -> None:
        """Refuse what it does not take; see `ModelIntegrator.check`.

        Raises
        ------
        ModelError
            The model has a motion of its material, constraints, springs or added masses.
        """
        if e.terms is not None:
            raise ModelError("central differences do not take a motion of the material; use Newmark()")
        if len(e.model.supports.constraints):
            raise ModelError("central differences do not take constraints; use Newmark()")
        if e.model.attached:
            raise ModelError("central differences do not take springs nor added masses; use Newmark()")

    def critical_step(self, e: EquationsOfMotion) -> float:
        """Return 2/ω (√(1 + ξ²) - ξ) in s, ω of a bound for the elements, ξ the damping ratio of β."""
        omega = highest_frequency(e.system.points, e.system.groups, lumped=True)
        xi = e.rayleigh[1] * omega / 2
        return float(2 / omega * (np.sqrt(1 + xi * xi) - xi))

    def step(self, e: EquationsOfMotion, now: Kinematics, start: float, h: float) -> Kinematics:
        """Take a step; α M damps the velocity at its end, β K that half a step before."""
        (u, v, a), constrained = now, e.constrained
        half = v + h / 2 * a
        u = u + h * half
        prescribed = e.prescribed.at_end(start + h, h)
        u[constrained] = prescribed[0][constrained]
        force = e.load(start + h) - e.times_damping(half, start) - e.times_stiffness(u, start + h)
        a = e.mass.solve(force) / (1 + e.rayleigh[0] * h / 2)  # v = half + h/2 a
        a[constrained] = prescribed[2][constrained]
        v = half + h / 2 * a
        v[constrained] = prescribed[1][constrained]
        return u, v, a
