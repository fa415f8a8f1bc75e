"""PartSystem: K u = f of a mesh of which each rank has a part, solved by PETSc."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.distributed.equations import Equations, Method
from kratos_lite.distributed.krylov import plan_of
from kratos_lite.distributed.partition import Partition
from kratos_lite.distributed.petsc import parsed
from kratos_lite.distributed.petsc_system import CURE, CURE_OF_FACTORS, PATIENCE, unused_words
from kratos_lite.elements.formulations import bulk_over_shear
from kratos_lite.errors import SolveError
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.typing import Array, Mask, Progress


class PartSystem:
    """K u = f + reactions of a mesh in parts; all ranks make it and call each method.

    Parameters
    ----------
    points : (n, 3) m, of the part.
    groups : its elements.
    partition : how the parts hang together.
    held : (n, 3) bool, what is prescribed, the same in all parts that have a node.
    solver, tolerance, options, progress : as for a `PetscSystem`.

    Attributes
    ----------
    unknowns : of all parts.
    warnings : what is to be said, in words.
    """

    def __init__(
        self,
        points: Array,
        groups: Sequence[ElementGroup],
        partition: Partition,
        held: Mask,
        solver: str,
        tolerance: float,
        options: str | None,
        progress: Progress | None,
    ) -> None:
        self._points, self._partition, self._held = points, partition, held
        self._elastic = [replace(group, prestress=None) for group in groups]
        ranks, self._tolerance = partition.ranks, tolerance
        given = parsed(options)
        part = partition.equations(points, self._elastic, held)
        self._rows = part.own
        self.unknowns = ranks.sum(int((~held[part.own]).sum()))
        ratio = ranks.max(max((bulk_over_shear(group.material.C) for group in groups), default=0.0))
        self.plan = plan_of(solver, self.unknowns, ratio, given)
        self._equations = Equations(ranks, part, Method(self.plan.method, given, False, PATIENCE), progress)
        self.warnings: list[str] = []

    def solve(self, forces: Array, prescribed: Array) -> tuple[Array, Solution]:
        """Return the displacements (n, 3) under nodal forces, and how they were found."""
        partition = self._partition
        load = forces - partition.add(internal_load(self._points, self._elastic, prescribed))
        b = np.where(self._held, 0.0, load)[self._rows]
        x, name, iterations, error, failure = self._equations.solve(b, self._tolerance)
        if failure:
            raise SolveError(f"{failure}; {CURE if self.plan.iterates else CURE_OF_FACTORS}")
        self.warnings = unused_words(self._equations.unused_options())
        u = prescribed.copy()
        u[self._rows] += x
        u = np.asarray(partition.fetch(u))
        return u, Solution(u, name, self.plan.reason, iterations, error)

    def destroy(self) -> None:
        """Release matrix and solver."""
        self._equations.destroy()
