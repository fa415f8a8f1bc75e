"""What all solvers share: the solution, its backward error, and the choice of a method."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.errors import InputError
from kratos_lite.native import kernels
from kratos_lite.typing import Array

DENSE_LIMIT = 600
"""Up to this many unknowns a full matrix needs no sparse library at all."""
COMPILED_DENSE_LIMIT = 60
"""Up to this many it is faster than compiled multigrid, which needs none either."""
DENSE_MAX = 10_000
"""Above this many degrees of freedom a full matrix is refused (it would take 0.8 GB several times)."""
DIRECT_LIMIT = 10_000
"""Up to this many unknowns factorizing is the fastest sparse way."""
METHODS = ("auto", "dense", "direct", "amg")


@dataclass(frozen=True)
class Solution:
    """The solution of A x = b and how it was found."""

    x: Array
    method: str
    reason: str
    iterations: int
    backward_error: float


def choose(method: str, unknowns: int, dofs: int = 0, symmetric: bool = True) -> tuple[str, str]:
    """Return the method to use for `unknowns` free ones of `dofs`, and the reason in words.

    >>> choose("auto", 24)[0]
    'dense'
    """
    if method not in METHODS:
        raise InputError(f"solver must be one of {', '.join(METHODS)}; got {method!r}")
    if method != "auto":
        return method, "asked for"
    compiled = symmetric and kernels("multigrid") is not None
    limit = COMPILED_DENSE_LIMIT if compiled else DENSE_LIMIT
    if unknowns <= limit and dofs <= 4 * DENSE_LIMIT:
        return "dense", f"{unknowns} unknowns ≤ {limit}: a full matrix is fastest"
    if compiled:
        return "amg", f"{unknowns} unknowns > {limit}: multigrid is fastest and takes least memory"
    if unknowns <= DIRECT_LIMIT:
        return "direct", f"{unknowns} unknowns ≤ {DIRECT_LIMIT}: sparse factorization is fastest"
    if not symmetric:
        return "direct", "the matrix is not symmetric: conjugate gradients do not apply"
    return "amg", f"{unknowns} unknowns > {DIRECT_LIMIT}: multigrid is fastest and takes least memory"


def matrix_norm(A: Any) -> float:
    """Return the largest row sum of |A|."""
    if isinstance(A, BlockMatrix):
        return A.norm()
    return float(np.asarray(abs(A).sum(axis=1)).max(initial=0.0))


def backward_error(A: Any, x: Array, b: Array, norm_A: float | None = None) -> float:
    """Return |b - A x| / (|A| |x| + |b|) in the maximum norm; |A| may be given."""
    norm_A = matrix_norm(A) if norm_A is None else norm_A
    scale = norm_A * np.abs(x).max() + np.abs(b).max()
    return float(np.abs(b - A @ x).max() / scale) if scale > 0 else 0.0
