"""Products and solutions of small systems, one or many through leading axes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from kratos_lite.typing import Array, Ints

Solve: TypeAlias = Callable[[Array], Array]
"""Returns x of A x = b for a matrix A made ready before; b is one right side or columns of them."""
Entries: TypeAlias = tuple[Ints, Ints, Array]
"""Rows, columns and values of a sparse matrix."""


NO_ENTRIES: Entries = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))


def sum_of(parts: Iterable[Entries]) -> Entries:
    """Return the entries of a sum of sparse matrices."""
    row, column, value = zip(NO_ENTRIES, *parts, strict=True)
    return np.concatenate(row), np.concatenate(column), np.concatenate(value)


def block_entries(rows: Ints, columns: Ints, values: Array) -> Entries:
    """Return the entries of full blocks (..., r, c) that stand in rows (..., r) and columns (..., c)."""
    row, column = np.broadcast_arrays(rows[..., :, None], columns[..., None, :])
    return row.ravel(), column.ravel(), np.asarray(values).ravel()


def first(failed: NDArray[np.bool_]) -> int:
    """Return the first index, counted through all axes, that is true, or -1."""
    return int(np.argmax(failed)) if failed.any() else -1


def apply(A: Array, x: Array) -> Array:
    """Return A x (..., n)."""
    return np.asarray((A @ x[..., None])[..., 0])


def transposed(A: Array, x: Array) -> Array:
    """Return A^T x (..., n)."""
    return apply(np.swapaxes(A, -1, -2), x)


def length(x: Array) -> Array:
    """Return |x| (...)."""
    return np.asarray(np.sqrt((x * x).sum(axis=-1)))


def solve(A: Array, b: Array) -> Array:
    """Return x (..., n) of A x = b, not a number where A is singular."""
    try:
        return np.asarray(np.linalg.solve(A, b[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.full(b.shape, np.nan)
