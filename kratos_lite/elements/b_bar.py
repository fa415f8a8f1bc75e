"""BBar: elements whose dilatation is projected, so that they take ν → ½."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from kratos_lite import voigt
from kratos_lite.elements import arguments
from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.elements.tables import StrainTables
from kratos_lite.quadrature import Rule
from kratos_lite.shapes.inverse import cofactors, determinant
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class BBar(KinematicLinear):
    """A small-strain element with a projected dilatation.

    Notes
    -----
    The dilatation mᵀ B u is replaced by its projection Π on polynomials in x, y, z of each element, by the
    element's own rule:

        B̄ = B + ⅓ m (Π(mᵀB) - mᵀB),   m = (1, 1, 1, 0, 0, 0).

    A subclass states `shape`, `rule` and the `dilatation`, the degree of the polynomials: 0 for the mean over
    the element, 1 for a linear one.  Neighbors have dilatations of their own.  Where displacements of other
    dilatations alone would have no energy, `kept` is the fraction of mᵀB - Π(mᵀB) that stays.

    Source: Hughes, IJNME 15 (1980) 1413; for linear ones Boffi & Gastaldi, M3AS 12 (2002) 1577:
    polynomials in x, y, z, not in ξ, keep the order on distorted cells.
    """

    formulation = "b_bar"
    dilatation: ClassVar[int] = 0

    @classmethod
    def strain_tables(cls, rule: Rule, C: Array) -> StrainTables:
        """Return the polynomials of the dilatation for kernels; see `KinematicLinear.strain_tables`."""
        center = cls._center()
        functions = np.zeros((len(rule), len(cls.nodes) if cls.dilatation else 0))
        if cls.dilatation:
            functions += cls.N(rule.points) - cls.N(center)
        fraction = 1 - float(cls(cls.nodes, rule).kept(C))
        return StrainTables(cls.dN(center), functions, None, fraction)

    def B(self, xi: ArrayLike, C: ArrayLike | None = None) -> Array:
        """Return B̄ at points; see `KinematicLinear.B`."""
        B, points = super().B(xi), arguments.points(xi)
        gradients = np.swapaxes(self._gauss[1], -1, -2)  # (..., g, n, 3), the rows mᵀB
        rows = gradients.reshape(*gradients.shape[:-2], -1)
        projected = self._projected(points.reshape(-1, 3), rows).reshape(*B.shape[:-2], -1)
        fraction = 1 - self.kept(C)
        fraction = fraction.reshape(fraction.shape + (1,) * points.ndim)
        B[..., :3, :] += (fraction * (projected - _trace(B)) / 3)[..., None, :]
        return B

    def _strain_at(self, xi: Array, u: Array, C: ArrayLike | None) -> Array:
        """Return the strain (..., g, 6) at points (g, 3), from div u and its projection."""
        if type(self).B is not BBar.B:
            return super()._strain_at(xi, u, C)
        rows = np.swapaxes(u, -1, -2)[..., None, :, :]
        strain = voigt.symmetric_gradient(rows @ self.dNdX(xi))
        dilatation = (rows * self._gauss[1]).sum(axis=(-2, -1))[..., None]
        change = self._projected(xi, dilatation) - strain[..., :3].sum(axis=-1, keepdims=True)
        strain[..., :3] += (1 - self.kept(C))[..., None, None] * change / 3
        return strain

    def kept(self, C: ArrayLike | None) -> Array:
        """Return the fraction (...) of the dilatation beyond its projection that stays in the strain."""
        return np.zeros(())

    def _projected(self, xi: Array, values: Array) -> Array:
        """Return Π of values (..., g', k) at Gauss points as (..., g, k) at points (g, 3)."""
        P = self._polynomials(self.rule.points)
        weighted = np.swapaxes(P * self.dV[..., None], -1, -2)
        return self._polynomials(xi) @ np.linalg.solve(weighted @ P, weighted @ values)

    @classmethod
    def _center(cls) -> Array:
        return cls.shape.nodes[: cls.shape.corners].mean(axis=0)

    def _polynomials(self, xi: Array) -> Array:
        """Return 1, or 1 and coordinates that are linear in x, y, z, (..., g, 1 or 4) at points (g, 3)."""
        one = np.ones((*self.X.shape[:-2], len(xi), 1))
        if not self.dilatation:
            return one
        center = self._center()[None]
        J0 = self._jacobian(self.dN(center))
        base = (cofactors(J0) / determinant(J0)[..., None, None])[..., 0, :, :]
        away = self.N(xi) @ self.X - self.N(center) @ self.X
        return np.concatenate([one, away @ np.swapaxes(base, -1, -2)], axis=-1)


def _trace(B: Array) -> Array:
    """Return the rows mᵀB (..., 3n) of B (..., 6, 3n)."""
    return B[..., :3, :].sum(axis=-2)
