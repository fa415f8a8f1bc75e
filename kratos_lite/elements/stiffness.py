"""Stiffness from what is known at the Gauss points: the sum Σ B^T S dV, and a short way to it."""

from __future__ import annotations

import numpy as np

from kratos_lite import voigt
from kratos_lite.typing import Array


def strain_rows(D: Array) -> Array:
    """Return B (..., 6, 3n) of gradients D (..., 3, n): strain = B u, dof = 3·node + axis."""
    n = D.shape[-1]
    B = np.zeros((*D.shape[:-2], 6, n, 3))
    for row, (i, j) in enumerate(voigt.PAIRS):
        B[..., row, :, i] = D[..., j, :]
        B[..., row, :, j] = D[..., i, :]
    return B.reshape(*D.shape[:-2], 6, 3 * n)


def by_axis(K: Array) -> Array:
    """Return K (..., 3n, 3n) in the order of assembly, (..., 3, n, 3, n)."""
    n = K.shape[-1] // 3
    return np.moveaxis(K.reshape(*K.shape[:-2], n, 3, n, 3), (-3, -1), (-4, -2))


def by_dof(K: Array) -> Array:
    """Return K (..., 3, n, 3, n) by dof = 3·node + axis, (..., 3n, 3n)."""
    n = K.shape[-1]
    return np.moveaxis(K, (-4, -2), (-3, -1)).reshape(*K.shape[:-4], 3 * n, 3 * n)


def summed(B: Array, S: Array, dV: Array) -> Array:
    """Return Σ B^T S dV (..., k, k) of B and S (..., g, 6, k)."""
    rows, k = B.shape[-3] * 6, B.shape[-1]
    weighted = (S * dV[..., None, None]).reshape(*S.shape[:-3], rows, k)
    return np.swapaxes(B.reshape(*B.shape[:-3], rows, k), -1, -2) @ weighted


def isotropic(D: Array, dV: Array, lame: tuple[float, float]) -> Array:
    """Return K = λ P_iajb + μ P_jaib + μ δ_ij P_kakb, P_iajb = Σ D_ia D_jb dV, of D (..., g, 3, n)."""
    g, n = D.shape[-3], D.shape[-1]
    A = D.reshape(*D.shape[:-3], g, 3 * n)
    P = (np.swapaxes(A, -1, -2) * dV[..., None, :]) @ A
    P = P.reshape(*P.shape[:-2], 3, n, 3, n)
    K = lame[0] * P + lame[1] * np.swapaxes(P, -4, -2)
    trace = lame[1] * (P[..., 0, :, 0, :] + P[..., 1, :, 1, :] + P[..., 2, :, 2, :])
    for i in range(3):
        K[..., i, :, i, :] += trace
    return K
