"""Displacements and a pressure in each nearly incompressible element, solved for together.

With p = κ D u the equations (A + Dᵀ κ D) u = b are

    [A  Dᵀ  ] [u]   [b]
    [D  -1/κ] [p] = [0],

which stay well-conditioned for ν → ½.  Minimal residuals (GMRES) solve them.  Each step takes
p = -(S⁻¹ + λ) r_p, with λ in A, and one multigrid cycle for A u = r_u - Dᵀ p.  With A₀ = A - Dᵀ λ D,

    S = D blocks(A₀)⁻¹ Dᵀ + (means around corners)² / 2μ + 1/κ  ≈  D A₀⁻¹ Dᵀ + 1/κ:

the second term holds for smooth pressures, the first one for those that change sign from element to element.
Some of these hardly act on the nodes (checkerboards): no element needs to be stable.  For the others
S⁻¹ + λ = (D A⁻¹ Dᵀ)⁻¹ is nearer to λ + 2μ the more of λ is kept (augmented Lagrangian).

Sources: Elman, Silvester & Wathen, Finite Elements and Fast Iterative Solvers (2014), chapter 4; Benzi &
Olshanskii, SIAM J. Sci. Comput. 28 (2006) 2095-2113 (augmented Lagrangian).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.native import kernels
from kratos_lite.solvers.block_inverse import block_inverse
from kratos_lite.solvers.coarse_level import PCoarseLevel
from kratos_lite.solvers.dilatation import SplitMatrix
from kratos_lite.solvers.iteration import GoOn
from kratos_lite.solvers.multigrid import Compiled
from kratos_lite.typing import Array, Mask, Rows

if TYPE_CHECKING:
    from scipy.sparse import bsr_array

DIRECTIONS = 80
"""Iterations after which they start anew from the residual."""
REDUCED = 1e-10
"""Fraction of the residual at which they start anew, as rounding allows no more."""
MAX_ITERATIONS = 400
"""Iterations after which it does not converge."""
DEGREE = 3
"""Degree of the smoother: an iteration more takes longer than a better cycle."""
INNER, INNER_MAX = 0.1, 120
"""Fraction of the energy at which a solution with S ends, and its most iterations."""


class DisplacementPressure:
    """What solves K u = b for one right side after another, where K is split; it needs the kernels."""

    def __init__(self, K: SplitMatrix, free: Mask, points: Array, linear: PCoarseLevel | None = None) -> None:
        self._cycle = Compiled(kernels("multigrid"), K.A, free, points, linear, DEGREE)
        self.levels: list[int] = self._cycle.levels
        inverse = block_inverse(K.A, free, points, K.D, K.kept)
        # residuals are measured by the energy that they stand for
        self._weight = np.sqrt(np.concatenate([inverse.diagonal(), K.modulus]))
        self._S, self._scale = _pressure_operator(K, inverse, free)
        vectors = self._scale, K.bulk, K.kept, self._weight, INNER, INNER_MAX
        self._kernel = self._cycle.with_pressures(_arrays(K.D), _arrays(self._S), *vectors)

    def solve(
        self, b: Array, tolerance: float, norm: float, each: GoOn | None = None
    ) -> tuple[Array, int, bool]:
        """Return u, iterations and success."""
        return self._kernel.solve(b, tolerance, norm, MAX_ITERATIONS, DIRECTIONS, REDUCED, each)


def _arrays(A: bsr_array) -> tuple[Rows, Rows, Array]:
    """Return what a kernel takes of a matrix of blocks."""
    return A.indptr.astype(np.int32), A.indices.astype(np.int32), np.ascontiguousarray(A.data)


def _pressure_operator(K: SplitMatrix, inverse: bsr_array, free: Mask) -> tuple[bsr_array, Array]:
    """Return S in single precision, scaled to a diagonal of 1, and the scale."""
    from scipy.sparse import diags_array

    is_loose = np.asarray(free.reshape(-1, 3).any(axis=1))
    around_free = is_loose[K.means.ends].any(axis=1)  # around constrained nodes checkerboards have means, too
    means = K.means.matrix @ diags_array(1.0 * np.asarray(around_free))
    S = (K.D @ inverse @ K.D.T).tocsr() + means @ means.T + diags_array(1 / K.bulk)
    size = np.asarray(1 / np.sqrt(S.diagonal()))
    scale = diags_array(size)
    return (scale @ S @ scale).astype(np.float32).tocsr().tobsr(2 * K.D.blocksize[:1]), size
