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
from kratos_lite.typing import Array


class Deformation(NamedTuple):
    """What is known at the Gauss points of displaced elements, at q or over a step."""

    F: Array  # (..., g, 3, 3), P = F S: at q, or in the middle of a step
    S: Array  # (..., g, 6) Pa, the second Piola–Kirchhoff stress
    F_end: Array  # (..., g, 3, 3), δE = sym(F_end^T δF): at q, or at the end of a step
    rate_F: float  # dF / d(grad of the variable): 1, or 1/2 over a step
    rate_S: float  # dS = rate_S C:δE: 1, or 1/2 + damping over a step


def displacement_gradient(element: KinematicLinear, q: Array) -> Array:
    """Return H_ij = dq_i/dX_j at the Gauss points, (..., g, 3, 3), of nodal q (..., n, 3) in m."""
    _, D = element._gauss
    return np.swapaxes(D @ q[..., None, :, :], -1, -2)


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
    S = voigt.tensor(at.S) * (at.rate_F * dV[..., None, None])
    initial = (np.swapaxes(D, -1, -2) @ S @ D).sum(axis=-3)
    for i in range(3):
        K[..., i, :, i, :] += initial
    return K


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
