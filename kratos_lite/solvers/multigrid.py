"""Algebraic multigrid: smoothed aggregation with the rigid modes as near-nullspace."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import bsr_array, csr_array

Array = NDArray[np.float64]


def multigrid(A: bsr_array | csr_array, modes: Array) -> Callable[[Array], Array]:
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
