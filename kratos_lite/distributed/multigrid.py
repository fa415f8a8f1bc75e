"""The multigrid of `kratos_lite.solvers.multigrid` over ranks, as a preconditioner.

Each rank keeps the rows of its own nodes of every level; a step of the smoother needs one exchange of ghosts.
The coarsest level is factorized on every rank.  Not used over several ranks: lines, planes and patches that
are solved exactly in stretched meshes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kratos_lite.distributed.coarsening import Coarser, coarsened
from kratos_lite.distributed.communicator import Alone
from kratos_lite.distributed.ghosts import Ghosts
from kratos_lite.native import kernels
from kratos_lite.solvers.multigrid import DEGREE, RATIO
from kratos_lite.typing import Array, Mask

FULL = 600
"""Unknowns of all ranks that are factorized on each."""
FULL_LIMIT = 3000
"""The same where aggregation has come to a halt; above, the coarsest level is smoothed well."""
LANCZOS = 15
"""Steps that estimate the largest eigenvalue."""
MARGIN = 1.15
"""Factor on it for the steps not made."""


class Level:
    """One level on this rank: its kernel, ghosts and vectors.

    Parameters
    ----------
    kernel : a SharedLevel.
    ghosts : copies of nodes of other ranks.
    b : unknowns of a node.
    fixed : (all, b) bool, of own nodes, ghosts, and others behind them.
    """

    def __init__(self, kernel: Any, ghosts: Ghosts, b: int, fixed: Mask) -> None:
        self.kernel, self.ghosts, self.b, self.all = kernel, ghosts, b, len(fixed)
        self.x, self.y, self.c, self.d = (np.zeros(b * self.all + 8, dtype=np.float32) for _ in range(4))
        self.transfer: Any = None
        self.largest = self._largest_eigenvalue(fixed[: ghosts.own])

    @property
    def unknowns(self) -> int:
        """Number of unknowns of all ranks."""
        return self.b * int(self.ghosts.offsets[-1])

    def nodal(self, vector: Any) -> Any:
        """Return a vector by nodes, (all, b), on the same memory."""
        return vector[: self.b * self.all].reshape(self.all, self.b)

    def own(self, vector: Any) -> Any:
        """Return the part of own nodes, (own · b,), on the same memory."""
        return vector[: self.b * self.ghosts.own]

    def product(self, vector: Any, c: Any, to: Any) -> None:
        """Set to = c - A x of a vector whose ghosts are brought up to date here."""
        self.ghosts.update(self.nodal(vector))
        self.kernel.step(vector, c, self.d, to, 0.0, 0.0)

    def smooth(self, degree: int, ratio: float, from_zero: bool) -> None:
        """Take Chebyshev steps on A x = c over the upper part of the spectrum of D^-1 A.

        Source: Saad, Iterative Methods for Sparse Linear Systems (2003), algorithm 12.1.
        """
        high, low = self.largest, self.largest / ratio
        theta, delta = (high + low) / 2, (high - low) / 2
        rho = delta / theta
        if from_zero:
            self.kernel.first_step(self.c, self.d, self.x, 1 / theta)
        else:
            self._advance(0.0, 1 / theta)
        for _ in range(1, degree):
            old, rho = rho, 1 / (2 * theta / delta - rho)
            self._advance(rho * old, 2 * rho / delta)

    def _advance(self, alpha: float, beta: float) -> None:
        self.ghosts.update(self.nodal(self.x))
        self.kernel.step(self.x, self.c, self.d, self.y, alpha, beta)
        self.x, self.y = self.y, self.x

    def _largest_eigenvalue(self, fixed: Mask) -> float:
        """Estimate that of D^-1 A from a few steps of conjugate gradients (its Lanczos values).

        Source: Saad, Iterative Methods for Sparse Linear Systems (2003), section 6.7.3.
        """
        ranks, zero = self.ghosts.ranks, np.zeros_like(self.c)
        r, z = np.zeros_like(self.c), np.zeros_like(self.c)
        noise = np.random.default_rng(ranks.rank).random(self.b * self.ghosts.own, dtype=np.float32) - 0.5
        self.own(r)[:] = np.where(fixed.ravel(), 0.0, noise)
        diagonal: list[float] = []
        beside: list[float] = []
        rz = alpha = 0.0
        for step in range(LANCZOS):
            self.kernel.first_step(r, self.d, self.x, 1.0)
            old, rz = rz, self.dot(r, self.x)
            if not rz > 0:
                break
            beta = rz / old if step else 0.0
            self.own(z)[:] = self.own(self.x) + np.float32(beta) * self.own(z)
            self.product(z, zero, self.y)
            curvature = -self.dot(z, self.y)
            if not curvature > 0:
                break
            if step:
                beside.append(np.sqrt(beta) / alpha)
            diagonal.append(curvature / rz + (beta / alpha if step else 0.0))
            alpha = rz / curvature
            self.own(r)[:] += np.float32(alpha) * self.own(self.y)
        for vector in (self.x, self.y, self.d):
            vector[:] = 0.0
        if not diagonal:
            return 1.0
        return MARGIN * float(
            np.linalg.eigvalsh(np.diag(diagonal) + np.diag(beside[: len(diagonal) - 1], -1))[-1]
        )

    def dot(self, a: Any, b: Any) -> float:
        """Return the scalar product over all ranks."""
        mine = np.dot(self.own(a).astype(float), self.own(b).astype(float))
        return float(self.ghosts.ranks.sum(float(mine)))


class Multigrid:
    """V-cycles over ranks.  It needs the compiled kernels.

    Parameters
    ----------
    first : the finest level.
    modes : (n, b, 6) of the own nodes of the level that aggregates: the finest one, or the linear one.
    linear : the level of the linear elements within quadratic ones, and the way from it, or None.

    Attributes
    ----------
    levels : from the finest to the coarsest.
    """

    def __init__(self, first: Level, modes: Array, linear: tuple[Level, Any] | None = None) -> None:
        self.ranks: Alone = first.ghosts.ranks
        self.levels = [first]
        if linear is not None:
            first.transfer = linear[1]
            self.levels.append(linear[0])
        while self.levels[-1].unknowns > FULL:
            fine = self.levels[-1]
            found = coarsened(fine.kernel, fine.ghosts, fine.all, fine.b, modes, fine.largest)
            if found is None:
                break
            self._add(found)
            modes = found.modes
        self._factorize(modes)
        for level in self.levels:
            level.kernel.forget()

    def _add(self, found: Coarser) -> None:
        """Add the next level, and the way to it."""
        fine, module, count = self.levels[-1], kernels("multigrid"), found.ghosts.own + len(found.ghosts)
        none = np.zeros(0, dtype=np.uint8)
        P, A, fixed = found.P, found.A, np.zeros((count, 6), dtype=bool)
        fine.transfer = module.SharedTransfer(
            P.indptr, P.columns, np.ascontiguousarray(P.data), fine.b, fine.all, count, none, none
        )
        self._last = A
        kernel = module.SharedLevel(A.indptr, A.columns, A.data, fixed.ravel().astype(np.uint8), 6)
        self.levels.append(Level(kernel, found.ghosts, 6, fixed))

    def _factorize(self, modes: Array) -> None:
        """Factorize the coarsest level on each rank, if it is small."""
        last = self.levels[-1]
        self._inverse: Any = None
        if len(self.levels) == 1 or last.b == 3 or last.unknowns > FULL_LIMIT:
            return
        A, ghosts = self._last, last.ghosts
        numbers = np.concatenate([ghosts.offsets[self.ranks.rank] + np.arange(ghosts.own), ghosts.numbers])
        full = np.zeros((ghosts.own, 6, last.unknowns // 6, 6))
        row = np.repeat(np.arange(ghosts.own), np.diff(A.indptr))
        full[row, :, numbers[A.columns]] = A.data.reshape(-1, 6, 6)
        matrix = np.concatenate(self.ranks.gather(full.reshape(6 * ghosts.own, last.unknowns)))
        self._inverse = np.linalg.pinv((matrix + matrix.T) / 2, rcond=1e-13, hermitian=True)

    @property
    def sizes(self) -> list[int]:
        """Unknowns of each level, of all ranks."""
        return [level.unknowns for level in self.levels]

    def precondition(self, r: Array) -> Array:
        """Return one V-cycle on the residual of own nodes (n · b,)."""
        top = self.levels[0]
        size = float(self.ranks.max(float(np.abs(r).max(initial=0.0))))
        if size == 0.0:
            return np.zeros_like(r)
        top.own(top.c)[:] = r / size
        self._descend(0)
        return size * top.own(top.x).astype(float)

    def _descend(self, number: int) -> None:
        level = self.levels[number]
        if number + 1 == len(self.levels):
            self._solve_coarsest(level)
            return
        below = self.levels[number + 1]
        level.smooth(DEGREE, RATIO, from_zero=True)
        level.product(level.x, level.c, level.y)
        level.transfer.restrict_to(level.y, below.c)
        below.ghosts.add(below.nodal(below.c))
        self._descend(number + 1)
        below.ghosts.update(below.nodal(below.x))
        level.transfer.prolong(below.x, level.x)
        level.smooth(DEGREE, RATIO, from_zero=False)

    def _solve_coarsest(self, level: Level) -> None:
        if self._inverse is None:
            level.smooth(20, 400.0, from_zero=True)
            return
        c = np.concatenate(self.ranks.gather(level.own(level.c)))
        first = 6 * int(level.ghosts.offsets[self.ranks.rank])
        rows = slice(first, first + len(level.own(level.x)))
        level.own(level.x)[:] = self._inverse[rows] @ c
