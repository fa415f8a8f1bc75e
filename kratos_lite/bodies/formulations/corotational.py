"""Corotational: one rotation for the whole body, small strains seen from it; Modal: its lowest modes only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly import finite_strain
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.bodies.formulations.base import Formulation
from kratos_lite.bodies.linear_algebra import Solve
from kratos_lite.bodies.rotations import polar
from kratos_lite.errors import InputError
from kratos_lite.solvers import plan
from kratos_lite.solvers.eigen import modes as natural_modes
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


class Modal(Corotational):
    """The co-rotational formulation with the lowest modes of the free body, the six rigid ones among them."""

    name = "modal"
    aliases = ("BC-MODAL",)

    def __init__(
        self, points: Array, groups: Sequence[ElementGroup], mass: Mass, modes: int | None = None
    ) -> None:
        super().__init__(points, groups, mass)
        count = 12 if modes is None else modes
        if isinstance(count, bool) or not isinstance(count, (int, np.integer)):
            raise InputError(f"modes must be a whole number; got {count!r}")
        if count < 6:
            raise InputError(f"modes must be at least 6, for the rigid motions are modes too; got {count}")
        self._Z = points - mass.nodal @ points / mass.nodal.sum()  # momenta are about the mass center
        self.omega, self.shapes = natural_modes(self.K0.scipy().tocsr(), mass.matrix(), count)
        self._squares = np.where(np.arange(count) < 6, 0.0, self.omega**2)
        self._dual = np.ascontiguousarray(np.stack([mass.times(shape) for shape in self.shapes.T]))

    def _apply(self, d: Array) -> Array:
        """Return M E Λ E^T M d: the stiffness of the modes."""
        return np.asarray((self._squares * (self._dual @ d)) @ self._dual)

    def mass_solver(self, q: Array) -> Solve:
        """Return what solves M x = b among the modes; see `Formulation.mass_solver`."""
        return self.solver(q, 0.0)

    def _inverse(self, c: float) -> Solve:
        scale = 1 + c * self._squares

        def solve(b: Array) -> Array:
            coordinates = self.shapes.T @ b
            return np.asarray(self.shapes @ (coordinates.T / scale).T)

        return solve

    def highest_frequency(self, q: Array) -> float:
        """Return the frequency of the highest mode in rad/s."""
        return float(self.omega[-1])

    def project(self, q: Array, u: Array) -> tuple[Array, Array]:
        """Return q and u without what the modes, turned by R(q), do not span; both momenta stay."""
        R, v = self._seen(q, u)
        d = self.local(q, R).ravel()
        before = self._spin(d, v)
        d, v = self.shapes @ (self._dual @ d), self.shapes @ (self._dual @ v)
        x, Z = self._Z + d.reshape(-1, 3), self._Z
        product = x.T @ self.mass.times(Z).reshape(-1, 3)
        inertia = np.trace(product) * np.eye(3) - product.T
        lost = np.linalg.solve(inertia, before - self._spin(d, v))  # what modes of another rotation lack
        v = v.reshape(-1, 3) + np.cross(lost, Z)
        return (x @ R.T - Z).ravel(), np.asarray(v @ R.T).ravel()

    def _spin(self, d: Array, v: Array) -> Array:
        """Return the angular momentum (3,) about the mass center, seen from the body."""
        return np.asarray(np.cross(self._Z + d.reshape(-1, 3), self.mass.times(v).reshape(-1, 3)).sum(axis=0))
