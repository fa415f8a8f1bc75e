"""Conjugate gradients with algebraic multigrid: smoothed aggregation from the six rigid modes.

Quadratic elements get a level of linear elements on their corner nodes first (p-multigrid).
The compiled kernels do all of it; without them pyamg makes the hierarchy.
On stretched meshes the kernels smooth lines or planes of close nodes exactly and aggregate them whole.
Source: Vaněk, Mandel & Brezina, Computing 56 (1996) 179-196; Adams, Brezina, Hu & Tuminaro, J. Comput.
Phys. 188 (2003) 593-610 (Chebyshev smoothing).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from kratos_lite.blockmatrix import BlockMatrix, LinearLevel
from kratos_lite.native import kernels
from kratos_lite.solvers.common import Progress
from kratos_lite.solvers.iteration import MAX_ITERATIONS, Share, conjugate_gradients
from kratos_lite.supports import rigid_modes

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
GoOn = Callable[[float], bool]

DEGREE, QUADRATIC_DEGREE = 2, 3
"""Degrees of the Chebyshev smoother, of linear and of quadratic elements."""
RATIO = 20.0
"""Largest to smallest eigenvalue that a smoother has to damp."""
STRENGTH = 0.005
"""|A_ij| below this share of sqrt(|A_ii| |A_jj|) means unlike materials: the nodes do not aggregate."""


class Solver(Protocol):
    """What solves A x = b for one right side after another."""

    levels: list[int]

    def solve(
        self, b: Array, tolerance: float, norm: float, progress: Progress | None, go_on: GoOn | None = None
    ) -> tuple[Array, int, bool]:
        """Return x, iterations and success; b and x (3n,) are zero at fixed components.

        After each iteration `go_on` is told the residual, as a share of |b|, and may say stop.
        """


def multigrid(A: BlockMatrix, free: Mask, points: Array, linear: LinearLevel | None = None) -> Solver:
    """Return the solver of A on its free components (3n,).

    Parameters
    ----------
    A : blocks, (3n, 3n).
    free : (3n,) the components that are unknown; rows and columns of the others do not matter.
    points : (n, 3) m, from which come the rigid modes.
    linear : the linear elements within quadratic ones.
    """
    compiled = kernels("multigrid")
    return Pyamg(A, free, points) if compiled is None else Compiled(compiled, A, free, points, linear)


class Compiled:
    """The hierarchy of the kernels.  It keeps the memory of A, which must not change.

    Attributes
    ----------
    levels : unknowns of each level.
    clusters : parts of each level that its smoother solves exactly; 0 where these are the single nodes.
    memory : bytes of the hierarchy, which is kept in single precision.
    complexity : numbers in the matrices of all levels to those of the finest one.
    """

    def __init__(self, module: Any, A: BlockMatrix, free: Mask, points: Array, linear: LinearLevel | None):
        fixed, points = (~free).astype(np.uint8), np.ascontiguousarray(points, dtype=float)
        matrix = module.Matrix(A.indptr, A.indices, A.data)
        self._kernel = module.Multigrid(matrix, fixed, points, DEGREE, QUADRATIC_DEGREE, RATIO, STRENGTH)
        if linear is None:
            self._kernel.aggregate(rigid_modes(points))
        else:
            K = linear.K
            self._kernel.aggregate_linear(
                module.Matrix(K.indptr, K.indices, K.data),
                np.ascontiguousarray(fixed.reshape(-1, 3)[linear.nodes]).ravel(),
                linear.indptr,
                linear.indices,
                linear.weights,
                points[linear.nodes],
                rigid_modes(points[linear.nodes]),
            )
        self.levels: list[int] = self._kernel.sizes()
        self.clusters: list[int] = self._kernel.clusters()
        self.memory: int = self._kernel.bytes()
        self.complexity: float = self._kernel.complexity()

    def precondition(self, r: Array) -> Array:
        """Return one V-cycle on r (3n,)."""
        return np.asarray(self._kernel.cycle(r))

    def solve(
        self, b: Array, tolerance: float, norm: float, progress: Progress | None, go_on: GoOn | None = None
    ) -> tuple[Array, int, bool]:
        """Return x, iterations and success."""
        share = Share(tolerance, progress) if progress else None

        def each(residual: float) -> bool:
            if share:
                share(residual)
            return go_on is None or go_on(residual)

        x, iterations, converged = self._kernel.solve(b, tolerance, norm, MAX_ITERATIONS, each)
        return x, iterations, converged


class Pyamg:
    """The hierarchy of pyamg."""

    def __init__(self, A: BlockMatrix, free: Mask, points: Array) -> None:
        import pyamg

        self._A = uncoupled(A, free)
        smoother = ("block_gauss_seidel", {"sweep": "symmetric"})
        hierarchy = pyamg.smoothed_aggregation_solver(
            self._A.scipy(),
            B=rigid_modes(points) * free[:, None],
            strength=("symmetric", {"theta": 0.0}),
            presmoother=smoother,
            postsmoother=smoother,
            improve_candidates=None,
            max_coarse=200,
            coarse_solver="splu",
        )
        self._cycle = hierarchy.aspreconditioner(cycle="V")
        self.levels: list[int] = [level.A.shape[0] for level in hierarchy.levels]

    def precondition(self, r: Array) -> Array:
        """Return one V-cycle on r (3n,)."""
        return np.asarray(self._cycle @ r)

    def solve(
        self, b: Array, tolerance: float, norm: float, progress: Progress | None, go_on: GoOn | None = None
    ) -> tuple[Array, int, bool]:
        """Return x, iterations and success; `go_on` is not asked."""
        return conjugate_gradients(self._A, b, self.precondition, tolerance, norm, progress=progress)


def uncoupled(A: BlockMatrix, free: Mask) -> BlockMatrix:
    """Return a copy of A with the rows and columns of components that are not free cleared.

    Their diagonal entries stay, so that the matrix keeps its scale.
    """
    mask = free.reshape(-1, 3)
    data = A.data * mask[A.rows()][:, :, None] * mask[A.indices][:, None, :]
    diagonal = A.diagonal_blocks()
    rows = A.indices[diagonal]
    for axis in range(3):
        fixed = diagonal[~mask[rows, axis]]
        own = A.data[fixed, axis, axis]
        data[fixed, axis, axis] = np.where(own > 0, own, 1.0)
    return BlockMatrix(data, A.indices, A.indptr)
