"""Displacements and a pressure in each nearly incompressible element, found together.

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
from kratos_lite.solvers.iteration import FractionDone, GoOn
from kratos_lite.typing import Array, Mask, Progress, Rows

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import bsr_array

DIRECTIONS = 80
"""Iterations after which they start anew from the residual: their directions are kept until then."""
REDUCED = 1e-10
"""Fraction of the residual at which they start anew, as rounding allows no more."""
ROUGH = 0.03
"""Relative residual of a rough solution."""
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
        size = np.sqrt(np.concatenate([inverse.diagonal(), K.modulus]))
        self._weight = size  # residuals are measured by the energy that they stand for
        self._inverse_weight = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
        self._schur = _Schur(K, inverse, np.asarray(free.reshape(-1, 3).any(axis=1)))
        self._kernel = None
        if isinstance(self._cycle, multigrid.Compiled):
            D, S = K.D, self._schur.S
            vectors = self._schur.scale, K.bulk, K.kept, size, INNER, INNER_MAX
            self._kernel = self._cycle.with_pressures(_arrays(D), _arrays(S), *vectors)

    def precondition(self, r: Array) -> Array:
        """Return about K⁻¹ r: a rough solution."""
        return self.solve(r, ROUGH, 0.0, None)[0]

    def solve(
        self,
        b: Array,
        tolerance: float,
        norm: float,
        progress: Progress | None,
        go_on: GoOn | None = None,
    ) -> tuple[Array, int, bool]:
        """Return u, iterations and success."""
        each = FractionDone(tolerance, progress, go_on)
        if self._kernel is None:
            with one_thread():
                u, iterations, converged = self._solve(b, tolerance, norm, each)
        else:
            limits = MAX_ITERATIONS, DIRECTIONS, REDUCED
            u, iterations, converged = self._kernel.solve(b, tolerance, norm, *limits, each)
        if converged:
            each.finish()
        return u, iterations, converged

    def _solve(self, b: Array, tolerance: float, norm: float, each: GoOn) -> tuple[Array, int, bool]:
        n, norm_b = len(b), float(np.linalg.norm(b))
        x = np.zeros(len(self._weight))
        if norm_b == 0:
            return x[:n], 0, True
        r = self._residual(b, x)
        first = float(np.linalg.norm(r))
        aim, before, space = tolerance * first, float("inf"), _Directions(r)
        for iteration in range(1, MAX_ITERATIONS + 1):
            z = self._precondition(space.last * self._inverse_weight).astype(np.float32)
            estimate = space.extend(z, self._weight * self._product(z.astype(float)))
            stop = not each(estimate / first)
            exhausted = space.full or estimate <= REDUCED * space.start or iteration == MAX_ITERATIONS
            if not (stop or exhausted or estimate <= aim):
                continue
            y = space.added_to(x)
            r = self._residual(b, y)
            residual = self._residual_norm(r)
            rounding = 2 * np.finfo(float).eps * (norm * float(np.linalg.norm(y[:n])) + norm_b)
            limit = max(float(rounding), tolerance * norm_b)
            if residual <= limit or stop or (exhausted and residual > before / 2):
                break
            aim = estimate * min(limit / residual, 0.5)
            if exhausted:
                x, before, space = y, residual, _Directions(r)
        return y[:n], iteration, residual <= limit

    def _product(self, x: Array) -> Array:
        """Return the product of the matrix of displacements and pressures with both."""
        K, n = self._K, self._K.shape[0]
        u, p = x[:n], x[n:]
        forces = K.A @ u + K.D.T @ p
        forces[self._fixed] = 0.0
        return np.concatenate([forces, K.D @ u - p / K.bulk])

    def _residual(self, b: Array, x: Array) -> Array:
        """Return the weighted residual."""
        r = -self._product(x)
        r[: len(b)] += b
        return self._weight * r

    def _residual_norm(self, r: Array) -> float:
        """Return |b - K u|: the pressures that the displacements have are not quite those of the solution."""
        r = r * self._inverse_weight
        n = self._K.shape[0]
        forces = r[:n] + self._K.D.T @ (self._K.bulk * r[n:])
        forces[self._fixed] = 0.0
        return float(np.linalg.norm(forces))

    def _precondition(self, r: Array) -> Array:
        n = self._K.shape[0]
        p = -self._schur.solve(r[n:]) - self._K.kept * r[n:]
        forces = r[:n] - self._K.D.T @ p
        forces[self._fixed] = 0.0
        return np.concatenate([self._cycle.precondition(forces), p])


class _Directions:
    """Directions Z and their products with the matrix, of which the residual is made as small as can be.

    The preconditioner may differ from step to step, as it does.  Source: Saad, SIAM J. Sci. Comput. 14 (1993)
    461-469.
    """

    def __init__(self, r: Array) -> None:
        self.start = float(np.linalg.norm(r))
        self._V = np.empty((DIRECTIONS + 1, len(r)))
        self._Z = np.empty((DIRECTIONS, len(r)), dtype=np.float32)  # as the multigrid cycle gives them
        self._H = np.zeros((DIRECTIONS + 1, DIRECTIONS))
        self._V[0] = r / (self.start or 1.0)
        self._count = 0
        self._y = np.zeros(0)

    @property
    def last(self) -> Array:
        """The last of the orthonormal vectors."""
        return self._V[self._count]

    @property
    def full(self) -> bool:
        """Whether there is no room for more directions."""
        return self._count == DIRECTIONS

    def extend(self, z: NDArray[np.float32], w: Array) -> float:
        """Take a direction and its product; return the smallest norm that the residual can have."""
        from scipy.linalg.blas import daxpy

        k = self._count
        self._Z[k] = z
        for j in range(k + 1):
            self._H[j, k] = self._V[j] @ w
            w = daxpy(self._V[j], w, a=-self._H[j, k])
        self._H[k + 1, k] = np.linalg.norm(w)
        self._V[k + 1] = w / (self._H[k + 1, k] or 1.0)
        self._count = k + 1
        H, goal = self._H[: k + 2, : k + 1], self.start * np.eye(k + 2)[0]
        self._y = np.linalg.lstsq(H, goal, rcond=None)[0]
        return float(np.linalg.norm(goal - H @ self._y))

    def added_to(self, x: Array) -> Array:
        """Return x changed along the directions so that the residual is smallest."""
        x = x.copy()
        for factor, z in zip(self._y, self._Z, strict=False):
            x += factor * z.astype(float)  # NumPy before 2 keeps single precision otherwise
        return x


def _arrays(A: bsr_array) -> tuple[Rows, Rows, Array]:
    """Return what a kernel takes of a matrix of blocks."""
    return A.indptr.astype(np.int32), A.indices.astype(np.int32), np.ascontiguousarray(A.data)


class _Schur:
    """S in single precision, scaled to a diagonal of 1."""

    def __init__(self, K: SplitMatrix, inverse: bsr_array, loose: Mask) -> None:
        from scipy.sparse import diags_array

        free = loose[K.means.ends].any(axis=1)  # around constrained nodes checkerboards have means, too
        means = K.means.matrix @ diags_array(np.where(free, 1.0, 0.0))
        S = (K.D @ inverse @ K.D.T).tocsr() + means @ means.T + diags_array(1 / K.bulk)
        self.scale = 1 / np.sqrt(S.diagonal())
        scale = diags_array(self.scale)
        self.S = (scale @ S @ scale).astype(np.float32).tocsr().tobsr(2 * K.D.blocksize[:1])

    def solve(self, r: Array) -> Array:
        """Return S⁻¹ r, roughly, by conjugate gradients."""
        r = self.scale * r
        size = float(np.abs(r).max(initial=0.0))
        if size == 0:
            return r
        x, r = np.zeros(len(r), dtype=np.float32), (r / size).astype(np.float32)
        p, rr = r.copy(), float(r @ r)
        end = INNER * rr
        for _ in range(INNER_MAX):
            Sp = self.S @ p
            alpha = np.float32(rr / float(p @ Sp))
            x += alpha * p
            r -= alpha * Sp
            old, rr = rr, float(r @ r)
            if rr <= end:
                break
            p *= np.float32(rr / old)
            p += r
        return self.scale * (size * x.astype(float))
