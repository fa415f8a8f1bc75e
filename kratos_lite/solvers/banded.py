"""Band matrices: one sparsity pattern, factorized in every time step of a small body by LAPACK.

Nodes are renumbered once so that all entries lie near the diagonal; from then on the place of every entry
in the band is known.  Where the band is so wide that a sparse factorization takes less work, `direct`
makes that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.errors import SolveError
from kratos_lite.solvers import direct
from kratos_lite.solvers.plan import of_band
from kratos_lite.typing import Array, Ints, Rows

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class BandFactors:
    """The factors of a band, of which `apply` solves for one right side, or several, in its own order."""

    def __init__(self, apply: Callable[[Array], Array], dofs: Ints) -> None:
        self.apply, self._dofs = apply, dofs

    def solve(self, b: Array) -> Array:
        """Return x of A x = b, both (3n,) or (3n, k)."""
        x = np.empty(b.shape)
        x[self._dofs] = self.apply(b[self._dofs])
        return x


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
            self._dofs = (3 * self._nodes[:, None] + np.arange(3)).ravel()
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

    def factorize(self, A: BlockMatrix) -> BandFactors | direct.Factorization:
        """Return the factors of a matrix with the pattern; their `solve` gives x of A x = b."""
        if self.plan.method == "sparse":
            return direct.factorize(A.scipy().tocsr(), symmetric=self.symmetric)
        band = np.zeros(len(self._dofs) * self._height)
        band[self._to] = A.data.ravel().take(self._from)
        columns = band.reshape(-1, self._height).T
        apply = (_cholesky if self.symmetric else _lu)(columns, self.width, self._dofs)
        return BandFactors(apply, self._dofs)


def _cholesky(band: Array, width: int, dofs: Ints) -> Callable[[Array], Array]:
    """Factorize a symmetric band (width + 1, n), by columns from the diagonal down."""
    from scipy.linalg.lapack import dpbtrf, dpbtrs

    factor, info = dpbtrf(band, lower=1, overwrite_ab=1)
    if info:
        node, axis = divmod(int(dofs[info - 1]), 3)
        raise SolveError(
            f"the matrix is not positive definite: the pivot of node row {node}, axis {'xyz'[axis]}, is "
            "not > 0; the body has lost its stiffness or can still move; take a smaller step or hold it"
        )
    return lambda b: dpbtrs(factor, b, lower=1, overwrite_b=1)[0]


def _lu(band: Array, width: int, dofs: Ints) -> Callable[[Array], Array]:
    """Factorize a band (3 width + 1, n) by columns, with exchanges of rows."""
    from scipy.linalg.lapack import dgbtrf, dgbtrs

    factors, pivots, info = dgbtrf(band, width, width, overwrite_ab=1)
    if info:
        raise direct.singular()
    return lambda b: dgbtrs(factors, width, width, b, pivots, overwrite_b=1)[0]


def _numbering(pattern: Pattern, rows: Ints) -> tuple[Ints, int]:
    """Return the nodes (n,) in the order with the least band, and its width in nodes.

    The orders are that of the mesh, reverse Cuthill–McKee, and layers from one end of the body.
    """
    graph, order = cuthill_mckee(pattern)
    orders = [np.arange(pattern.n_nodes), order, _layers(graph, order)]
    widths = [nodal_width(pattern, rows, order) for order in orders]
    best = int(np.argmin(widths))
    return orders[best], widths[best]


def cuthill_mckee(pattern: Pattern) -> tuple[csr_array, Ints]:
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


def _layers(graph: csr_array, order: Ints) -> Ints:
    """Return the nodes by their distance from the end farthest from the last node of an order.

    Within a layer they follow the mean place of their neighbors in the layer before.  The first layers
    of Cuthill–McKee start from one corner and are wider than those of a long body.
    """
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
