"""TotalLagrangian: large strains and rotations at every Gauss point."""

from __future__ import annotations

from collections.abc import Sequence

from kratos_lite.assembly import finite_strain
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.bodies.formulations.base import Formulation
from kratos_lite.bodies.linear_algebra import Solve
from kratos_lite.solvers.mass import Mass
from kratos_lite.typing import Array


class TotalLagrangian(Formulation):
    """Green's strain and Saint Venant–Kirchhoff's law at every Gauss point."""

    name = "total_lagrangian"
    aliases = ("TL",)
    unnamed = "standard"

    def __init__(
        self, points: Array, groups: Sequence[ElementGroup], mass: Mass, modes: int | None = None
    ) -> None:
        super().__init__(points, groups, mass, modes)
        finite_strain.check_elements(groups)

    def load(self, q: Array) -> Array:
        """Return Σ F S grad N dV, (3n,) in N."""
        return finite_strain.internal_load(self.points, self.groups, q.reshape(-1, 3)).ravel()

    def energy(self, q: Array) -> float:
        """Return ∫ ½ E : C : E dV in J."""
        return finite_strain.strain_energy(self.points, self.groups, q.reshape(-1, 3))

    def stiffness(self, q: Array) -> BlockMatrix:
        """Return the tangent (3n, 3n) in N/m."""
        return finite_strain.stiffness(self.points, self.groups, self.pattern, q.reshape(-1, 3))

    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c K(q)) x = b."""
        return self._factorized(self.stiffness(q), c, iterate=self.is_large)

    def load_over(self, q: Array, dq: Array, damping: float) -> Array:
        """Return the load of the energy–momentum method; see `Formulation`."""
        q, dq = q.reshape(-1, 3), dq.reshape(-1, 3)
        return finite_strain.internal_load(self.points, self.groups, q, dq, damping).ravel()

    def increment_solver(self, q: Array, dq: Array, damping: float, c: float) -> Solve:
        """Return the solver of the energy–momentum method; see `Formulation`."""
        if self.is_large:  # its symmetric part will do: that of the tangent at the middle
            return self.solver(q + dq / 2, c / 2 * (1 + 2 * damping))
        q, dq = q.reshape(-1, 3), dq.reshape(-1, 3)
        D = finite_strain.stiffness(self.points, self.groups, self.pattern, q, dq, damping)
        return self._factorized(D, c, symmetric=False)

    def highest_frequency(self, q: Array) -> float:
        """Return the bound of the tangent at q; see `Formulation`."""
        q = q.reshape(-1, 3)
        return finite_strain.highest_frequency(self.points, self.groups, q, lumped=self.mass.lumped)
