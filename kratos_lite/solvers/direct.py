"""Factorisations: dense for small matrices, sparse (SuperLU) for larger ones."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite.errors import SolveError

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]


def solve_dense(A: Array, b: Array) -> Array:
    """Solve with a full matrix."""
    try:
        return np.asarray(np.linalg.solve(A, b), dtype=float)
    except np.linalg.LinAlgError:
        raise SolveError("the stiffness matrix is singular: part of the body can still move") from None


def solve_direct(A: csr_array, b: Array, symmetric: bool = True) -> Array:
    """Solve by sparse factorisation (SuperLU) with one step of refinement."""
    from scipy.sparse.linalg import splu

    options: dict[str, Any] = {"permc_spec": "COLAMD"}
    if symmetric:
        options = {
            "permc_spec": "MMD_AT_PLUS_A",
            "diag_pivot_thresh": 0.0,
            "options": {"SymmetricMode": True},
        }
    try:
        factors = splu(A.tocsc(), **options)
    except RuntimeError as error:
        raise SolveError(
            f"the stiffness matrix is singular ({error}): part of the body can still move"
        ) from None
    except MemoryError:
        raise SolveError(
            f"not enough memory to factorise {A.shape[0]} unknowns; use solver='amg' or a coarser mesh"
        ) from None
    x = factors.solve(b)
    return np.asarray(x + factors.solve(b - A @ x))
