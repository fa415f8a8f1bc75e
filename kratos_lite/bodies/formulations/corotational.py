"""Corotational: one rotation for the whole body, and small strains seen from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly import finite_strain
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.bodies.formulations.base import Formulation
from kratos_lite.bodies.linear_algebra import Solve
from kratos_lite.bodies.rotations import polar
from kratos_lite.solvers import plan
from kratos_lite.solvers.mass import Mass
from kratos_lite.typing import Array


class Corotational(Formulation):
    """Small strains seen from one rotation R of the body, that of its mean deformation gradient."""

    # f = R K0 R^T d, d = (Z + q) - R Z, Z = X less a point amid the body; K0 and factors of M + c K0 stay.

    name = "corotational"
    aliases = ("BC",)
    without = ("energy_momentum",)

    def __init__(
        self, points: Array, groups: Sequence[ElementGroup], mass: Mass, modes: int | None = None
    ) -> None:
        super().__init__(points, groups, mass, modes)
        gradients, volume = finite_strain.nodal_gradients(points, groups)
        self._gradients = np.ascontiguousarray(gradients.T / volume)
        self._Z = points - points.mean(axis=0)
        self._solver: tuple[float, Solve] | None = None
        self._turned = np.full(points.size, np.nan), np.eye(3)

    def rotation(self, q: Array) -> Array:
        """Return R (3, 3), the polar rotation of the mean deformation gradient."""
        if not np.array_equal(q, self._turned[0]):  # a step asks several times for the same one
            self._turned = q.copy(), polar(np.eye(3) + (self._gradients @ q.reshape(-1, 3)).T)
        return self._turned[1]

    def local(self, q: Array, R: Array) -> Array:
        """Return R^T d (n, 3) in m: the displacement that strains the body, seen from it."""
        return np.asarray(q.reshape(-1, 3) @ R + self._Z @ R - self._Z)

    def _seen(self, q: Array, v: Array) -> tuple[Array, Array]:
        R = self.rotation(q)
        return R, (v.reshape(-1, 3) @ R).ravel()

    def load(self, q: Array) -> Array:
        """Return R K0 R^T d, (3n,) in N."""
        R = self.rotation(q)
        f = self._apply(self.local(q, R).ravel())
        return np.asarray(f.reshape(-1, 3) @ R.T).ravel()

    def _apply(self, d: Array) -> Array:
        """Return K0 d of a displacement seen from the body."""
        return self.K0 @ d

    def energy(self, q: Array) -> float:
        """Return ½ d^T R K0 R^T d in J."""
        d = self.local(q, self.rotation(q)).ravel()
        return float(d @ self._apply(d)) / 2

    def stiffness(self, q: Array) -> BlockMatrix:
        """Return R K0 R^T (3n, 3n) in N/m."""
        R = self.rotation(q)
        return BlockMatrix(R @ self.K0.data @ R.T, self.K0.indices, self.K0.indptr)

    def damping_load(self, q: Array, u: Array) -> Array:
        """Return R K0 R^T u, (3n,)."""
        R, v = self._seen(q, u)
        return np.asarray(self._apply(v).reshape(-1, 3) @ R.T).ravel()

    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c R K0 R^T) x = b: R A0^-1 R^T with factors of A0 made once for each c."""
        if self._solver is None or self._solver[0] != c:
            self._solver = c, self._inverse(c)
        solve, R = self._solver[1], self.rotation(q)

        def rotated(b: Array) -> Array:
            columns = b.reshape(len(self._Z), 3, -1)
            seen = np.einsum("nik,ij->njk", columns, R).reshape(b.shape)
            x = solve(seen).reshape(columns.shape)
            return np.asarray(np.einsum("njk,ij->nik", x, R).reshape(b.shape))

        return rotated

    def _inverse(self, c: float) -> Solve:
        return self._factorized(self.K0, c, iterate=self.points.size > plan.REPEATED_LIMIT)
