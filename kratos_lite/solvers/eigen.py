"""Modes: natural frequencies and shapes of K φ = ω² M φ.

Small problems are solved whole (LAPACK), larger ones by Lanczos with shift and invert (ARPACK).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.solvers import direct
from kratos_lite.typing import Array
from kratos_lite.validation import whole_number

if TYPE_CHECKING:
    from scipy.sparse import csr_array

DENSE_MODES = 1200
"""Up to this many unknowns all modes at once take no longer than some by iteration."""


def modes(K: csr_array[Any, Any], M: csr_array[Any, Any], count: int) -> tuple[Array, Array]:
    """Return the lowest natural frequencies and their shapes.

    Parameters
    ----------
    K, M : sparse (n, n), symmetric; K positive semidefinite, M positive definite.
    count : how many, 1 … n.

    Returns
    -------
    omega (count,) in rad/s, ascending; rigid motions have 0 but for rounding.
    shapes (n, count) with φ^T M φ = 1.

    Raises
    ------
    InputError
        If so many modes do not exist.

    Examples
    --------
    >>> from scipy.sparse import csr_array
    >>> omega, _ = modes(csr_array(np.diag([4.0, 9.0])), csr_array(np.eye(2)), 2)
    >>> omega.round(12).tolist()
    [2.0, 3.0]
    """
    n = K.shape[0]
    if whole_number(count, "count") > n:
        raise InputError(f"this body has 1 … {n} modes; got {count}")
    if n <= DENSE_MODES or count > n // 4:
        from scipy.linalg import eigh

        squares, shapes = eigh(K.toarray(), M.toarray(), subset_by_index=[0, count - 1])
        return np.sqrt(np.maximum(squares, 0.0)), shapes
    return _by_iteration(K, M, count)


def _by_iteration(K: Any, M: Any, count: int) -> tuple[Array, Array]:
    """Return the lowest modes by Lanczos on (K + s M)^-1 M, with a shift s that makes K definite."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    n = K.shape[0]
    shift = 1e-4 * K.diagonal().sum() / M.diagonal().sum()
    factors = direct.factorize((K + shift * M).tocsr())
    inverse = LinearOperator((n, n), matvec=factors.solve, dtype=np.float64)
    start = np.random.default_rng(0).standard_normal(n)  # the same vector gives the same modes each time
    squares, shapes = eigsh(K, count, M, sigma=-shift, OPinv=inverse, v0=start)
    order = np.argsort(squares)
    return np.sqrt(np.maximum(squares[order], 0.0)), shapes[:, order]
