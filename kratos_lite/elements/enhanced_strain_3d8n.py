"""EnhancedStrain3D8N: eight-node hexahedron with 21 enhanced strain modes, which does not lock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.elements import arguments
from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.elements.tables import StrainTables, strain_rows
from kratos_lite.errors import InputError, MaterialError
from kratos_lite.quadrature import Rule, hexahedron
from kratos_lite.registry import remembered
from kratos_lite.shapes.hexahedra import Hexahedron8
from kratos_lite.shapes.inverse import cofactors, determinant
from kratos_lite.typing import Array
from kratos_lite.voigt import PAIRS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

MONOMIALS = ((0,), (1,), (2,), (0, 1), (1, 2), (2, 0))
"""The factors of ξ, η, ζ, ξη, ηζ, ζξ; their integrals over the cube are 0."""
MODES = [
    (component, number)
    for component, (i, j) in enumerate(PAIRS)
    for number, factors in enumerate(MONOMIALS)
    if (i == j and i in factors) or (i != j and sum(axis in (i, j) for axis in factors) == 1)
]
"""Covariant strain component and monomial of each mode: three of each normal strain, four of each shear."""
COMPONENT, MONOMIAL = np.array(MODES).T


class EnhancedStrain3D8N(KinematicLinear):
    """Eight-node hexahedron with 21 enhanced strain modes, 2x2x2 points.

    Notes
    -----
    strain = B u + G α.  The modes G = (j0 / j) T0 M(ξ) are polynomials M of the covariant strains, turned to
    x, y, z by the Jacobian J0 of the center: each normal strain has its own coordinate and the products with
    the two others, each shear its two coordinates and their products with the third.  Their integrals are 0,
    so patches of any cells reproduce constant stress.  Each element finds its α by ∫ G^T σ dV = 0:

        D = ∫ G^T C G dV,   L = ∫ G^T C B dV,   α = -D⁻¹ L u,   K = ∫ B^T C B dV - L^T D⁻¹ L.

    It bends without locking in thin cells of parallelogram sides, and takes ν → ½.  In cells of trapezoidal
    sides it is as stiff in bending as any hexahedron of eight nodes (MacNeal, IJNME 24 (1987) 1793): take
    quadratic elements there.

    Sources: Simo & Rifai, IJNME 29 (1990) 1595; Andelfinger & Ramm, IJNME 36 (1993) 1311.

    Examples
    --------
    >>> from kratos_lite import EnhancedStrain3D8N, Isotropic3D
    >>> element = EnhancedStrain3D8N(0.5 * EnhancedStrain3D8N.nodes)
    >>> element.stiffness(Isotropic3D(E=210e6, nu=0.3).C).shape
    (24, 24)
    """

    shape = Hexahedron8
    rule = hexahedron(degree=3)
    formulation = "enhanced"

    @classmethod
    def strain_tables(cls, rule: Rule, C: Array) -> StrainTables:
        """Return the monomials of the modes for kernels; see `KinematicLinear.strain_tables`."""
        _check_rule(rule)
        if not np.linalg.eigvalsh(C).min() > 0:
            raise _not_definite(cls, C)
        return StrainTables(cls.dN(np.zeros(3)), _monomials(rule.points), C, fraction=0.0)

    def B(self, xi: ArrayLike, C: ArrayLike | None = None) -> Array:
        """Return B - G D⁻¹ L; InputError without C or with few points, MaterialError if C is not definite."""
        B, points = super().B(xi), arguments.points(xi)
        amplitudes = self._amplitudes(C, self._modes(self.rule.points))
        enhanced = self._modes(points.reshape(-1, 3)) @ amplitudes[..., None, :, :]
        return B - enhanced.reshape(*enhanced.shape[:-3], *points.shape[:-1], 6, -1)

    def _modes(self, xi: Array) -> Array:
        """Return G (..., g, 6, 21) at points (g, 3)."""
        J0 = self._jacobian(self.dN(np.zeros((1, 3))))[..., 0, :, :]
        j0 = determinant(J0)[..., None, None]
        base = cofactors(J0) / j0  # rows are the contravariant base vectors of the center
        T = np.empty((*J0.shape[:-2], 6, 6))
        for c, (k, m) in enumerate(PAIRS):
            for row, (i, j) in enumerate(PAIRS):
                product = base[..., k, i] * base[..., m, j]
                T[..., row, c] = product if i == j else product + base[..., k, j] * base[..., m, i]
        scale = j0 / determinant(self._jacobian(self.dN(xi)))[..., None]  # (..., g, 1)
        return (scale * _monomials(xi)[:, MONOMIAL])[..., None, :] * T[..., None, :, COMPONENT]

    def _amplitudes(self, C: ArrayLike | None, G: Array) -> Array:
        """Return D⁻¹ L (..., 21, 24)."""
        if C is None:
            raise InputError(f"the strain of {type(self).__name__} depends on the material; give its C")
        _check_rule(self.rule)
        C = arguments.elasticity(C, self.X)
        CG = (C[..., None, :, :] if C.ndim > 2 else C) @ G * self.dV[..., None, None]
        flat = CG.reshape(*CG.shape[:-3], -1, CG.shape[-1])
        D = np.swapaxes(G.reshape(*G.shape[:-3], -1, G.shape[-1]), -1, -2) @ flat
        B = strain_rows(self._gauss[1])
        L = np.swapaxes(flat, -1, -2) @ B.reshape(*B.shape[:-3], -1, B.shape[-1])
        # modes of thin cells differ in size
        size = np.sqrt(np.einsum("...ii->...i", D).clip(min=0))[..., None]
        try:
            if not (size > 0).all():
                raise np.linalg.LinAlgError
            return np.linalg.solve(D / (size * np.swapaxes(size, -1, -2)), L / size) / size
        except np.linalg.LinAlgError:
            raise _not_definite(type(self), C) from None


def _not_definite(cls: type[EnhancedStrain3D8N], C: Array) -> MaterialError:
    eigenvalues = np.linalg.eigvalsh(C)
    return MaterialError(
        f"{cls.__name__} needs a C that is positive definite; got C with the eigenvalues "
        f"{eigenvalues.min():.3g} … {eigenvalues.max():.3g} Pa"
    )


def _monomials(xi: Array) -> Array:
    """Return ξ, η, ζ, ξη, ηζ, ζξ (g, 6) at points (g, 3)."""
    return np.stack([xi[:, list(factors)].prod(axis=1) for factors in MONOMIALS], axis=1)


@remembered
def _check_rule(rule: Rule) -> None:
    """Raise InputError for a rule that does not tell the modes of a strain apart, or their mean from 0."""
    M = _monomials(rule.points)[:, MONOMIAL]
    seen = [np.linalg.matrix_rank(M[:, COMPONENT == c]) for c in range(6)]
    if seen != [3, 3, 3, 4, 4, 4] or np.abs(rule.weights @ M).max() > 1e-12:
        raise InputError(f"enhanced strains need 2x2x2 points or more; got {rule}; take hexahedron(degree=3)")
