"""Modes: natural frequencies and shapes of K φ = ω² M φ.

Small problems are solved whole (LAPACK), larger ones by Lanczos with shift and invert (ARPACK).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.errors import InputError, SolveError
from kratos_lite.solvers import direct
from kratos_lite.solvers.plan import DENSE_MODES
from kratos_lite.typing import Array, Progress
from kratos_lite.validation import whole_number

if TYPE_CHECKING:
    from scipy.sparse import csr_array

SHIFTS = (1.0, 1e-2, 1e-4, 1e-6)
"""Factors on the first shift that are tried."""
RESTARTS = 40
"""Restarts of Lanczos after which a lower shift is tried."""
RESIDUAL = 1e-6
"""Fraction of its terms that an equation may miss."""
ROUNDING = 1e-13
"""Fraction of the norms of its matrices that it may miss."""


def modes(
    K: csr_array[Any, Any], M: csr_array[Any, Any], count: int, progress: Progress | None = None
) -> tuple[Array, Array]:
    """Return the lowest ω (count,) in rad/s, ascending, and their shapes (n, count) with φ^T M φ = 1."""
    n = K.shape[0]
    if whole_number(count, "count") > n:
        raise InputError(f"this body has 1 … {n} modes; got {count}")
    if n <= DENSE_MODES or count > n // 4:
        squares, shapes = _dense(K.toarray(), M.toarray(), count)
    else:
        squares, shapes = _by_iteration(K, M, count, progress)
    check_residuals([(np.ones(count), K), (-squares, M)], shapes)
    return np.sqrt(np.maximum(squares, 0.0)), shapes


def _dense(K: Array, M: Array, count: int) -> tuple[Array, Array]:
    """Return the lowest modes by LAPACK, which finds none where the mass is not positive in its rounding."""
    from scipy.linalg import LinAlgError, eigh

    try:
        squares, shapes = eigh(K, M, subset_by_index=[0, count - 1])
    except (LinAlgError, ValueError):
        squares, shapes = np.zeros(0), np.zeros((len(K), 0))
    if len(squares) != count:
        raise SolveError(
            f"{count} modes cannot be found: stiffness or mass is not positive within rounding; look for "
            "lengths or constants in wrong units, and for very thin elements"
        )
    return squares, shapes


def _by_iteration(K: Any, M: Any, count: int, progress: Progress | None) -> tuple[Array, Array]:
    """Return the lowest modes by Lanczos on (K + s M)^-1 M, with a shift s that makes K definite.

    Frequencies far below the shift are hard to tell apart: then it comes down.
    """
    from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

    n, done, cycle = K.shape[0], 0, max(2 * count + 1, 20)

    def solve(b: Array) -> Array:
        nonlocal done
        done += 1
        if progress:
            progress("modes", done / (done + cycle))  # nobody knows how many cycles it takes
        return factors.solve(b)

    start = np.random.default_rng(0).standard_normal(n)  # the same vector gives the same modes each time
    inverse = LinearOperator((n, n), matvec=solve, dtype=np.float64)
    for factor in SHIFTS:
        shift = factor * first_shift(K, M)
        if progress:
            progress("factorize", 0.0)
        factors = direct.factorize((K + shift * M).tocsr())
        if progress:
            progress("factorize", 1.0)
        try:
            squares, shapes = eigsh(K, count, M, sigma=-shift, OPinv=inverse, v0=start, maxiter=RESTARTS)
        except ArpackNoConvergence:
            continue
        order = np.argsort(squares)
        return squares[order], shapes[:, order]
    raise not_converged(count)


def first_shift(K: Any, M: Any) -> float:
    """Return a square of a frequency in 1/s² that is low among those of a mesh."""
    return max(1e-4 * float(K.diagonal().sum() / M.diagonal().sum()), float(np.finfo(float).tiny))


def not_converged(count: int) -> SolveError:
    """Return the error for modes that an iteration does not find."""
    return SolveError(
        f"{count} modes cannot be found by iteration; ask for fewer, or for more to have repeated ones in "
        "full, and look for nearly free parts"
    )


def check_residuals(terms: list[tuple[Any, Any]], shapes: Any) -> None:
    """Raise SolveError unless the sum of terms, factors and matrices, is 0 for each shape (n, count)."""
    parts = [factor * (A @ shapes) for factor, A in terms]
    norms = sum(np.abs(factor) * float(abs(A).sum(axis=0).max()) for factor, A in terms)
    residual = np.linalg.norm(sum(parts), axis=0)
    size = sum(np.linalg.norm(part, axis=0) for part in parts)
    allowed = RESIDUAL * size + ROUNDING * norms * np.linalg.norm(shapes, axis=0)
    if not (residual <= allowed).all():  # nor if it is NaN
        worst = int(np.argmax(np.nan_to_num(residual / allowed, nan=np.inf)))
        raise SolveError(
            f"mode {worst + 1} misses its equation by {residual[worst] / size[worst]:.1e} of its "
            "terms, which is more than rounding explains; ask for another number of modes, and look for very "
            "thin elements, a large stiffness contrast or nearly free parts"
        )
