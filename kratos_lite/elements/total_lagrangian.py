"""Large displacements of a placed element: total Lagrangian, Saint Venant–Kirchhoff.

With the displacement gradient H = dq/dX, F = 1 + H and the Green–Lagrange strain E = (F^T F - 1)/2, the
second Piola–Kirchhoff stress is S = C:E + S0 and the first P = F S.  Rows of strain and stress are in
Voigt order with engineering shear, as everywhere.

Over a step from q to q + dq the energy-momentum form takes F at the middle and the mean of both
stresses, so that the work of the internal force vector over dq is exactly the change of the strain energy.

Source: Simo & Tarnow, ZAMP 43 (1992) 757-792; Bonet & Wood, Nonlinear Continuum Mechanics (2008), ch. 9.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kratos_lite import voigt
from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.elements.tables import summed
from kratos_lite.shapes.inverse import cofactors, determinant
from kratos_lite.typing import Array


class Deformation(NamedTuple):
    """What is known at the Gauss points of displaced elements, at q or over a step."""

    F: Array  # (..., g, 3, 3), P = F S: at q, or in the middle of a step
    S: Array  # (..., g, 6) Pa, the second Piola–Kirchhoff stress
    F_end: Array  # (..., g, 3, 3), δE = sym(F_end^T δF): at q, or at the end of a step
    rate_F: float  # dF / d(grad of the variable): 1, or 1/2 over a step
    rate_S: float  # dS = rate_S C:δE: 1, or 1/2 + damping over a step


def displacement_gradient(element: KinematicLinear, q: Array) -> Array:
    """Return H_ij = dq_i/dX_j at the Gauss points, (..., g, 3, 3), of nodal q (..., n, 3) in m.

    Of F-bar F̄ - 1, F̄ = (J̄ / J)^⅓ F; see `FBar3D8N`.
    """
    dV, D = element._gauss
    H = np.swapaxes(D @ q[..., None, :, :], -1, -2)
    return H + _stretch(H, dV) * (np.eye(3) + H) if element.formulation == "f_bar" else H


def _stretch(H: Array, dV: Array) -> Array:
    """Return (J̄ / J)^⅓ - 1 as (..., g, 1, 1), from J - 1, which small strains leave exact; nan for J ≤ 0."""
    trace = np.trace(H, axis1=-2, axis2=-1)
    change = trace + (trace**2 - np.einsum("...ij,...ji->...", H, H)) / 2 + determinant(H)
    mean = (change * dV).sum(axis=-1, keepdims=True) / dV.sum(axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.expm1((np.log1p(mean) - np.log1p(change)) / 3)[..., None, None]


def strain_change(F: Array, dF: Array) -> Array:
    """Return the change (..., 6) of E from F to F + dF: the symmetric part of (F + dF/2)^T dF."""
    middle = F + dF / 2
    return voigt.symmetric_gradient(np.swapaxes(middle, -1, -2) @ dF)


def green_strain(element: KinematicLinear, q: Array) -> Array:
    """Return E at the Gauss points, (..., g, 6), of nodal displacements q (..., n, 3) in m."""
    return strain_change(np.eye(3), displacement_gradient(element, q))


def deformation(
    element: KinematicLinear,
    C: Array,
    q: Array,
    dq: Array | None = None,
    damping: float = 0.0,
    prestress: Array | float = 0.0,
) -> Deformation:
    """Return the deformation at q (..., n, 3), or over a step dq with damping η/h times C:(E+ - E) in S."""
    H = displacement_gradient(element, q)
    F, E = np.eye(3) + H, strain_change(np.eye(3), H)
    if dq is None:
        return Deformation(F, E @ C.T + prestress, F, 1.0, 1.0)
    dF = displacement_gradient(element, dq)
    S = (E + (0.5 + damping) * strain_change(F, dF)) @ C.T + prestress
    return Deformation(F + dF / 2, S, F + dF, 0.5, 0.5 + damping)


def internal_force(element: KinematicLinear, at: Deformation) -> Array:
    """Return ∫ P grad N dV as (..., n, 3) in N."""
    dV, D = element._gauss
    S = voigt.tensor(at.S) * dV[..., None, None]
    return (np.swapaxes(D, -1, -2) @ (S @ np.swapaxes(at.F, -1, -2))).sum(axis=-3)


def stiffness_by_axis(element: KinematicLinear, C: Array, at: Deformation) -> Array:
    """Return the derivative (..., 3, n, 3, n) in N/m of internal forces by q, or by dq (not symmetric)."""
    dV, D = element._gauss
    g, n = D.shape[-3], D.shape[-1]
    left = _variation(at.F, D)
    right = left if at.F is at.F_end else _variation(at.F_end, D)
    right = (at.rate_S * C) @ right * dV[..., None, None]
    lead = D.shape[:-3]
    K = np.swapaxes(left.reshape(*lead, 6 * g, 3 * n), -1, -2) @ right.reshape(*lead, 6 * g, 3 * n)
    K = K.reshape(*lead, 3, n, 3, n)
    return _with_stress(K, at.S * (at.rate_F * dV[..., None]), D)


def _with_stress(K: Array, S: Array, D: Array) -> Array:
    """Return K with what stresses times volumes (..., g, 6) add to it."""
    initial = (np.swapaxes(D, -1, -2) @ voigt.tensor(S) @ D).sum(axis=-3)
    for i in range(3):
        K[..., i, :, i, :] += initial
    return K


def f_bar(element: KinematicLinear, q: Array, S: Array, C: Array | None) -> tuple[Array, Array | None]:
    """Return internal force (..., n, 3) and, of C = dS/dE, stiffness (..., 3, n, 3, n) of F-bar; S at F̄.

    With dθ = d ln J = G:dq and w = dθ̄ - dθ, dĒ = r² (dE + ⅓ F^T F w), r³ = J̄ / J; S:d²Ē has d²θ = -G_ja G_ib.
    """
    dV, D = element._gauss
    H = np.swapaxes(D @ q[..., None, :, :], -1, -2)
    F, square = np.eye(3) + H, (1 + _stretch(H, dV)) ** 2
    cofactor = np.swapaxes(cofactors(F), -1, -2)
    J = determinant(F)[..., None, None]
    lead, n = D.shape[:-2], D.shape[-1]
    theta = (cofactor / J @ D).reshape(*lead, 3 * n)
    share = J[..., 0] * dV[..., None]
    share /= share.sum(axis=-2, keepdims=True)
    mean = (share * theta).sum(axis=-2, keepdims=True)
    w = mean - theta
    right = voigt.vector(square * np.swapaxes(F, -1, -2) @ F) * voigt.SHEAR_TWICE
    B = square * _variation(F, D) + right[..., None] * w[..., None, :] / 3
    force = (S[..., None, :] @ B)[..., 0, :] * dV[..., None]
    total_force = np.swapaxes(force.sum(axis=-2).reshape(*lead[:-1], 3, n), -1, -2)
    if C is None:
        return total_force, None
    p = (S * right).sum(axis=-1, keepdims=True) / 3 * dV[..., None]  # of Kirchhoff's mean stress
    total = p.sum(axis=-2, keepdims=True)
    mixed = np.swapaxes(w, -1, -2) @ (force - p * w / 2) * (2 / 3)
    K = summed(B, C @ B, dV) + mixed + np.swapaxes(mixed, -1, -2)
    K += np.swapaxes(theta, -1, -2) @ (total * share * theta) - total * np.swapaxes(mean, -1, -2) @ mean
    turned = np.swapaxes(theta, -1, -2) @ ((p - total * share) * theta)
    K = K.reshape(*K.shape[:-2], 3, n, 3, n)
    K += np.swapaxes(turned.reshape(K.shape), -4, -2)
    return total_force, _with_stress(K, S * square[..., 0] * dV[..., None], D)


def _variation(F: Array, D: Array) -> Array:
    """Return B (..., g, 6, 3n) of δE = B δq for gradients D (..., g, 3, n); columns by axis, then node."""
    n = D.shape[-1]
    B = np.empty((*D.shape[:-2], 6, 3, n))
    for row, (i, j) in enumerate(voigt.PAIRS):
        B[..., row, :, :] = F[..., :, i, None] * D[..., None, j, :]
        if i != j:
            B[..., row, :, :] += F[..., :, j, None] * D[..., None, i, :]
    return B.reshape(*B.shape[:-2], 3 * n)


def strain_energy(element: KinematicLinear, C: Array, q: Array, prestress: Array | float = 0.0) -> Array:
    """Return ∫ (½ E:C:E + S0:E) dV as (...) in J."""
    E = green_strain(element, q)
    density = (E * (E @ C.T / 2 + prestress)).sum(axis=-1)
    return (density * element.dV).sum(axis=-1)
