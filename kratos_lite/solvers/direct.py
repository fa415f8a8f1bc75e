"""Factorizations, made once and kept: dense for small matrices, sparse for larger ones.

Sparse ones come from MKL PARDISO where `pypardiso` is installed, which takes a tenth of the time
and half the memory, and else from SuperLU, which comes with SciPy.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, cast
from weakref import finalize

import numpy as np

from kratos_lite.errors import SolveError
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from scipy.sparse import csr_array

NO_MEMORY = -2
"""PARDISO's error code for too little memory; the others mean a matrix it cannot factorize."""
BUFFERS = 10**8
"""Bytes that such a library takes at its first product; without them OpenBLAS ends the program."""
REPLACED_PIVOTS = 14
"""PARDISO's parameter (from 1) that counts pivots too small to divide by."""


class Unsuitable(Exception):
    """A way of factorizing that is not installed, or does not do for a matrix."""


class Factorization:
    """A factorized matrix A, by ``dense``, ``pardiso`` or ``superlu``; `apply` solves without refinement."""

    def __init__(self, method: str, A: Any, apply: Callable[[Array], Array]) -> None:
        self.method, self.A, self.apply = method, A, apply

    def solve(self, b: Array) -> Array:
        """Return x (n,) of A x = b, refined once.

        Source: Higham, Accuracy and Stability of Numerical Algorithms (2002), chapter 12.
        """
        x = self.apply(b)
        return x + self.apply(b - self.A @ x)


def factorize_dense(A: Array) -> Factorization:
    """Return a full matrix (n, n) factorized: its inverse, as NumPy keeps no other factors."""
    try:
        inverse = np.linalg.inv(A)
    except np.linalg.LinAlgError:
        raise singular() from None
    return Factorization("dense", A, lambda b: inverse @ b)


def factorize(A: csr_array, symmetric: bool = True) -> Factorization:
    """Return a sparse matrix (n, n) factorized, by the fastest of `BACKENDS` that does."""
    for backend in BACKENDS:
        try:
            return Factorization(backend.__name__, A, backend(A, symmetric))
        except Unsuitable:
            continue
        except MemoryError:
            raise SolveError(
                f"not enough memory to factorize {A.shape[0]} unknowns; use solver='amg' or a coarser mesh"
            ) from None
    raise singular()


def pardiso(A: csr_array, symmetric: bool) -> Callable[[Array], Array]:
    """Factorize with MKL PARDISO: Cholesky with nested dissection, or LU for a matrix that is not symmetric.

    Where a pivot is not positive (Cholesky) or had to be replaced (LU), SuperLU has to say whether A is
    singular.
    """
    try:
        solvers = import_module("pypardiso.pardiso_wrapper")
    except ImportError:
        raise Unsuitable from None
    from scipy.sparse import csr_array, triu

    solver = solvers.PyPardisoSolver(mtype=2 if symmetric else 11)
    half = csr_array(triu(A) if symmetric else A)
    release = finalize(half, solver.free_memory, everything=True)
    release.atexit = False  # the process gives all memory back anyway
    try:
        solver.factorize(half)
    except ValueError:
        raise Unsuitable from None
    except solvers.PyPardisoError as error:
        raise (MemoryError if error.value == NO_MEMORY else Unsuitable) from None
    if solver.get_iparm(REPLACED_PIVOTS):
        raise Unsuitable
    return lambda b: solver.solve(half, b)


def superlu(A: csr_array, symmetric: bool) -> Callable[[Array], Array]:
    """Factorize with SuperLU: pivots on the diagonal and minimum degree where A is symmetric."""
    from scipy.sparse.linalg import splu

    reserve_buffers(of_scipy=True)

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
        raise singular(f" ({error})") from None
    return factors.solve


def singular(detail: str = "") -> SolveError:
    """Return the error for a singular matrix."""
    return SolveError(f"the stiffness matrix is singular{detail}: part of the body can still move")


BACKENDS: tuple[Callable[[csr_array, bool], Callable[[Array], Array]], ...] = (pardiso, superlu)
"""Ways to factorize a sparse matrix, fastest first; each returns b -> x, or raises Unsuitable."""


# ---- libraries of dense algebra: their memory and threads -------------------------------------------


def reserve_buffers(of_scipy: bool = False) -> None:
    """Let the library of NumPy, or of SciPy, take its memory now; MemoryError where there is not enough."""
    np.empty(BUFFERS, dtype=np.uint8)
    if of_scipy:
        from scipy.linalg.lapack import dpotrf

        dpotrf(np.eye(2))
    else:
        np.linalg.inv(np.eye(2))


@cache
def _controller() -> Any:
    """Return what limits threads, or None where it is not installed."""
    import scipy.linalg.lapack  # noqa: F401 (a library that is loaded later would not heed the limit)

    try:
        from threadpoolctl import ThreadpoolController
    except ImportError:
        return None
    return ThreadpoolController()


def one_thread() -> AbstractContextManager[Any]:
    """Keep dense algebra to one thread within a ``with`` block, where threadpoolctl is installed.

    Idle threads that wait actively for the next small product take three quarters of the time, and more if
    other processes want the cores; and sums of several threads may differ from one run to the next.
    """
    controller = _controller()
    if controller is None:
        return nullcontext()
    return cast("AbstractContextManager[Any]", controller.limit(limits=1, user_api="blas"))
