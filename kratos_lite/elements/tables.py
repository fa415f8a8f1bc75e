"""Tables: shape functions at the points of a rule, and the small algebra that elements share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kratos_lite import voigt
from kratos_lite.quadrature import Rule
from kratos_lite.registry import remembered
from kratos_lite.shapes import Shape
from kratos_lite.shapes.base import at_points
from kratos_lite.typing import Array


class StrainTables(NamedTuple):
    """What kernels need to add to the strain of the displacements; see `KinematicLinear.strain_tables`."""

    center: Array  # (n, 3), dN at the center
    functions: Array  # (g, 6) enhanced monomials; N - N(center) (g, n), or (g, 0), of a dilatation
    C: Array | None  # (6, 6) Pa, which enhanced modes depend on; None of a dilatation
    fraction: float  # of the dilatation that is projected


@remembered
def tabulate(shape: type[Shape], rule: Rule) -> tuple[Array, Array]:
    """Return N (g, n) and dN (g, n, 3) at the points of a rule.  Read-only, made once."""
    N, dN = at_points(shape.N, rule.points), at_points(shape.dN, rule.points)
    N.setflags(write=False)
    dN.setflags(write=False)
    return N, dN


@remembered
def gradients_at_nodes(shape: type[Shape]) -> Array:
    """Return dN (n, n, 3) at the nodes.  Read-only, made once."""
    dN = at_points(shape.dN, shape.nodes)
    dN.setflags(write=False)
    return dN


@remembered
def has_positive_row_sums(shape: type[Shape], rule: Rule) -> bool:
    """Return whether the row sums of the mass matrix of the reference cell are all positive."""
    sums = rule.weights @ tabulate(shape, rule)[0]
    return bool((sums > 1e-9 * sums.max()).all())


def lumped(sums: Array, diagonal: Array, shape: type[Shape], rule: Rule) -> Array:
    """Return lumped masses (..., n) of row sums and diagonals (..., n); see `KinematicLinear.lumped_mass`."""
    scaled = diagonal * (sums.sum(axis=-1) / diagonal.sum(axis=-1))[..., None]
    if not has_positive_row_sums(shape, rule):
        return scaled
    return np.where((sums > 0).all(axis=-1, keepdims=True), sums, scaled)


def lame_constants(C: Array) -> tuple[float, float] | None:
    """Return (λ, μ) if C is an isotropic elasticity matrix to the last bits, else None."""
    lam, mu = float(C[0, 1]), float(C[3, 3])
    ideal = np.diag([2 * mu] * 3 + [mu] * 3)
    ideal[:3, :3] += lam
    return (lam, mu) if (np.abs(C - ideal) <= 4e-16 * np.abs(C).max()).all() else None


# ---- strain and stiffness at Gauss points -----------------------------------------------------------------


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
    """Return Σ B^T S dV (..., k, l) of B (..., g, 6, k) and S (..., g, 6, l)."""
    rows = B.shape[-3] * 6
    weighted = (S * dV[..., None, None]).reshape(*S.shape[:-3], rows, S.shape[-1])
    return np.swapaxes(B.reshape(*B.shape[:-3], rows, B.shape[-1]), -1, -2) @ weighted


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
