"""Solvers: dense, sparse direct, and conjugate gradients with algebraic multigrid.

`solve` chooses by size and says why.  Every answer carries its backward error
|b - A x| / (|A| |x| + |b|) in the maximum norm: the size of the smallest change of A and b for
which x would be exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite.errors import InputError, SolveError

if TYPE_CHECKING:
    from scipy.sparse import bsr_array, csr_array

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

DENSE_LIMIT = 600
"""Up to this many unknowns a full matrix needs no sparse library at all."""
DENSE_MAX = 10_000
"""Above this many degrees of freedom a full matrix is refused (it would take 0.8 GB several times)."""
DIRECT_LIMIT = 10_000
"""Up to this many unknowns factorising is the fastest sparse way."""
FALLBACK_LIMIT = 150_000
"""Up to this many unknowns a factorisation is tried when the iteration fails."""
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

    >>> choose("auto", 24)
    ('dense', '24 unknowns ≤ 600: a full matrix is fastest')
    """
    if method not in METHODS:
        raise InputError(f"solver must be one of {', '.join(METHODS)}; got {method!r}")
    if method != "auto":
        return method, "asked for"
    if unknowns <= DENSE_LIMIT and dofs <= 4 * DENSE_LIMIT:
        return "dense", f"{unknowns} unknowns ≤ {DENSE_LIMIT}: a full matrix is fastest"
    if unknowns <= DIRECT_LIMIT:
        return "direct", f"{unknowns} unknowns ≤ {DIRECT_LIMIT}: sparse factorisation is fastest"
    if not symmetric:
        return "direct", "the matrix is not symmetric: conjugate gradients do not apply"
    return "amg", f"{unknowns} unknowns > {DIRECT_LIMIT}: multigrid is fastest and takes least memory"


def matrix_norm(A: Any) -> float:
    """Return the largest row sum of |A|."""
    return float(np.asarray(abs(A).sum(axis=1)).max(initial=0.0))


def backward_error(A: Any, x: Array, b: Array, norm_A: float | None = None) -> float:
    """Return |b - A x| / (|A| |x| + |b|) in the maximum norm; |A| may be given."""
    norm_A = matrix_norm(A) if norm_A is None else norm_A
    scale = norm_A * np.abs(x).max() + np.abs(b).max()
    return float(np.abs(b - A @ x).max() / scale) if scale > 0 else 0.0


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


def multigrid(A: bsr_array, modes: Array) -> Callable[[Array], Array]:
    """Return a smoothed-aggregation V-cycle with the rigid modes (N, 6) as near-nullspace."""
    import pyamg

    smoother = ("block_gauss_seidel", {"sweep": "symmetric"})
    hierarchy = pyamg.smoothed_aggregation_solver(
        A,
        B=modes,
        strength=("symmetric", {"theta": 0.0}),
        presmoother=smoother,
        postsmoother=smoother,
        improve_candidates=None,
        max_coarse=200,
    )
    operator = hierarchy.aspreconditioner(cycle="V")
    return lambda r: np.asarray(operator @ r)


def conjugate_gradients(
    A: Any,
    b: Array,
    precondition: Callable[[Array], Array],
    tolerance: float,
    norm_A: float,
    max_iterations: int = 500,
    progress: Progress | None = None,
) -> tuple[Array, int, bool]:
    """Solve A x = b with symmetric positive definite A; return x, iterations and success.

    It stops when |r| ≤ tolerance |b|, or when |r| reaches what round-off allows,
    2 eps (|A| |x| + |b|); and gives up when 60 iterations bring no new smallest residual.
    Source: Saad, Iterative Methods for Sparse Linear Systems (2003), algorithm 9.1.
    """
    x, r = np.zeros_like(b), b.copy()
    norm_b = float(np.linalg.norm(b))
    if norm_b == 0:
        return x, 0, True
    best, best_at, start = norm_b, 0, norm_b
    z = precondition(r)
    p, rz = z.copy(), float(r @ z)
    for iteration in range(1, max_iterations + 1):
        Ap = A @ p
        curvature = float(p @ Ap)
        if not (curvature > 0 and rz > 0):
            return x, iteration, False
        alpha = rz / curvature
        x += alpha * p
        r -= alpha * Ap
        norm = float(np.linalg.norm(r))
        if progress:
            progress("solve", min(1.0, np.log(max(norm, 1e-300) / start) / np.log(tolerance)))
        limit = max(tolerance * norm_b, 2 * np.finfo(float).eps * (norm_A * np.linalg.norm(x) + norm_b))
        if norm <= limit:
            return x, iteration, True
        if norm < best:
            best, best_at = norm, iteration
        elif iteration - best_at > 60:
            return x, iteration, False
        z = precondition(r)
        rz, old = float(r @ z), rz
        p = z + (rz / old) * p
    return x, max_iterations, False
