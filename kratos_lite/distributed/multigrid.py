"""The multigrid of `kratos_lite.solvers.multigrid` over ranks, as a preconditioner.

Each rank keeps the rows of its own nodes of every level; a step of the smoother needs one exchange of ghosts.
The coarsest level is factorized on every rank.  Not used over several ranks: lines, planes and patches that
are solved exactly in stretched meshes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.distributed.coarsening import Rows, coarsened
from kratos_lite.distributed.ghosts import Ghosts
from kratos_lite.native import kernels
from kratos_lite.solvers.multigrid import DEGREE, RATIO, STRENGTH
from kratos_lite.typing import Array, Mask

FULL = 600
"""Unknowns of all ranks that are factorized on each."""
FULL_LIMIT = 3000
"""The same where aggregation has come to a halt; above, the coarsest level is smoothed well."""


class Level:
    """One level on this rank: what its kernel calls between steps, with memory of its vectors (all, b)."""

    def __init__(self, ghosts: Ghosts, b: int) -> None:
        self.ghosts, self.b, self.ranks = ghosts, b, ghosts.ranks  # b unknowns of a node
        self.sum, self.max = ghosts.ranks.sum, ghosts.ranks.max
        self.inverse: Any = None

    @property
    def unknowns(self) -> int:
        """Number of unknowns of all ranks."""
        return self.b * int(self.ghosts.offsets[-1])

    def update(self, memory: Any) -> None:
        """Give ghosts the values of their owners."""
        self.ghosts.update(self._nodal(memory))

    def add(self, memory: Any) -> None:
        """Add the values of ghosts to those of their owners."""
        self.ghosts.add(self._nodal(memory))

    def solve(self, c: Any, x: Any) -> bool:
        """Solve A x = c, if it is factorized."""
        if self.inverse is None:
            return False
        own = self.ghosts.own
        forces = np.concatenate(self.ranks.gather(self._nodal(c)[:own].ravel()))
        self._nodal(x)[:own] = (self.inverse @ forces).reshape(own, self.b)
        return True

    def _nodal(self, memory: Any) -> Any:
        return np.frombuffer(memory, np.float32).reshape(-1, self.b)

    def factorize(self, A: Rows) -> None:
        """Take the own rows of the inverse of A, of which each rank has its own rows."""
        ghosts, first = self.ghosts, int(self.ghosts.offsets[self.ranks.rank])
        numbers = np.concatenate([first + np.arange(ghosts.own), ghosts.numbers])
        full = np.zeros((ghosts.own, 6, self.unknowns // 6, 6))
        row = np.repeat(np.arange(ghosts.own), np.diff(A.indptr))
        full[row, :, numbers[A.columns]] = A.data.reshape(-1, 6, 6)
        matrix = np.concatenate(self.ranks.gather(full.reshape(6 * ghosts.own, self.unknowns)))
        inverse = np.linalg.pinv((matrix + matrix.T) / 2, rcond=1e-13, hermitian=True)
        self.inverse = inverse[6 * first : 6 * (first + ghosts.own)]


class Multigrid:
    """V-cycles over ranks, with compiled kernels alone; all ranks call each method."""

    def __init__(self, rank: int) -> None:
        self._kernel = kernels("multigrid").RankMultigrid(DEGREE, RATIO, STRENGTH, rank)
        self.levels: list[Level] = []  # from the finest to the coarsest

    def add_product(self, product: Any, ghosts: Ghosts, fixed: Mask) -> None:
        """Add the finest level, of elements; `fixed` (all, 3) as in `add`."""
        self.levels.append(Level(ghosts, 3))
        self._kernel.add_product(product, ghosts.own, fixed.ravel().astype(np.uint8), self.levels[-1])

    def add(self, A: Any, ghosts: Ghosts, fixed: Mask, P: Any = None) -> None:
        """Add a level of own rows of blocks A, P the prolongator to the one above; `fixed` is (all, b)."""
        self.levels.append(Level(ghosts, fixed.shape[1]))
        self._kernel.add_matrix(A, fixed.ravel().astype(np.uint8), self.levels[-1], P)

    def coarsen(self, modes: Array, all_nodes: int) -> None:
        """Add levels by smoothed aggregation of the last one, with modes (n, b, 6) of its own nodes."""
        last, A = self.levels[-1], None
        while last.unknowns > FULL:
            found = coarsened(self._kernel, last.ghosts, all_nodes, last.b, modes)
            if found is None:
                break
            A, P, modes = found.A, found.P, found.modes
            all_nodes = found.ghosts.own + len(found.ghosts)
            rows = A.indptr, A.columns, A.data.reshape(-1, 6, 6)
            way = P.indptr, P.columns, np.ascontiguousarray(P.data).reshape(-1, last.b, 6)
            self.add(rows, found.ghosts, np.zeros((all_nodes, 6), dtype=bool), way)
            last = self.levels[-1]
        if A is not None and last.unknowns <= FULL_LIMIT:
            last.factorize(A)
        self._kernel.finish()

    def precondition(self, r: Array) -> Array:
        """Return one V-cycle on the residual of own nodes (n · b,)."""
        return np.asarray(self._kernel.cycle(np.ascontiguousarray(r)))
