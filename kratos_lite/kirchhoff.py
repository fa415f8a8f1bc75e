"""Saint Venant–Kirchhoff: S = C : E with Green's strain E = (F^T F - 1) / 2, at one or many points.

F (..., 3, 3) is the deformation gradient, C (..., 6, 6) the elasticity matrix of a material in Pa.  An
increment dF leads from F to F + dF; with it stresses are those of the energy–momentum method: the work of P
over dF is the change of strain energy, whatever the size of dF.

Source: Solfec-1.0 theory, bulk materials; Simo & Tarnow, ZAMP 43 (1992) 757-792.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kratos_lite import voigt

Array = NDArray[np.float64]
PLACES = voigt.tensor(range(6)).astype(int)
"""Voigt row of each pair of tensor indices, (3, 3)."""


def _transposed(A: Array) -> Array:
    return np.swapaxes(A, -1, -2)


def strain(F: Array) -> Array:
    """Return Green's strain E (..., 3, 3) of F."""
    return np.asarray((_transposed(F) @ F - np.eye(3)) / 2)


def strain_increment(F: Array, dF: Array) -> Array:
    """Return E(F + dF) - E(F) with the relative accuracy of dF: the sum F + dF is never formed."""
    A = _transposed(F + dF / 2) @ dF
    return np.asarray((A + _transposed(A)) / 2)


def stress(C: Array, E: Array) -> Array:
    """Return S = C : E, (..., 3, 3) in Pa."""
    e = voigt.vector(E)
    e[..., 3:] *= 2
    return voigt.tensor((C @ e[..., None])[..., 0])


def energy_density(C: Array, F: Array) -> Array:
    """Return ½ E : C : E, (...) in J/m³."""
    E = strain(F)
    return np.asarray((stress(C, E) * E).sum(axis=(-2, -1)) / 2)


def piola(C: Array, F: Array, dF: Array | None = None, damping: float = 0.0) -> Array:
    """Return P = F S (..., 3, 3) in Pa, or that of the energy–momentum method over an increment.

    With dF: P = F_m S_a, F_m = F + dF/2, S_a = C : ((E + E⁺)/2 + damping (E⁺ - E)).

    >>> C = np.diag([1.0] * 6)
    >>> F, dF = np.diag([1.0, 1.0, 1.1]), np.diag([0.0, 0.2, 0.3])
    >>> work = (piola(C, F, dF) * dF).sum()
    >>> bool(abs(work - (energy_density(C, F + dF) - energy_density(C, F))) < 1e-15)
    True
    """
    E = strain(F)
    if dF is None:
        return np.asarray(F @ stress(C, E))
    dE = strain_increment(F, dF)
    return np.asarray((F + dF / 2) @ stress(C, E + (0.5 + damping) * dE))


def piola_tangent(C: Array, F: Array, dF: Array | None = None, damping: float = 0.0) -> Array:
    """Return dP_ij/dF_kl, or dP_ij/d(dF)_kl of the energy–momentum method, (..., 3, 3, 3, 3) in Pa.

    The former is symmetric, dP_ij/dF_kl = δ_ik S_jl + F_ia C_ajcl F_kc; the latter is half of it for dF → 0.
    """
    C4 = C[..., PLACES[:, :, None, None], PLACES]
    eye, E = np.eye(3), strain(F)
    if dF is None:
        middle, end, S, share, half = F, F, stress(C, E), 1.0, 1.0
    else:
        middle, end, share, half = F + dF / 2, F + dF, 0.5 + damping, 0.5
        S = stress(C, E + share * strain_increment(F, dF))
    material = np.einsum("...ia,...ajcl,...kc->...ijkl", middle, C4, end, optimize=True)
    geometric = np.einsum("ik,...jl->...ijkl", eye, S)
    return np.asarray(share * material + half * geometric)
