"""The stiffness of a mesh that ranks share, in its own format, and the multigrid of it.

Nodes are renumbered: own ones with equations, ghosts with equations by number, and the others, where all is
prescribed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.matrix_free import MatrixFree
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.distributed.communicator import Alone
from kratos_lite.distributed.cut import Part
from kratos_lite.distributed.multigrid import Ghosts, Multigrid
from kratos_lite.solvers.coarse_level import has_corners, has_middle_nodes, is_stretched, p_coarse_level
from kratos_lite.solvers.constraints import rigid_modes
from kratos_lite.solvers.multigrid import multigrid
from kratos_lite.solvers.plan import Facts, needs_no_matrix
from kratos_lite.solvers.plate_level import plate_axes
from kratos_lite.typing import Array, Ints, Mask, Progress


class OneProcess:
    """The multigrid of one process, on own unknowns."""

    def __init__(
        self, K: BlockMatrix | MatrixFree, free: Mask, points: Array, groups: Sequence[ElementGroup], own: int
    ) -> None:
        self._multigrid = multigrid(K, free.ravel(), points, p_coarse_level(points, groups))
        self._all, self._own = 3 * len(points), own

    def precondition(self, r: Array) -> Array:
        """Return one V-cycle on the residual of own unknowns."""
        whole = np.zeros(self._all)
        whole[: self._own] = r
        return self._multigrid.precondition(whole)[: self._own]


class SharedStiffness:
    """K of the own nodes of a rank, in blocks or, of quadratic elements, as a product alone."""

    def __init__(
        self, ranks: Alone, part: Part, progress: Progress | None = None, own_rows: bool = False
    ) -> None:
        self.ranks, number = ranks, part.number
        offsets = np.concatenate([[0], np.cumsum(ranks.gather(len(part.own)))])
        own = np.zeros(len(number), dtype=bool)
        own[part.own] = True
        others = np.flatnonzero((number >= 0) & ~own)
        others = others[np.argsort(number[others])]
        order = np.concatenate([part.own, others, np.flatnonzero((number < 0) & ~own)])
        place = np.empty(len(number), dtype=np.int32)
        place[order] = np.arange(len(order), dtype=np.int32)
        self.ghosts = Ghosts(ranks, offsets, number[others])
        self.points, self.free, self.held = part.points[order], part.free[order], part.held[order]
        self.number = number[order]
        self.groups = [replace(group, nodes=place[group.nodes]) for group in part.groups]
        self.K: BlockMatrix | MatrixFree
        if not own_rows and self._needs_no_matrix():
            self.K = MatrixFree(self.points, self.groups)
        else:
            self.K = self._matrix(progress, own_rows or ranks.size > 1)

    def _needs_no_matrix(self) -> bool:
        """Return whether products do on all ranks: quadratic elements of like stiffness, compact cells."""
        ranks, groups = self.ranks, self.groups
        moduli = [float(np.abs(group.material.C).max()) for group in groups]
        takes = ranks.all(bool(groups) and all(map(MatrixFree.takes, groups)))
        facts = Facts(
            0,
            has_product=lambda: takes and ranks.any(has_middle_nodes(groups)),
            contrast=lambda: ranks.max(max(moduli)) / ranks.min(min(moduli)),
            is_stretched=lambda: ranks.any(is_stretched(self.points, groups)),
            is_plate=lambda: ranks.size == 1 and plate_axes(self.points, self.free.ravel()) is not None,
        )
        return needs_no_matrix(facts)

    def _matrix(self, progress: Progress | None, own_rows: bool) -> BlockMatrix:
        """Return the rows of own nodes, or all, for the multigrid of one process."""
        pattern = Pattern(len(self.points), [group.nodes for group in self.groups])
        K = assemble_stiffness(self.points, self.groups, pattern, progress)
        if not own_rows:
            return K
        stop = int(K.indptr[self.ghosts.own])
        return BlockMatrix(K.data[:stop], K.indices[:stop], K.indptr[: self.ghosts.own + 1])

    @property
    def own(self) -> int:
        """Number of unknowns of this rank."""
        return 3 * self.ghosts.own

    def times(self, x: Array) -> Array:
        """Return K x of own unknowns; x and K x are 0 where something is prescribed."""
        all_x = np.zeros((len(self.points), 3))
        all_x[: self.ghosts.own] = x.reshape(-1, 3)
        self.ghosts.update(all_x)
        y: Array = np.asarray(self.K @ all_x.ravel())[: self.own]
        return y * self.free[: self.ghosts.own].ravel()

    def norm(self) -> float:
        """Return the largest row sum of |K|."""
        return float(self.ranks.max(self.K.norm()))

    def multigrid(self) -> Multigrid | OneProcess:
        """Return the multigrid of K: on one rank that of one process, which takes stretched cells, too."""
        if self.ranks.size == 1:
            return OneProcess(self.K, self.free, self.points, self.groups, self.own)
        found, fixed, own = Multigrid(self.ranks.rank), ~self.free, self.ghosts.own
        if isinstance(self.K, MatrixFree):
            found.add_product(self.K.product, self.ghosts, fixed)
        else:
            found.add((self.K.indptr, self.K.indices, self.K.data), self.ghosts, fixed)
        nodes = np.arange(len(self.points))
        if self.ranks.any(has_middle_nodes(self.groups)) and self.ranks.all(has_corners(self.groups)):
            nodes, own = self._add_linear(found, fixed)
        found.coarsen(self.modes(self.points[nodes[:own]], self.free[nodes[:own]]), len(nodes))
        return found

    def modes(self, points: Array, free: Mask) -> Array:
        """Return the rigid-body modes (m, 3, 6) at own nodes, 0 where they are not free."""
        count = max(int(self.ranks.sum(len(points))), 1)
        modes = rigid_modes(points, self.ranks.sum(points.sum(axis=0)) / count)
        return (modes * free.reshape(-1, 1)).reshape(-1, 3, 6)

    def _add_linear(self, multigrid: Multigrid, fixed: Mask) -> tuple[Ints, int]:
        """Add the level of linear elements; return its nodes, and how many of them are own ones."""
        n, own = len(self.points), self.ghosts.own
        if self.groups:
            linear = p_coarse_level(self.points, self.groups, whole=False)
            assert linear is not None
            nodes, K, weights = linear.nodes, linear.K, (linear.indptr, linear.indices, linear.weights)
        else:  # a rank without elements
            nodes, none = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int32)
            weights = np.zeros(n + 1, dtype=np.int32), none, np.zeros(0)
            K = BlockMatrix(np.zeros((0, 3, 3)), none, np.zeros(1, dtype=np.int32))
        own_corners = int(np.searchsorted(nodes, own))
        offsets = np.concatenate([[0], np.cumsum(self.ranks.gather(own_corners))])
        number = np.full((n, 1), -1, dtype=np.int64)
        number[nodes[:own_corners], 0] = offsets[self.ranks.rank] + np.arange(own_corners)
        self.ghosts.update(number)
        known = int(np.searchsorted(nodes, own + len(self.ghosts)))
        ghosts = Ghosts(self.ranks, offsets, number[nodes[own_corners:known], 0])
        indptr, indices, values = weights
        stop, rows = int(indptr[own]), int(K.indptr[own_corners])
        A = K.indptr[: own_corners + 1], K.indices[:rows], K.data[:rows]
        P = (
            indptr[: own + 1].astype(np.int32),
            indices[:stop].astype(np.int32),
            values[:stop].astype(np.float32),
        )
        multigrid.add(A, ghosts, fixed[nodes], P)
        return nodes, own_corners
