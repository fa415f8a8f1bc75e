"""Names of the types that many modules use."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from numpy.typing import NDArray
    from scipy.sparse import bsr_array, csr_array

Array: TypeAlias = "NDArray[np.float64]"
"""Numbers."""
ArrayLike: TypeAlias = "npt.ArrayLike"
"""What NumPy makes an array of."""
Complexes: TypeAlias = "NDArray[np.complex128]"
"""Complex numbers."""
Ints: TypeAlias = "NDArray[np.int64]"
"""Rows, ids and counts."""
Rows: TypeAlias = "NDArray[np.int32]"
"""Rows of nodes in cells and in sparsity patterns: half the memory of `Ints`."""
Numbers: TypeAlias = "NDArray[Any]"
"""Numbers of any kind: real, complex or whole."""
Mask: TypeAlias = "NDArray[np.bool_]"
"""Which of many."""
Csr: TypeAlias = "csr_array[Any, Any]"
"""A sparse matrix in compressed rows."""
Bsr: TypeAlias = "bsr_array"
"""A sparse matrix in compressed rows of blocks."""
Progress: TypeAlias = Callable[[str, float], None]
"""Called with the phase and the fraction done, 0 … 1."""
