"""Corrections of Newton's method: tangents solved by factors, or by the multigrid of an earlier one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TypeAlias

import numpy as np

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.linear_solver import LinearSolver
from kratos_lite.solvers.newton import forcing
from kratos_lite.solvers.plan import Plan
from kratos_lite.typing import Array, Ints

Changes: TypeAlias = list[tuple[Ints, Array]]
"""Tangent of a load: for nodes (m, k) the derivatives (m, k, 3, k, 3) of their forces."""
WORN = 6.0
"""Iterations for a digit from which a multigrid of an older tangent is made anew."""
SMALL = 1e-3
"""Part of a residual that a constant K alone may leave; beyond it loads that follow add their tangent."""


class Tangents:
    """What solves (K - changes) du = f with the tangents K of a step."""

    # Where multigrid solves them, a step begins with that of the body at rest, not with the last one of the
    # step before, which a restart does not know, and keeps it while it serves.  A constant K is that at rest.

    def __init__(
        self,
        system: ConstrainedSystem,
        plan: Plan,
        symmetric: bool,
        rest: Callable[[], LinearSolver],
        constant: bool = False,
    ) -> None:
        self._system, self.plan, self._symmetric, self._make_rest = system, plan, symmetric, rest
        self._constant = constant
        self._near: LinearSolver | None = None

    @cached_property
    def _rest(self) -> LinearSolver:
        return self._make_rest()

    def solve(
        self,
        K: BlockMatrix,
        changes: Changes,
        forces: Sequence[Array],
        jump: Array,
        residuals: list[float],
        tolerance: float,
    ) -> list[Array]:
        """Return displacements (3a,) under each of the forces (3a,), with a jump (3a,) of what is prescribed.

        The residuals of the step so far say how far a correction is worth being solved.
        """
        iterates = self.plan.iterates
        if self._constant and (not changes or _fall(residuals) <= SMALL):
            left = 1.0 if jump.any() else max(residuals[-1], tolerance)
            enough = 0.1 * tolerance / left  # so that one correction is the solution
            return [self._rest.solve(each, enough, None, jump, jump).x for each in forces]
        if iterates and len(residuals) == 1:
            self._near = self._rest
        if iterates and changes and self._near is None:
            self._near = self._solver(K, [(nodes, (k + turned(k)) / 2) for nodes, k in changes], True)
        solver = self._solver(K, changes, self._symmetric and not changes)
        solver.near = self._near
        tolerance = forcing(residuals, tolerance)
        solutions = [solver.solve(each, tolerance, None, jump, jump) for each in forces]
        if iterates:
            worn = self._symmetric and solutions[-1].iterations > WORN * -np.log10(tolerance)
            self._near = None if solver.near and worn else solver.near or solver
        return [solution.x for solution in solutions]

    def _solver(self, K: BlockMatrix, changes: Changes, symmetric: bool) -> LinearSolver:
        """Return what solves with K - changes."""
        system = self._system
        if changes:
            K = BlockMatrix(K.data.copy(), K.indices, K.indptr)
            system.pattern.add_tangents(K.data, [(nodes, -k) for nodes, k in changes])
        return LinearSolver(K, system.constraint_map, system.points, self.plan, symmetric)


def _fall(residuals: list[float]) -> float:
    """Return what the last correction left of a residual; nothing before the first."""
    return residuals[-1] / (residuals[-2] or 1.0) if len(residuals) > 1 else 0.0


def turned(tangent: Array) -> Array:
    """Return tangents (m, k, 3, k, 3) transposed."""
    return tangent.transpose(0, 3, 4, 1, 2)
