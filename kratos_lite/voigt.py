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
ABAQUS = [0, 1, 2, 3, 5, 4]
"""Components xx yy zz xy xz yz of Abaqus and CalculiX among those here, and these among those."""
PLACES = ((0, 3, 5), (3, 1, 4), (5, 4, 2))
"""Component of each entry of a tensor."""
HALF_SHEAR = np.array([1, 1, 1, 0.5, 0.5, 0.5])
"""Factors from engineering strains to the components of the tensor."""
SHEAR_TWICE = 1 / HALF_SHEAR
"""Factors from the components of a tensor to engineering strains; how often each counts in a product."""
UNIT = np.array([1.0, 1, 1, 0, 0, 0])
"""The unit tensor."""
DEVIATOR = np.diag(HALF_SHEAR) - np.outer(UNIT, UNIT) / 3
"""Engineering strains to the components of the deviator (6, 6)."""


def tensor(stress: ArrayLike) -> Array:
    """Return the symmetric tensor (..., 3, 3) of a stress vector (..., 6)."""
    s = np.asarray(stress, dtype=float)
    return s[..., PLACES]


def vector(stress: ArrayLike) -> Array:
    """Return the vector (..., 6) of a symmetric stress tensor (..., 3, 3)."""
    t = np.asarray(stress, dtype=float)
    i, j = np.array(PAIRS).T
    return t[..., i, j]


def turned_strain(strain: ArrayLike, R: Array) -> Array:
    """Return the components (..., 6) of strains along the rows of R (3, 3), unit vectors."""
    return vector(R @ tensor(strain * HALF_SHEAR) @ R.T) * SHEAR_TWICE


def times(a: Array, C: Array) -> Array:
    """Return C a of vectors (..., 6) as one product of two matrices, which is faster than many."""
    return np.asarray((a.reshape(-1, 6) @ C.T).reshape(a.shape))


def components(a: Array) -> Array:
    """Return vectors (..., 6) as their components (6, ...), each in one piece, with which NumPy is faster."""
    return np.ascontiguousarray(np.moveaxis(a, -1, 0))


def determinant(a: Array) -> Array:
    """Return the determinant (...) of a symmetric tensor (..., 6)."""
    xx, yy, zz, xy, yz, zx = components(a)
    return np.asarray(xx * (yy * zz - yz**2) - xy * (xy * zz - yz * zx) + zx * (xy * yz - yy * zx))


def cofactor(a: Array) -> Array:
    """Return the determinant times the inverse (..., 6) of a symmetric tensor (..., 6)."""
    xx, yy, zz, xy, yz, zx = components(a)
    normal = yy * zz - yz**2, zz * xx - zx**2, xx * yy - xy**2
    shear = yz * zx - xy * zz, zx * xy - yz * xx, xy * yz - zx * yy
    return np.stack([*normal, *shear], axis=-1)


def inverse(a: Array) -> Array:
    """Return the inverse (..., 6) of a symmetric tensor (..., 6)."""
    return cofactor(a) / determinant(a)[..., None]


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
    """Return the Tresca stress σ1 - σ3 of (..., 6), which a much larger mean stress leaves exact."""
    values = principal_values(deviator(stress))
    return values[..., 0] - values[..., 2]


def principal_values(stress: ArrayLike) -> Array:
    """Return the principal values σ1 ≥ σ2 ≥ σ3 (..., 3) of (..., 6); nan of what is not finite."""
    tensors = tensor(stress)
    finite = np.isfinite(tensors).all(axis=(-2, -1))
    values = np.full(tensors.shape[:-1], np.nan)
    values[finite] = np.linalg.eigvalsh(tensors[finite])[..., ::-1]
    return values


def principal_directions(stress: ArrayLike) -> Array:
    """Return unit vectors along the principal axes of (..., 6), rows (..., 3, 3), of σ1 ≥ σ2 ≥ σ3.

    They are right-handed, and the largest component of the first two is positive.  Those of equal values are
    any that are orthogonal.
    """
    axes = np.swapaxes(np.linalg.eigh(tensor(deviator(stress)))[1], -1, -2)[..., ::-1, :]
    largest = np.take_along_axis(axes, np.abs(axes).argmax(axis=-1)[..., None], axis=-1)
    axes = axes * np.sign(largest)
    axes[..., 2, :] = np.cross(axes[..., 0, :], axes[..., 1, :])
    return axes + 0.0  # no -0


def deviator(stress: ArrayLike) -> Array:
    """Return the deviator (..., 6) of (..., 6), from differences, which a large mean stress leaves exact."""
    xx, yy, zz, *shear = np.moveaxis(np.asarray(stress, dtype=float), -1, 0)
    x, y, z = xx - yy, yy - zz, zz - xx
    return np.stack([(x - z) / 3, (y - x) / 3, (z - y) / 3, *shear], axis=-1)


def symmetric_gradient(gradient: Array) -> Array:
    """Return the strain (..., 6) of a displacement gradient du_i/dx_j (..., 3, 3)."""
    i, j = np.array(PAIRS).T
    strain = gradient[..., i, j] + gradient[..., j, i]
    strain[..., :3] /= 2
    return strain
