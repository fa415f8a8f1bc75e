"""Modal: the co-rotational formulation with the lowest modes only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.bodies.formulations.corotational import Corotational
from kratos_lite.bodies.linear_algebra import Solve
from kratos_lite.errors import InputError
from kratos_lite.solvers.eigen import modes as natural_modes
from kratos_lite.solvers.mass import Mass
from kratos_lite.typing import Array


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
