"""CellMass: volume, body forces and mass of placed cells."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from kratos_lite.elements import arguments
from kratos_lite.elements.exact_rules import (
    AFFINE,
    CURVED,
    STRAIGHT,
    Geometries,
    exact_rule,
    geometries,
    has_rules,
)
from kratos_lite.elements.geometry import PlacedCell
from kratos_lite.elements.tables import lumped
from kratos_lite.errors import InputError
from kratos_lite.quadrature import Rule
from kratos_lite.typing import Array, Mask

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class CellMass(PlacedCell):
    """Volume, body forces and mass of a cell, by rules that are exact for its shape and geometry."""

    mass_rule: ClassVar[Rule | None] = None

    @classmethod
    def mass_rules(cls, geometry_of: Geometries, factors: int, flow: bool = False) -> list[tuple[Mask, Rule]]:
        """Return masks (...) of cells and the rules for products of shape functions over them."""
        stated = cls.mass_rule if factors == 2 and not flow else None
        if stated is None and not has_rules(cls.shape):
            stated = cls.rule
        if stated is not None:
            return [(np.ones(geometry_of.shape, dtype=bool), stated)]
        rules: dict[Rule, Mask] = {}
        for geometry in (AFFINE, STRAIGHT, CURVED):
            mask = np.asarray(geometry_of == geometry)
            if mask.any() or (geometry == AFFINE and not geometry_of.size):
                rule = exact_rule(cls.shape, factors, geometry, flow)
                rules[rule] = rules[rule] | mask if rule in rules else mask
        return [(mask, rule) for rule, mask in rules.items()]

    def _integrate(self, of: Callable[[Array, Array], Array], factors: int) -> Array:
        """Return integrals of products of `factors` functions, made of N (g, n) and γ det J (..., g)."""
        total: Array | None = None
        for mask, rule in self.mass_rules(geometries(self.shape, self.X), factors):
            values = of(self._N(rule), self._volumes(rule))
            if total is not None:
                values[~mask] = total[~mask]
            total = values
        assert total is not None
        return total

    def volume(self) -> Array:
        """Return the volume (...) in m³, exact for every geometry of the cell."""
        return self._integrate(lambda N, dV: dV.sum(axis=-1), factors=0)

    def body_force(self, b: ArrayLike) -> Array:
        """Return r_ext = ∫ N b dV (..., n, 3) in N, exact, of b (3,), (..., 3) or nodal in N/m³."""
        force = arguments.real(b, "a body force b", (3,), "give its x, y and z in N/m³")
        if force.ndim == self.X.ndim and force.shape[-2:] == self.nodes.shape:
            return self.scalar_mass() @ arguments.nodal(force, self.X, "a body force b")
        if force.shape[:-1] not in ((), self.X.shape[:-2]):
            raise InputError(
                f"a body force b must have shape (3,), {(*self.X.shape[:-2], 3)} or {self.X.shape}; "
                f"got {force.shape}"
            )
        volumes = self._integrate(lambda N, dV: dV @ N, factors=1)
        return volumes[..., :, None] * force[..., None, :]

    def scalar_mass(self, density: ArrayLike = 1.0) -> Array:
        """Return ∫ ρ N N^T dV (..., n, n) in kg, exact but for a stated `mass_rule`; ρ in kg/m³."""
        rho = arguments.density(density, self.X)
        m = self._integrate(lambda N, dV: (N.T * dV[..., None, :]) @ N, factors=2)
        return m * rho[..., None, None]

    def mass(self, density: ArrayLike) -> Array:
        """Return the consistent mass matrix (..., 3n, 3n) in kg of one density or (...) in kg/m³."""
        m = self.scalar_mass(density)
        n = len(self.nodes)
        M = m[..., :, None, :, None] * np.eye(3)[:, None, :]
        return M.reshape(*m.shape[:-2], 3 * n, 3 * n)

    def lumped_mass(self, density: ArrayLike) -> Array:
        """Return the mass (..., n) in kg of each node, positive: row sums, or the scaled diagonal."""
        # Source: Hinton, Rock & Zienkiewicz, Earthq. Eng. Struct. Dyn. 4 (1976) 245-249.
        m = self.scalar_mass(density)
        _, reference = self.mass_rules(geometries(self.shape, self.nodes), factors=2)[0]
        return lumped(m.sum(axis=-1), np.diagonal(m, axis1=-2, axis2=-1), self.shape, reference)
