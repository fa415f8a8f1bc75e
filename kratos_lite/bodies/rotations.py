"""Rotations: hat, exponential map, its derivative, and the polar rotation of a matrix.

All functions take one vector (3,) or matrix (3, 3), or many through leading axes.
Source: Solfec-1.0 theory, rigid rotations; Marsden & Ratiu, Introduction to Mechanics and Symmetry (1999).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.errors import InputError
from kratos_lite.typing import Array
from kratos_lite.validation import finite

SMALL = 1e-2
"""Angle below which series take the place of sines divided by powers of the angle."""
ORTHOGONAL = 1e-8
"""How far R^T R of a rotation may be from 1."""


def hat(a: ArrayLike) -> Array:
    """Return the matrix (..., 3, 3) with hat(a) b = a × b."""
    a = np.asarray(a, dtype=float)
    out = np.zeros((*a.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., j, i] = a[..., k]
        out[..., i, j] = -a[..., k]
    return out


def axial(A: ArrayLike) -> Array:
    """Return the vector (..., 3) of the skew part of A (..., 3, 3): axial(hat(a)) = a."""
    A = np.asarray(A, dtype=float)
    pairs = ((2, 1), (0, 2), (1, 0))
    return np.stack([(A[..., i, j] - A[..., j, i]) / 2 for i, j in pairs], axis=-1)


def _coefficients(psi: Array) -> tuple[Array, Array, Array]:
    """Return sin t / t, (1 - cos t) / t² and (t - sin t) / t³ with t = |psi|, as (..., 1, 1)."""
    t2 = (psi * psi).sum(axis=-1)[..., None, None]
    t = np.sqrt(t2)
    small = t < SMALL
    safe = np.where(small, 1.0, t)
    half = np.sin(safe / 2) / safe
    a = np.where(small, 1 - t2 / 6 * (1 - t2 / 20 * (1 - t2 / 42)), np.sin(safe) / safe)
    b = np.where(small, (1 - t2 / 12 * (1 - t2 / 30 * (1 - t2 / 56))) / 2, 2 * half * half)
    c = np.where(small, (1 - t2 / 20 * (1 - t2 / 42 * (1 - t2 / 72))) / 6, (safe - np.sin(safe)) / safe**3)
    return a, b, c


def exp(psi: ArrayLike) -> Array:
    """Return the rotation (..., 3, 3) by the angle |psi| about psi (..., 3), in radians."""
    psi = np.asarray(psi, dtype=float)
    a, b, _ = _coefficients(psi)
    H = hat(psi)
    return np.asarray(np.eye(3) + a * H + b * (H @ H))


def right_jacobian(psi: ArrayLike) -> Array:
    """Return T (..., 3, 3) with exp(psi + d) = exp(psi) exp(T d) to first order in d."""
    psi = np.asarray(psi, dtype=float)
    _, b, c = _coefficients(psi)
    H = hat(psi)
    return np.asarray(np.eye(3) - b * H + c * (H @ H))


def polar(F: ArrayLike) -> Array:
    """Return the rotation R (..., 3, 3) nearest to F, never a reflection: F = R U with U symmetric."""
    V, _, W = np.linalg.svd(np.asarray(F, dtype=float))
    sign = np.ones(V.shape[:-1])
    sign[..., 2] = np.sign(np.linalg.det(V @ W))
    return np.asarray((V * sign[..., None, :]) @ W)


def check_rotation(R: ArrayLike, what: str = "a rotation") -> Array:
    """Return R (..., 3, 3) as floats; InputError unless it is a rotation to 1e-8."""
    R = finite(R, what)
    if R.shape[-2:] != (3, 3):
        raise InputError(f"{what} must have shape (3, 3); got {R.shape}")
    error = float(np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max())
    if error > ORTHOGONAL:
        raise InputError(
            f"{what} must be orthogonal: max |R^T R - 1| is {error:.3g}, at most {ORTHOGONAL:g} is allowed; "
            "kratos_lite.bodies.rotations.polar(R) gives the nearest rotation"
        )
    if (np.linalg.det(R) < 0).any():
        raise InputError(f"{what} must have determinant +1; this one is a reflection")
    return R


def rotation_of(q: Array) -> Array:
    """Return Λ (..., 3, 3) of configurations (..., 12) of rigid bodies, a view: Λ stands column by column."""
    return np.swapaxes(q[..., :9].reshape(*q.shape[:-1], 3, 3), -1, -2)


def set_rotation(q: Array, R: Array) -> None:
    """Put Λ (..., 3, 3) into configurations (..., 12) of rigid bodies."""
    q[..., :9] = np.swapaxes(R, -1, -2).reshape(q[..., :9].shape)
