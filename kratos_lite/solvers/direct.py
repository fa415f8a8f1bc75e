"""Factorizations, made once and kept: dense for small matrices, bands, sparse for larger ones.

Sparse ones come from MKL PARDISO where `pypardiso` is installed, which takes a tenth of the time
and half the memory, and else from SuperLU, which comes with SciPy.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from importlib import import_module
from typing import Any, cast
from weakref import finalize

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.sparsity_pattern import Pattern, dofs_of
from kratos_lite.errors import SolveError
from kratos_lite.solvers.plan import of_band
from kratos_lite.typing import Array, Csr, Ints, Rows

NO_MEMORY = -2
"""PARDISO's error code for too little memory; the others mean a matrix it cannot factorize."""
BUFFERS = 10**8
"""Bytes that such a library takes at its first product; without them OpenBLAS ends the program."""
REPLACED_PIVOTS = 14
"""PARDISO's parameter (from 1) that counts pivots too small to divide by."""


class Unsuitable(Exception):
    """A way of factorizing that is not installed, or does not do for a matrix."""


class Factorization:
    """A factorized matrix A, by ``dense``, ``pardiso`` or ``superlu``; `apply` solves without refinement."""

    def __init__(self, method: str, A: Any, apply: Callable[[Array], Array]) -> None:
        self.method, self.A, self.apply = method, A, apply

    def solve(self, b: Array) -> Array:
        """Return x (n,) of A x = b, refined once."""
        # Source: Higham, Accuracy and Stability of Numerical Algorithms (2002), chapter 12.
        x = self.apply(b)
        return x + self.apply(b - self.A @ x)

    def rows(self, b: Array) -> Array:
        """Return x without refinement of one b (n,), or of several (k, n)."""
        return self.apply(b.T).T


def factorize_dense(A: Array) -> Factorization:
    """Return a full matrix (n, n) factorized: its inverse, as NumPy keeps no other factors."""
    try:
        inverse = np.linalg.inv(A)
    except np.linalg.LinAlgError:
        raise singular() from None
    return Factorization("dense", A, lambda b: inverse @ b)


def factorize(A: Csr, symmetric: bool = True) -> Factorization:
    """Return a sparse matrix (n, n) factorized, by the fastest of `BACKENDS` that does."""
    for backend in BACKENDS:
        try:
            return Factorization(backend.__name__, A, backend(A, symmetric))
        except Unsuitable:
            continue
        except MemoryError:
            raise SolveError(
                f"not enough memory to factorize {A.shape[0]} unknowns; use solver='amg' or a coarser mesh"
            ) from None
    raise singular()


def pardiso(A: Csr, symmetric: bool) -> Callable[[Array], Array]:
    """Factorize with MKL PARDISO: Cholesky with nested dissection, or LU if it is not symmetric."""
    # Where a pivot is not positive (Cholesky) or had to be replaced (LU), SuperLU has to say whether A is
    # singular.
    solvers = _pypardiso()
    if solvers is None:
        raise Unsuitable
    from scipy.sparse import csr_array, triu

    solver = solvers.PyPardisoSolver(mtype=2 if symmetric else 11)
    half = csr_array(triu(A) if symmetric else A)
    release = finalize(half, solver.free_memory, everything=True)
    release.atexit = False  # the process gives all memory back anyway
    try:
        solver.factorize(half)
    except ValueError:
        raise Unsuitable from None
    except solvers.PyPardisoError as error:
        raise (MemoryError if error.value == NO_MEMORY else Unsuitable) from None
    if solver.get_iparm(REPLACED_PIVOTS):
        raise Unsuitable
    return lambda b: solver.solve(half, b)


@cache
def _pypardiso() -> Any:
    """Return the module that calls MKL PARDISO; None where it is not installed."""
    try:
        return import_module("pypardiso.pardiso_wrapper")
    except ImportError:
        return None


def superlu(A: Csr, symmetric: bool) -> Callable[[Array], Array]:
    """Factorize with SuperLU: pivots on the diagonal and minimum degree where A is symmetric."""
    from scipy.sparse.linalg import splu

    reserve_buffers(of_scipy=True)

    options: dict[str, Any] = {"permc_spec": "COLAMD"}
    if symmetric:
        options = {
            "permc_spec": "MMD_AT_PLUS_A",
            "diag_pivot_thresh": 0.0,
            "options": {"SymmetricMode": True},
        }
    try:
        factors = splu(A.tocsc(), **options)
    except RuntimeError as error:
        raise singular(f" ({error})") from None
    return factors.solve


def singular(detail: str = "") -> SolveError:
    """Return the error for a singular matrix."""
    return SolveError(f"the stiffness matrix is singular{detail}: part of the body can still move")


BACKENDS: tuple[Callable[[Csr, bool], Callable[[Array], Array]], ...] = (pardiso, superlu)
"""Ways to factorize a sparse matrix, fastest first; each returns b -> x, or raises Unsuitable."""


# ---- bands: one sparsity pattern, factorized in every step of a small body by LAPACK ----------


class Factorizer:
    """Factorizes matrices (3n, 3n) of one sparsity pattern; rows are exchanged unless they are symmetric."""

    def __init__(self, pattern: Pattern, symmetric: bool = True) -> None:
        self.symmetric = symmetric
        rows = pattern.rows()
        self._nodes, nodal_width = _numbering(pattern, rows)
        self.width = w = 3 * nodal_width + 2
        self._height = w + 1 if symmetric else 3 * w + 1  # exchanged rows need room
        self.plan = of_band(3 * pattern.n_nodes, w, self._height)
        if self.plan.method == "band":
            self._dofs = dofs_of(self._nodes)
            self._prepare(rows, pattern.indices)

    def _prepare(self, rows: Ints, columns: Rows) -> None:
        """Note where the entries of a matrix go: column by column, as LAPACK wants a band."""
        place = np.empty_like(self._nodes)
        place[self._nodes] = np.arange(len(place))
        axes = np.arange(3)
        i = np.broadcast_to((3 * place[rows])[:, None, None] + axes[:, None], (len(rows), 3, 3)).ravel()
        j = np.broadcast_to((3 * place[columns])[:, None, None] + axes, (len(rows), 3, 3)).ravel()
        above = 0 if self.symmetric else 2 * self.width
        to = j * self._height + above + i - j
        kept = np.flatnonzero(i >= j) if self.symmetric else np.arange(len(i))
        self._from = kept[np.argsort(to[kept])]
        self._to = to[self._from]

    def factorize(self, A: BlockMatrix) -> Callable[[Array], Array]:
        """Return what gives x of A x = b, both (3n,) or (3n, k), for a matrix with the pattern."""
        if self.plan.method == "sparse":
            return factorize(A.scipy().tocsr(), symmetric=self.symmetric).solve
        band = np.zeros(len(self._dofs) * self._height)
        band[self._to] = A.data.ravel().take(self._from)
        columns = band.reshape(-1, self._height).T
        apply = (_cholesky if self.symmetric else _lu)(columns, self.width, self._dofs)

        def solve(b: Array) -> Array:
            x = np.empty(b.shape)
            x[self._dofs] = apply(b[self._dofs])
            return x

        return solve


def _cholesky(band: Array, width: int, dofs: Ints) -> Callable[[Array], Array]:
    """Factorize a symmetric band (width + 1, n), by columns from the diagonal down."""
    from scipy.linalg.lapack import dpbtrf, dpbtrs

    factor, info = dpbtrf(band, lower=1, overwrite_ab=1)
    if info:
        node, axis = divmod(int(dofs[info - 1]), 3)
        raise SolveError(
            f"the matrix is not positive definite: the pivot of node row {node}, axis {'xyz'[axis]}, is "
            "not > 0; the body has lost its stiffness or can still move; take a smaller step or add supports"
        )
    return lambda b: dpbtrs(factor, b, lower=1, overwrite_b=1)[0]


def _lu(band: Array, width: int, dofs: Ints) -> Callable[[Array], Array]:
    """Factorize a band (3 width + 1, n) by columns, with exchanges of rows."""
    from scipy.linalg.lapack import dgbtrf, dgbtrs

    factors, pivots, info = dgbtrf(band, width, width, overwrite_ab=1)
    if info:
        raise singular()
    return lambda b: dgbtrs(factors, width, width, b, pivots, overwrite_b=1)[0]


def _numbering(pattern: Pattern, rows: Ints) -> tuple[Ints, int]:
    """Return the nodes (n,) in the order with the least band, and its width in nodes."""
    graph, order = cuthill_mckee(pattern)
    orders = [np.arange(pattern.n_nodes), order, _layers(graph, order)]
    widths = [nodal_width(pattern, rows, order) for order in orders]
    best = int(np.argmin(widths))
    return orders[best], widths[best]


def cuthill_mckee(pattern: Pattern) -> tuple[Csr, Ints]:
    """Return the graph of the nodes (n, n), and their reverse Cuthill–McKee order (n,)."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    n = pattern.n_nodes
    graph = csr_array((np.ones(len(pattern.indices)), pattern.indices, pattern.indptr), shape=(n, n))
    return graph, reverse_cuthill_mckee(graph, symmetric_mode=True).astype(np.int64)


def nodal_width(pattern: Pattern, rows: Ints, order: Ints) -> int:
    """Return the largest distance in an order of nodes from one to a neighbor."""
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return int(np.abs(place[rows] - place[pattern.indices]).max(initial=0))


def _layers(graph: Csr, order: Ints) -> Ints:
    """Return the nodes by their distance from the end farthest from the last node of an order."""
    from scipy.sparse.csgraph import dijkstra

    distance = dijkstra(graph, indices=order[-1], unweighted=True)
    reached = np.isfinite(distance)
    end = np.flatnonzero(distance == distance[reached].max())
    layer = dijkstra(graph, indices=end, unweighted=True, min_only=True)
    place = np.empty(len(order))
    place[order] = np.arange(len(order))
    layers = [np.flatnonzero(layer == step) for step in np.unique(layer)]
    for before, nodes in zip([None, *layers], layers, strict=False):
        if before is not None:
            near = graph[nodes][:, before]
            place[nodes] = near @ place[before] / np.maximum(near.sum(axis=1), 1)
        first = 0 if before is None else place[before].max() + 1
        place[nodes[np.argsort(place[nodes], kind="stable")]] = first + np.arange(len(nodes))
    return np.argsort(place)


# ---- libraries of dense algebra: their memory and threads -------------------------------------------


def reserve_buffers(of_scipy: bool = False) -> None:
    """Let the library of NumPy, or of SciPy, take its memory now; MemoryError where there is not enough."""
    np.empty(BUFFERS, dtype=np.uint8)
    if of_scipy:
        from scipy.linalg.lapack import dpotrf

        dpotrf(np.eye(2))
    else:
        np.linalg.inv(np.eye(2))


@cache
def _controller(of_scipy: bool) -> Any:
    """Return what limits the threads of NumPy, and SciPy if it is loaded; None where it is not installed."""
    try:
        from threadpoolctl import ThreadpoolController
    except ImportError:
        return None
    return ThreadpoolController()


def one_thread() -> AbstractContextManager[Any]:
    """Keep dense algebra to one thread within a ``with`` block, where threadpoolctl is installed."""
    # Threads that wait for the next small product take time from others, and their sums may differ each time.
    controller = _controller("scipy.linalg" in sys.modules)  # libraries that come later do not heed it
    if controller is None:
        return nullcontext()
    return cast("AbstractContextManager[Any]", controller.limit(limits=1, user_api="blas"))
