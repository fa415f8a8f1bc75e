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

from kratos_lite.solvers import multigrid
from kratos_lite.solvers.block_inverse import block_inverse
from kratos_lite.solvers.coarse_level import PCoarseLevel
from kratos_lite.solvers.dilatation import SplitMatrix
from kratos_lite.solvers.direct import one_thread
from kratos_lite.solvers.iteration import GoOn
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
    """What solves K u = b for one right side after another, where K is split."""

    def __init__(self, K: SplitMatrix, free: Mask, points: Array, linear: PCoarseLevel | None = None) -> None:
        self._K, self._fixed = K, ~free
        self._cycle = multigrid.multigrid(K.A, free, points, linear, DEGREE)
        self.levels: list[int] = self._cycle.levels
        inverse = block_inverse(K.A, free, points, K.D, K.kept)
        # residuals are measured by the energy that they stand for
        self._weight = np.sqrt(np.concatenate([inverse.diagonal(), K.modulus]))
        self._S, self._scale = _pressure_operator(K, inverse, free)
        self._kernel = None
        if isinstance(self._cycle, multigrid.Compiled):
            vectors = self._scale, K.bulk, K.kept, self._weight, INNER, INNER_MAX
            self._kernel = self._cycle.with_pressures(_arrays(K.D), _arrays(self._S), *vectors)

    def solve(
        self, b: Array, tolerance: float, norm: float, each: GoOn | None = None
    ) -> tuple[Array, int, bool]:
        """Return u, iterations and success."""
        if self._kernel is not None:
            limits = MAX_ITERATIONS, DIRECTIONS, REDUCED
            return self._kernel.solve(b, tolerance, norm, *limits, each)
        with one_thread():
            return self._solve(b, tolerance, norm, each)

    def _solve(self, b: Array, tolerance: float, norm: float, each: GoOn | None) -> tuple[Array, int, bool]:
        """Solve without kernels, by the flexible minimal residuals of SciPy."""
        from scipy.sparse.linalg import LinearOperator, gcrotmk

        n, iterations, residual = len(b), 0, float("inf")
        weight = self._weight
        inverse = np.divide(1.0, weight, out=np.zeros_like(weight), where=weight > 0)

        def precondition(r: Array) -> Array:
            nonlocal iterations
            iterations += 1
            return self._precondition(inverse * r)

        shape = (len(weight), len(weight))
        A = LinearOperator(shape, matvec=lambda x: weight * self._product(x), dtype=np.float64)
        M = LinearOperator(shape, matvec=precondition, dtype=np.float64)
        rhs, x, size = (
            np.append(weight[:n] * b, np.zeros(len(weight) - n)),
            0 * weight,
            float(np.linalg.norm(b)),
        )
        aim = tolerance * float(np.linalg.norm(rhs))
        while iterations < MAX_ITERATIONS:
            x, _ = gcrotmk(A, rhs, x, rtol=0.0, atol=aim, maxiter=1, M=M, m=DIRECTIONS)
            before, residual = residual, float(np.linalg.norm(self._forces(b, x[:n])))
            rounding = 2 * np.finfo(float).eps * (norm * float(np.linalg.norm(x[:n])) + size)
            limit = max(float(rounding), tolerance * size)
            if residual <= limit:
                return x[:n], iterations, True
            if residual > before / 2 or (each is not None and not each(residual / size)):
                break
            aim *= min(limit / residual, 0.5)
        return x[:n], iterations, False

    def _forces(self, b: Array, u: Array) -> Array:
        """Return b - K u on free components: u has not quite the pressures of the iteration."""
        return np.where(self._fixed, 0.0, b - self._K @ u)

    def _product(self, x: Array) -> Array:
        """Return the product of the matrix of displacements and pressures with both."""
        K, n = self._K, len(self._fixed)
        u, p = x[:n], x[n:]
        return np.concatenate([np.where(self._fixed, 0.0, K.A @ u + K.D.T @ p), K.D @ u - p / K.bulk])

    def _precondition(self, r: Array) -> Array:
        from scipy.sparse.linalg import cg

        n = len(self._fixed)
        p = -self._scale * cg(self._S, self._scale * r[n:], rtol=INNER**0.5, maxiter=INNER_MAX)[0]
        p -= self._K.kept * r[n:]
        forces = np.where(self._fixed, 0.0, r[:n] - self._K.D.T @ p)
        return np.concatenate([self._cycle.precondition(forces), p])


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
