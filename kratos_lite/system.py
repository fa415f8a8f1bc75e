"""System: the equations of elements and their supports, made once and solved for many forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite import solvers
from kratos_lite.assembly import (
    Pattern,
    PatternCache,
    Progress,
    assemble_dense,
    assemble_stiffness,
)
from kratos_lite.batches import Batch
from kratos_lite.errors import InputError
from kratos_lite.fields import internal_load
from kratos_lite.linear_level import linear_level
from kratos_lite.solvers.common import DENSE_MAX
from kratos_lite.supports import Links, Supports, reduction

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class System:
    """K u = f + reactions on the nodes of some elements, with u as the supports prescribe it.

    Pattern, matrix and whatever the solver prepares (factors, multigrid) are made when they are first
    needed and kept.  Nodes that no element uses carry no equations.

    Parameters
    ----------
    points : (n, 3) m.
    batches : the elements, by rows of the points.
    supports : prescribed displacements and constraints.
    links : the constraints of `supports` if they are resolved already.
    solver : ``auto``, ``dense``, ``direct`` or ``amg``.
    tolerance : relative residual at which the iterative solver stops.
    patterns : where sparsity patterns are kept from one system to the next.
    progress : called with the phase and the share done, 0 … 1.

    Attributes
    ----------
    points, batches : the nodes that carry equations, and the elements by rows of these.
    nodes : (a,) int, rows of these nodes among all n.
    reduced : the supports as a map from free degrees of freedom to all 3a.
    method, reason : which solver is used, and why.
    skipped : what assembly left out, in words.

    Examples
    --------
    >>> import numpy as np
    >>> import kratos_lite as kl
    >>> model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.0))
    >>> model.fix("z-")
    >>> system = System(model.mesh.points, model.batches(), model.supports)
    >>> f = np.zeros((8, 3))
    >>> f[model.mesh.nodes("z+"), 2] = 1.0
    >>> u, solution = system.solve(f)
    >>> print(f"{u[:, 2].max():.3e} m, {solution.method}")
    4.000e-09 m, dense
    """

    def __init__(
        self,
        points: Array,
        batches: Sequence[Batch],
        supports: Supports,
        links: Links | None = None,
        *,
        solver: str = "auto",
        tolerance: float = 1e-10,
        patterns: PatternCache | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.n_nodes = len(points)
        self.nodes, self.batches = renumber(self.n_nodes, batches)
        self.points = points[self.nodes]
        self.supports = supports
        self.reduced = reduction(supports, self.nodes, links)
        self.tolerance, self.progress = tolerance, progress
        self.skipped: list[str] = []
        self._patterns = patterns or PatternCache()
        dofs = 3 * len(self.nodes)
        self.method, self.reason = solvers.choose(solver, len(self.reduced.free), dofs)
        if self.method == "dense" and dofs > DENSE_MAX:
            raise InputError(f"solver='dense' is for up to {DENSE_MAX} degrees of freedom; got {dofs}")

    @cached_property
    def pattern(self) -> Pattern:
        """The sparsity of matrices on these nodes."""
        return self._patterns.get(len(self.nodes), [batch.nodes for batch in self.batches])

    @cached_property
    def K(self) -> Any:
        """The stiffness matrix (3a, 3a) in N/m: a BlockMatrix, or a full array for the method ``dense``."""
        if self.method == "dense":
            return assemble_dense(self.points, self.batches)
        skipped: set[str] = set()
        K = assemble_stiffness(self.points, self.batches, self.pattern, self.progress, skipped)
        self.skipped += sorted(skipped)
        return K

    @cached_property
    def norm(self) -> float:
        """The largest row sum of |K|."""
        return solvers.matrix_norm(self.K)

    @cached_property
    def _equations(self) -> solvers.Equations:
        return solvers.Equations(
            self.K,
            self.reduced,
            self.points,
            self.method,
            self.reason,
            lambda: linear_level(self.points, self.batches),
        )

    def prescribe(self, links: Links | None = None) -> None:
        """Take over new values of the prescribed displacements and of the constants of constraints."""
        self.reduced.c = reduction(self.supports, self.nodes, links).c

    def solve(self, forces: Array) -> tuple[Array, solvers.Solution]:
        """Return the displacements (n, 3) under nodal forces (n, 3), and how they were found.

        Raises
        ------
        SolveError
            If the matrix is singular or the accuracy asked for cannot be reached.
        """
        solution = self._equations.solve(self.local(forces), self.tolerance, self.progress)
        return self.whole(solution.x), solution

    def internal_load(self, u: Array) -> Array:
        """Return ∫ B^T σ dV of displacements (n, 3) as nodal forces (n, 3) in N."""
        return self.whole(internal_load(self.points, self.batches, u[self.nodes]).ravel())

    def residual(self, u: Array, forces: Array) -> Array:
        """Return K u - f as nodal forces (n, 3) in N: reactions where something is prescribed."""
        out = 0.0 - forces
        out[self.nodes] = (self.K @ self.local(u) - self.local(forces)).reshape(-1, 3)
        return out

    def reduce(self, forces: Array) -> Array:
        """Return what nodal forces (n, 3) do on the free degrees of freedom, (q,)."""
        return self.reduced.reduce(self.local(forces))

    def expand(self, q: Array) -> Array:
        """Return the displacements (n, 3) of the free degrees of freedom (q,)."""
        return self.whole(self.reduced.expand(q))

    def local(self, values: Array) -> Array:
        """Return nodal values (n, 3) as those of the equations, (3a,)."""
        return values.ravel() if len(self.nodes) == self.n_nodes else values[self.nodes].ravel()

    def whole(self, values: Array) -> Array:
        """Return values of the equations (3a,) as nodal values (n, 3), 0 on nodes without equations."""
        if len(self.nodes) == self.n_nodes:
            return values.reshape(-1, 3)
        out = np.zeros((self.n_nodes, 3))
        out[self.nodes] = values.reshape(-1, 3)
        return out


def renumber(n_nodes: int, batches: Sequence[Batch]) -> tuple[Ints, list[Batch]]:
    """Return the rows of the nodes that elements use, and the batches numbered by them."""
    used = np.zeros(n_nodes, dtype=bool)
    for batch in batches:
        used[batch.nodes] = True
    nodes = np.flatnonzero(used)
    if len(nodes) == n_nodes:
        return nodes, list(batches)
    local = (np.cumsum(used) - 1).astype(np.int32)
    return nodes, [replace(batch, nodes=local[batch.nodes]) for batch in batches]


def among(batches: Sequence[Batch], moving: NDArray[np.bool_]) -> list[Batch]:
    """Return the elements that have a node in `moving` (n,), batch by batch."""
    if moving.all():
        return list(batches)
    chosen = []
    for batch in batches:
        still = _without(batch.nodes, moving)
        if not len(still):
            chosen.append(batch)
        elif len(still) < len(batch):
            keep = np.ones(len(batch), dtype=bool)
            keep[still] = False
            stress = None if batch.prestress is None else batch.prestress[keep]
            chosen.append(replace(batch, nodes=batch.nodes[keep], rows=batch.rows[keep], prestress=stress))
    return chosen


def _without(nodes: NDArray[np.int32], moving: NDArray[np.bool_]) -> Ints:
    """Return the cells (m, k) with no node in `moving`; most are ruled out by their first nodes."""
    still = np.flatnonzero(~moving[nodes[:, 0]])
    for column in range(1, nodes.shape[1]):
        if not len(still):
            break
        still = still[~moving[nodes[still, column]]]
    return still
