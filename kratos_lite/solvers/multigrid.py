"""Conjugate gradients with algebraic multigrid: smoothed aggregation from the six rigid modes.

In thin flat bodies the modes of constant curvature join them, without which plates bend slowly.
Quadratic elements get a level of linear elements on their corner nodes first (p-multigrid), or, in thin
bodies, one of the lines across the thickness there.
The compiled kernels do all of it; without them pyamg makes the hierarchy.
On stretched meshes the kernels smooth lines or small planes of close nodes exactly and aggregate them
whole; in large planes, and where nodes have few close ones, they aggregate close nodes alone.
Source: Vaněk, Mandel & Brezina, Computing 56 (1996) 179-196; Adams, Brezina, Hu & Tuminaro, J. Comput.
Phys. 188 (2003) 593-610 (Chebyshev smoothing).
"""

from __future__ import annotations

from copy import copy
from typing import Any, Protocol

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix, dependent_rows
from kratos_lite.assembly.matrix_free import MatrixFree
from kratos_lite.native import kernels
from kratos_lite.solvers.coarse_level import PCoarseLevel
from kratos_lite.solvers.constraints import rigid_modes
from kratos_lite.solvers.direct import one_thread
from kratos_lite.solvers.iteration import MAX_ITERATIONS, GoOn, conjugate_gradients
from kratos_lite.solvers.plate_level import bending_modes, is_very_thin, plate_axes, plate_level
from kratos_lite.typing import Array, Mask

DEGREE = 2
"""Degree of the Chebyshev smoother: 1 … 3 cost the same in all."""
RATIO = 12.0
"""Largest to smallest eigenvalue that a smoother has to damp."""
STRENGTH = 0.005
"""|A_ij| / sqrt(|A_ii| |A_jj|) below this means a stiffness contrast: the nodes do not aggregate."""

CLOSER = 0.2
"""Factor on distances across a plate: there, nodes above each other are close in cubes of cells, too."""


class Solver(Protocol):
    """What solves A x = b for one right side after another."""

    levels: list[int]

    def precondition(self, r: Array) -> Array:
        """Return about A⁻¹ r (3n,), or that of several vectors (k, 3n)."""

    def solve(
        self, b: Array, tolerance: float, norm: float, each: GoOn | None = None
    ) -> tuple[Array, int, bool]:
        """Return x, iterations and success; b and x (3n,) are zero at fixed components.

        After each iteration `each` is called with the residual as a fraction of |b|; False stops.
        """


def multigrid(
    A: BlockMatrix | MatrixFree, free: Mask, points: Array, linear: PCoarseLevel | None = None
) -> Compiled | Pyamg:
    """Return the solver of A on its free components (3n,)."""
    if kernels("multigrid") is None:
        return Pyamg(A.assembled() if isinstance(A, MatrixFree) else A, free, points, linear)
    return Compiled(A, free, points, linear)


class Compiled:
    """The hierarchy of the kernels.  It keeps the memory of A, which must not change."""

    def __init__(
        self,
        A: BlockMatrix | MatrixFree,
        free: Mask,
        points: Array,
        linear: PCoarseLevel | None,
        degree: int = DEGREE,
    ) -> None:
        axes = None if isinstance(A, MatrixFree) else plate_axes(points, free)
        thin = 0 if axes is None else 2 if is_very_thin(points, axes) else 1
        places = np.ascontiguousarray(points if axes is None else _closer(points, axes[:, 0]), dtype=float)
        self._module: Any = kernels("multigrid")
        self._added = A.added if isinstance(A, MatrixFree) else None
        fixed = (~free).astype(np.uint8)
        settings = fixed, places, degree, RATIO, STRENGTH
        if isinstance(A, MatrixFree):
            self._kernel = self._module.Multigrid(A.product, *settings)
        else:
            self._kernel = self._module.Multigrid(self._matrix(A), *settings, thin)
        self.linear: PCoarseLevel | None = None  # what is next to the finest level, if it is that
        self._level = 0  # where cycles begin
        lines = self._kernel.labels()
        plate = None
        if linear is not None and len(lines) and linear.weights.ndim == 1:
            plate = plate_level(points, free, axes, lines, linear)
        if plate is not None:
            self._kernel.aggregate_plate(plate.indptr, plate.indices, plate.blocks, plate.modes)
        else:
            self._aggregate(A, fixed, points, places, linear, axes)
        self.levels: list[int] = self._kernel.sizes()
        self.clusters: list[int] = self._kernel.clusters()
        self.memory: int = self._kernel.bytes()
        self.complexity: float = self._kernel.complexity()

    def _matrix(self, A: BlockMatrix) -> Any:
        matrix = self._module.Matrix(A.indptr, A.indices, A.data)
        if A.ties is not None:
            matrix.tie(self._matrix(A.ties[0]), *dependent_rows(A.ties[1]))
        return matrix

    def _aggregate(
        self,
        A: BlockMatrix | MatrixFree,
        fixed: Any,
        points: Array,
        places: Array,
        linear: PCoarseLevel | None,
        axes: Array | None,
    ) -> None:
        """Aggregate nodes, or those of the linear level."""
        if linear is not None and self._kernel.has_planes() and not linear.halved:
            linear = None  # tetrahedra: their middle nodes are too far from their corners
        self.linear = linear
        X = points if linear is None else points[linear.nodes]
        modes = rigid_modes(X) if axes is None or self._kernel.has_planes() else bending_modes(X, axes)
        if linear is None:
            self._kernel.aggregate(modes, self._matrix(A.assembled()) if isinstance(A, MatrixFree) else None)
            return
        self._kernel.aggregate_linear(
            self._matrix(linear.K),
            np.ascontiguousarray(fixed.reshape(-1, 3)[linear.nodes]).ravel(),
            linear.indptr,
            linear.indices,
            linear.weights,
            places[linear.nodes],
            modes,
        )

    def below(self) -> Compiled:
        """Return what makes cycles from the next level on."""
        below = copy(self)
        below._level += 1
        return below

    def precondition(self, r: Array) -> Array:
        """Return one V-cycle on r (3n,), or on several vectors (k, 3n), for which matrices are read once."""
        return self._kernel.cycle(r, self._level)

    def with_pressures(self, *matrices: Any) -> Any:
        """Return the kernel that solves for pressures beside the displacements."""
        return self._module.Pressures(self._kernel, *matrices)

    def solve(
        self, b: Array, tolerance: float, norm: float, each: GoOn | None = None
    ) -> tuple[Array, int, bool]:
        """Return x, iterations and success."""
        return self._kernel.solve(b, tolerance, norm, MAX_ITERATIONS, each, self._added)


def _closer(points: Array, normal: Array) -> Array:
    """Return points with shorter distances along a normal."""
    return points - (1 - CLOSER) * np.outer(points @ normal, normal)


class Pyamg:
    """The hierarchy of pyamg: block Gauss-Seidel, forward before and backward after each coarser level."""

    def __init__(self, A: BlockMatrix, free: Mask, points: Array, linear: PCoarseLevel | None = None) -> None:
        import pyamg  # noqa: F401 (libraries that are loaded later would not heed the limit)

        self._A = uncoupled(A, free)
        with one_thread():
            hierarchy = (
                aggregated(self._A, free, points)
                if linear is None
                else above_linear(self._A, free, points, linear)
            )
        self._cycle = hierarchy.aspreconditioner(cycle="V")
        self.levels: list[int] = [level.A.shape[0] for level in hierarchy.levels]

    def precondition(self, r: Array) -> Array:
        """Return one V-cycle on r (3n,), or on several vectors (k, 3n)."""
        return (self._cycle @ r.T).T

    def solve(
        self, b: Array, tolerance: float, norm: float, each: GoOn | None = None
    ) -> tuple[Array, int, bool]:
        """Return x, iterations and success."""
        with one_thread():
            return conjugate_gradients(self._A.times, b, self.precondition, tolerance, norm, each)


FORWARD = ("block_gauss_seidel", {"sweep": "forward"})
BACKWARD = ("block_gauss_seidel", {"sweep": "backward"})
SMOOTHING = ("jacobi", {"omega": 2.0, "weighting": "local"})
"""Of the prolongator; row sums bound the eigenvalues, as estimates by random vectors differ each time."""


def aggregated(A: BlockMatrix, free: Mask, points: Array) -> Any:
    """Return pyamg's hierarchy of smoothed aggregation."""
    import pyamg

    return pyamg.smoothed_aggregation_solver(
        A.scipy(),
        B=rigid_modes(points) * free[:, None],
        strength=("symmetric", {"theta": 0.0}),
        smooth=SMOOTHING,
        presmoother=FORWARD,
        postsmoother=BACKWARD,
        improve_candidates=None,
        max_coarse=200,
        coarse_solver="splu",
    )


def above_linear(A: BlockMatrix, free: Mask, points: Array, linear: PCoarseLevel) -> Any:
    """Return pyamg's hierarchy of the linear elements below a level of quadratic ones."""
    from pyamg import MultilevelSolver
    from pyamg.relaxation.smoothing import change_smoothers
    from scipy.sparse import bsr_array, csr_array, diags_array, identity, kron

    corners = free.reshape(-1, 3)[linear.nodes].ravel()
    below = aggregated(uncoupled(linear.K, corners), corners, points[linear.nodes])
    n, m, weights = len(points), len(linear.nodes), (linear.weights, linear.indices, linear.indptr)
    if linear.weights.ndim == 1:
        P = kron(csr_array(weights, shape=(n, m)), identity(3))
    else:
        P = bsr_array(weights, shape=(3 * n, 3 * m))
    top = MultilevelSolver.Level()
    top.A = A.scipy()
    top.P = (diags_array(free * 1.0) @ P @ diags_array(corners * 1.0)).tocsr()
    top.R = top.P.T.tocsr()
    hierarchy = MultilevelSolver([top, *below.levels], coarse_solver="splu")
    change_smoothers(hierarchy, FORWARD, BACKWARD)
    return hierarchy


def uncoupled(A: BlockMatrix, free: Mask) -> BlockMatrix:
    """Return a copy of A with the rows and columns of components that are not free cleared."""
    mask = free.reshape(-1, 3)
    data = A.data * mask[A.rows()][:, :, None] * mask[A.indices][:, None, :]
    diagonal = A.diagonal_blocks()
    rows = A.indices[diagonal]
    for axis in range(3):
        fixed = diagonal[~mask[rows, axis]]
        own = A.data[fixed, axis, axis]
        data[fixed, axis, axis] = np.where(own > 0, own, 1.0)
    return BlockMatrix(data, A.indices, A.indptr)
