"""One step of rigid bodies in NumPy, the reference of the compiled kernel.

Source: Koziara & Bicanic, Int. J. Numer. Meth. Eng. 81 (2010) 1073-1092.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kratos_lite.bodies.linear_algebra import apply, first, length, solve, transposed
from kratos_lite.bodies.rotations import exp, hat, right_jacobian, rotation_of, set_rotation
from kratos_lite.typing import Array

NEWTON_STEPS = 50
ROUND_OFF = 4e-16
"""Change of a velocity beside it that is none."""


def rigid_finish(
    q: Array,
    u: Array,
    qh: Array,
    load: Array,
    inertia: Array,
    inverse: Array,
    mass: Array,
    h: float,
    scheme: str,
    tolerance: float,
) -> int:
    """Return the first body whose step failed, or -1: `steps.rigid_finish` in NumPy."""
    W, T, J = u[..., :3], load[..., :3], inertia
    Rh = rotation_of(qh)
    with np.errstate(all="ignore"):
        p = transposed(exp(h / 2 * W), apply(J, W))
        Wh = apply(inverse, p + h / 2 * T)
        W1 = W + h * apply(inverse, T - np.cross(Wh, apply(J, Wh)))
        v1 = u[..., 3:] + h * load[..., 3:] / np.asarray(mass)[..., None]
        A = p + h * T
        going = np.zeros(q.shape[:-1], dtype=bool)
        if scheme == "RIG_IMP":
            W1, going = _implicit_velocity(J, A, W1, h, tolerance)
        E2 = exp(h / 2 * W1)
        if scheme == "RIG_NEG":
            W1 = apply(inverse, transposed(E2, A))
        set_rotation(q, Rh @ E2)
    q[..., 9:] = qh[..., 9:] + h / 2 * v1
    u[..., :3], u[..., 3:] = W1, v1
    return first(going | ~np.isfinite(u).all(axis=-1))


def _implicit_velocity(
    J: Array, A: Array, W: Array, h: float, tolerance: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Return W with J W = exp(-h/2 W) A by Newton's method from W, and where it was not found."""
    size = np.abs(A).max(axis=-1)
    going = np.ones(size.shape, dtype=bool)
    for _ in range(NEWTON_STEPS):
        psi, JW = h / 2 * W, apply(J, W)
        r = transposed(exp(psi), A) - JW
        going = going & ~(length(r) <= tolerance * size)
        if not going.any():
            break
        d = solve(J - h / 2 * hat(JW) @ right_jacobian(psi), r)
        W = np.where(going[..., None], W + d, W)
        going = going & ~(length(d) <= ROUND_OFF * length(W))
    return W, going
