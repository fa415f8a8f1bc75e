"""Voigt notation: six components in the order xx, yy, zz, xy, yz, zx; shear strain is engineering."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.typing import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

NAMES = ("XX", "YY", "ZZ", "XY", "YZ", "ZX")
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
"""Tensor indices of the six components."""
HALF_SHEAR = np.array([1, 1, 1, 0.5, 0.5, 0.5])
"""Factors from engineering strains to the components of the tensor."""


def tensor(stress: ArrayLike) -> Array:
    """Return the symmetric tensor (..., 3, 3) of a stress vector (..., 6)."""
    s = np.asarray(stress, dtype=float)
    return s[..., [[0, 3, 5], [3, 1, 4], [5, 4, 2]]]


def vector(stress: ArrayLike) -> Array:
    """Return the vector (..., 6) of a symmetric stress tensor (..., 3, 3)."""
    t = np.asarray(stress, dtype=float)
    rows, columns = np.array(PAIRS).T
    return t[..., rows, columns]


def acoustic_tensor(C: Array, direction: Array) -> Array:
    """Return Γ_ik = n_j C_ijkl n_l (3, 3) in Pa of a unit vector n: its eigenvalues are ρ c² of waves."""
    gradients = np.eye(3)[:, :, None] * np.asarray(direction)  # of unit displacements along x, y, z
    strain = symmetric_gradient(gradients)
    return strain @ C @ strain.T


def von_mises(stress: ArrayLike) -> Array:
    """Return the von Mises stress of (..., 6) in the unit of the stress."""
    xx, yy, zz, xy, yz, zx = np.moveaxis(np.asarray(stress, dtype=float), -1, 0)
    normal = ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2
    return np.sqrt(normal + 3 * (xy**2 + yz**2 + zx**2))


def tresca(stress: ArrayLike) -> Array:
    """Return the Tresca stress σ1 - σ3 of (..., 6), twice the largest shear stress.

    A mean stress that is much larger does not disturb it.
    """
    _, radius, angle = _lode(stress)
    return np.sqrt(2) * radius * np.sin(angle + np.pi / 3)


def principal_values(stress: ArrayLike) -> Array:
    """Return the principal values σ1 ≥ σ2 ≥ σ3 (..., 3) of (..., 6), as accurate as those of LAPACK."""
    mean, radius, angle = _lode(stress)
    turns = angle[..., None] - 2 * np.pi / 3 * np.arange(3)
    return mean[..., None] + np.sqrt(2 / 3) * radius[..., None] * np.cos(turns)


def principal_directions(stress: ArrayLike) -> Array:
    """Return unit vectors along the principal axes of (..., 6), rows (..., 3, 3), of σ1 ≥ σ2 ≥ σ3.

    They are right-handed, and the largest component of the first two is positive.  Those of equal values are
    any that are orthogonal.
    """
    s = np.moveaxis(_deviator(np.moveaxis(np.asarray(stress, dtype=float), -1, 0)), 0, -1)
    axes = np.swapaxes(np.linalg.eigh(tensor(s))[1], -1, -2)[..., ::-1, :]
    largest = np.take_along_axis(axes, np.abs(axes).argmax(axis=-1)[..., None], axis=-1)
    axes = axes * np.sign(largest)
    axes[..., 2, :] = np.cross(axes[..., 0, :], axes[..., 1, :])
    return axes + 0.0  # no -0


def _lode(stress: ArrayLike) -> tuple[Array, Array, Array]:
    """Return Lode's coordinates (...): mean stress, size of the deviator and its angle, 0 to π/3.

    The deviator s and that of s², t, are vectors of one plane, and t is turned by three times the angle: sine
    and cosine of it are |s ∧ t| and s·t.  As a sum of squares the sine is exact where two values are equal,
    which the arc cosine of the third invariant is not.

    Source of the angle: W. Lode, Z. Physik 36 (1926) 913-939.
    """
    s = np.asarray(stress, dtype=float)
    flat = s.reshape(-1, 6)
    parts = [_lode_of_few(flat[i : i + 4096]) for i in range(0, len(flat), 4096)]  # stays in the cache
    mean, radius, angle = np.concatenate([np.zeros((3, 0)), *parts], axis=1)
    shape = s.shape[:-1]
    return mean.reshape(shape), radius.reshape(shape), angle.reshape(shape)


def _lode_of_few(stress: Array) -> Array:
    """Return Lode's coordinates (3, m) of (m, 6)."""
    deviator = _deviator(stress.T)
    size = np.abs(deviator).max(axis=0, initial=0.0)
    dx, dy, dz, xy, yz, zx = deviator / np.where(size > 0, size, 1.0)  # squares of tiny ones are not 0
    r = np.sqrt(2)
    s = np.array([dx, dy, dz, r * xy, r * yz, r * zx])
    t = np.array(
        [
            dx * dx + xy * xy + zx * zx,
            dy * dy + xy * xy + yz * yz,
            dz * dz + yz * yz + zx * zx,
            r * (yz * zx - dz * xy),
            r * (xy * zx - dx * yz),
            r * (xy * yz - dy * zx),
        ]
    )
    t[:3] -= t[:3].mean(axis=0)
    squares = sum((s[i] * t[j] - s[j] * t[i]) ** 2 for i, j in combinations(range(6), 2))
    angle = np.arctan2(np.sqrt(squares), (s * t).sum(axis=0)) / 3
    return np.array([stress[:, :3].sum(axis=1) / 3, np.sqrt((s * s).sum(axis=0)) * size, angle])


def _deviator(stress: Array) -> Array:
    """Return the deviator of (6, ...), from differences, which a large mean stress leaves exact."""
    xx, yy, zz, xy, yz, zx = stress
    x, y, z = xx - yy, yy - zz, zz - xx
    return np.array([(x - z) / 3, (y - x) / 3, (z - y) / 3, xy, yz, zx])


def symmetric_gradient(gradient: Array) -> Array:
    """Return the strain (..., 6) of a displacement gradient du_i/dx_j (..., 3, 3)."""
    i, j = np.array(PAIRS).T
    strain = gradient[..., i, j] + gradient[..., j, i]
    strain[..., :3] /= 2
    return strain
