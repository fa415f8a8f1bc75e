"""One step of pseudo-rigid bodies in NumPy, the reference of the compiled kernel.

Matrices F (9) are row-wise; B (6, 9) of F is the operator with B X = sym(F^T X) in Voigt order, with
engineering shear: the force is B^T S, the stiffness B^T C B and S applied to each row.

Sources: Zhang & Skeel, Appl. Numer. Math. 25 (1997) 297-302 (DEF_LIM); Simo & Tarnow, ZAMP 43 (1992) 757-792
(ENERGY_MOMENTUM); Magisano, Leonetti & Garcea, Comput. Methods Appl. Mech. Eng. 313 (2017) 986-1005 (its
Newton method).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kratos_lite.bodies.linear_algebra import apply, first, length, solve, transposed
from kratos_lite.bodies.strain import by_rows, green_strain, strain_operator
from kratos_lite.typing import Array
from kratos_lite.voigt import tensor

NEWTON_STEPS = 50


def pseudo_finish(
    q: Array,
    u: Array,
    load: Array,
    euler: Array,
    mass: Array,
    volume: Array,
    C: Array,
    damping: Array,
    h: float,
    scheme: str,
    tolerance: float,
) -> int:
    """Return the first body whose step failed, or -1: `steps.pseudo_finish` in NumPy."""
    F, U, f = q[..., :9], u[..., :9], load[..., :9]
    V, eta = np.asarray(volume)[..., None, None], np.asarray(damping)[..., None, None]
    going = np.zeros(q.shape[:-1], dtype=bool)
    change = np.empty(u.shape)
    with np.errstate(all="ignore"):
        if scheme == "ENERGY_MOMENTUM":
            change[..., :9], going = _energy_momentum(F, U, f, euler, V, C, eta, h, tolerance)
        else:
            change[..., :9] = _linear_step(F, U, f, euler, V, C, eta, h, scheme == "DEF_LIM")
        change[..., 9:] = h * load[..., 9:] / np.asarray(mass)[..., None]
        q += h * (u + change / 2)
        u += change
    return first(going | ~np.isfinite(u).all(axis=-1))


def _linear_step(
    F: Array, U: Array, f: Array, euler: Array, V: Array, C: Array, eta: Array, h: float, implicit: bool
) -> Array:
    """Return the change (..., 9) of the rate of F by the forces at mid-step, if `implicit` linearized."""
    B = strain_operator(F + h / 2 * U)
    S = apply(C, green_strain(F + h / 2 * U))
    K = V * (by_rows(tensor(S)) + np.swapaxes(B, -1, -2) @ C @ B)
    A = by_rows(euler)
    if implicit:
        A = A + (eta * (h / 2) + h * h / 4) * K
    return solve(A, h * (f - V[..., 0] * transposed(B, S) - eta[..., 0] * apply(K, U)))


def _energy_momentum(
    F: Array, U: Array, f: Array, euler: Array, V: Array, C: Array, eta: Array, h: float, tolerance: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the change (..., 9) of the rate of F that conserves energy and momentum; where none was found.

    The strain of the end is that of the start and an increment, so that stiff bodies do not lose digits.
    Newton's method has the stress S as a second unknown, eliminated: its matrix takes S as linearized in the
    former iteration.
    """
    E, M = green_strain(F), by_rows(euler)
    S, share = apply(C, E), 0.5 + eta / h
    change = np.zeros(U.shape)
    going = np.ones(U.shape[:-1], dtype=bool)
    for _ in range(NEWTON_STEPS):
        dF = h * (U + change / 2)
        middle, end = strain_operator(F + dF / 2), strain_operator(F + dF)
        A = M + h * h / 2 * V * (by_rows(tensor(S)) / 2 + np.swapaxes(middle, -1, -2) @ C @ (share * end))
        e = E + share[..., 0] * apply(middle, dF)
        d = solve(A, h * (f - V[..., 0] * transposed(middle, apply(C, e))) - apply(M, change))
        S = apply(C, e + h / 2 * share[..., 0] * apply(end, d))
        change = np.where(going[..., None], change + d, change)
        going = going & ~(length(d) <= tolerance * np.hypot(length(U), length(U + change)))
        if not going.any():
            break
    return change, going
