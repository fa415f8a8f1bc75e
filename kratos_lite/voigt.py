"""Voigt notation: six components in the order xx, yy, zz, xy, yz, zx; shear strain is engineering."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.typing import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

NAMES = ("XX", "YY", "ZZ", "XY", "YZ", "ZX")
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
"""Tensor indices of the six components."""


def tensor(stress: ArrayLike) -> Array:
    """Return the symmetric tensor (..., 3, 3) of a stress vector (..., 6).

    >>> tensor([1, 2, 3, 4, 5, 6])
    array([[1., 4., 6.], [4., 2., 5.], [6., 5., 3.]])
    """
    s = np.asarray(stress, dtype=float)
    return s[..., [[0, 3, 5], [3, 1, 4], [5, 4, 2]]]


def vector(stress: ArrayLike) -> Array:
    """Return the vector (..., 6) of a symmetric stress tensor (..., 3, 3)."""
    t = np.asarray(stress, dtype=float)
    rows, columns = np.array(PAIRS).T
    return t[..., rows, columns]


def acoustic_tensor(C: Array, direction: Array) -> Array:
    """Return Γ_ik = n_j C_ijkl n_l (3, 3) in Pa of a unit vector n: its eigenvalues are ρ c² of plane waves.

    >>> acoustic_tensor(np.diag([4.0, 4, 4, 2, 2, 2]), np.array([1.0, 0, 0])).diagonal().tolist()
    [4.0, 2.0, 2.0]
    """
    gradients = np.eye(3)[:, :, None] * np.asarray(direction)  # of unit displacements along x, y, z
    strain = symmetric_gradient(gradients)
    return strain @ C @ strain.T


def von_mises(stress: ArrayLike) -> Array:
    """Return the von Mises stress of (..., 6) in the unit of the stress.

    >>> float(von_mises([5.0, 0, 0, 0, 0, 0]))
    5.0
    """
    xx, yy, zz, xy, yz, zx = np.moveaxis(np.asarray(stress, dtype=float), -1, 0)
    normal = ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2
    return np.sqrt(normal + 3 * (xy**2 + yz**2 + zx**2))


def symmetric_gradient(gradient: Array) -> Array:
    """Return the strain (..., 6) of a displacement gradient du_i/dx_j (..., 3, 3)."""
    i, j = np.array(PAIRS).T
    strain = gradient[..., i, j] + gradient[..., j, i]
    strain[..., :3] /= 2
    return strain
