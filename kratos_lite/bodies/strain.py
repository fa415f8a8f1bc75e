"""Green's strain of one deformation gradient F, as nine numbers row by row."""

from __future__ import annotations

import numpy as np

from kratos_lite.bodies.linear_algebra import apply
from kratos_lite.typing import Array
from kratos_lite.voigt import PAIRS


def strain_operator(F: Array) -> Array:
    """Return B (..., 6, 9) of F (..., 9): B X is the strain sym(F^T X), with engineering shear."""
    B = np.zeros((*F.shape[:-1], 6, 3, 3))
    columns = F.reshape(*F.shape[:-1], 3, 3)
    for a, (i, j) in enumerate(PAIRS):
        B[..., a, :, j] = columns[..., :, i]
        B[..., a, :, i] = columns[..., :, j]
    return B.reshape(*F.shape[:-1], 6, 9)


def green_strain(F: Array) -> Array:
    """Return the strain (F^T F - 1)/2 (..., 6) of F (..., 9)."""
    return np.asarray((apply(strain_operator(F), F) - np.array([1.0, 1, 1, 0, 0, 0])) / 2)


def by_rows(A: Array) -> Array:
    """Return the matrix (..., 9, 9) that applies A (..., 3, 3) to each row of a matrix (9)."""
    return np.asarray(np.einsum("ik,...jl->...ijkl", np.eye(3), A).reshape(*A.shape[:-2], 9, 9))
