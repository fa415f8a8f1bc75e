"""K u = f of elements, solved by all ranks with PETSc.

PetscSystem: under constraints, rank 0 has all of it.  PartSystem: each rank has a part of the mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.distributed.communicator import Alone
from kratos_lite.distributed.cut import Cut, Part
from kratos_lite.distributed.equations import Equations, Method, Outcome
from kratos_lite.distributed.krylov import plan_of
from kratos_lite.distributed.partition import Partition
from kratos_lite.distributed.petsc import parsed
from kratos_lite.elements.formulations import bulk_over_shear
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.constraints import ConstraintMap
from kratos_lite.solvers.iteration import MAX_ITERATIONS
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.solvers.plan import MUMPS_FALLBACK, Plan
from kratos_lite.typing import Array, Ints, Mask, Progress

PATIENCE = 5 * MAX_ITERATIONS
"""Iterations where nothing else is left, as ν near 0.5 needs many."""
KEYS = count()
KEPT: dict[int, Equations] = {}
"""The equations of this rank, by the number of their system."""


class PetscSystem(ConstrainedSystem):
    """A constrained system that rank 0 has, and of which all ranks assemble and solve a part."""

    def __init__(
        self,
        points: Array,
        groups: Sequence[ElementGroup],
        constraints: Callable[[Ints], ConstraintMap],
        ranks: Alone,
        options: str | None = None,
        *,
        solver: str = "auto",
        tolerance: float = 1e-10,
        progress: Progress | None = None,
    ) -> None:
        self._ranks, self._options = ranks, parsed(options)
        super().__init__(points, groups, constraints, solver=solver, tolerance=tolerance, progress=progress)

    def _planned(self, solver: str, use: str) -> Plan:
        ratios = [bulk_over_shear(group.material.C) for group in self.groups]
        return plan_of(solver, len(self.constraint_map.free), max(ratios, default=0.0), self._options)

    @cached_property
    def K(self) -> ElementProduct:
        """The stiffness, as a product: nobody has all of the matrix."""
        return ElementProduct(self.points, self.groups)

    @cached_property
    def equations(self) -> PetscSolver:  # type: ignore[override]
        """What solves them: PETSc on the other ranks."""
        cut = Cut(self.points, self.K.groups, self.constraint_map, self._ranks.size)
        return PetscSolver(self, cut, self._ranks, self._options)

    def destroy(self) -> None:
        """Let all ranks release matrix and solver."""
        if "equations" in vars(self):
            self.equations.destroy()


class ElementProduct:
    """K, of which nobody has a matrix: its products element by element."""

    def __init__(self, points: Array, groups: Sequence[ElementGroup]) -> None:
        self.points, self.groups = points, [group.without_initial for group in groups]

    def __matmul__(self, u: Array) -> Array:
        return internal_load(self.points, self.groups, u.reshape(-1, 3)).ravel()


class PetscSolver:
    """Solves the equations of a system on all ranks; the interface is that of a `LinearSolver`."""

    def __init__(
        self, system: PetscSystem, cut: Cut, ranks: Alone, options: Mapping[str, str | None]
    ) -> None:
        self._system, self._cut, self._ranks, self._options = system, cut, ranks, options
        self._plan, self._key, self._norm = system.plan, -1, 0.0
        self._unknowns = len(system.constraint_map.free)
        self._progress = Postponed(system.progress) if system.progress else None

    @property
    def norm(self) -> float:
        """The largest row sum of |K| at nodes with equations."""
        self._assemble()
        return self._norm

    def _assemble(self) -> None:
        """Let all ranks make their equations, once."""
        if self._key >= 0:
            return
        most = MAX_ITERATIONS if self._unknowns <= MUMPS_FALLBACK else PATIENCE
        method = Method(self._plan.method, self._options, self._cut.is_constrained, most)
        key = next(KEYS)

        def of_rank(rank: int) -> tuple[Part, Progress | None]:
            return self._cut.part(rank), None if rank else self._progress

        self._norm = self._run(_make, key, method, each=of_rank)
        self._key = key

    def _run(self, task: Callable[..., Any], *arguments: Any, each: Callable[[int], Any]) -> Any:
        result = self._ranks.run(task, *arguments, each=each)
        if self._progress:
            self._progress.raise_error()
        return result

    def solve(
        self,
        forces: Array,
        tolerance: float,
        progress: Progress | None = None,
        prescribed: Array | None = None,
        near: Array | None = None,
    ) -> Solution:
        """Return the displacements (3a,) under forces (3a,), and how they were found."""
        constraints = self._system.constraint_map
        c = constraints.c if prescribed is None else prescribed
        load = forces - self._system.K @ c if c.any() else forces
        b, start = np.zeros(len(c)), None
        b[constraints.free] = constraints.reduce(load)
        if near is not None:
            start = np.zeros(len(c))
            start[constraints.free] = (near - c)[constraints.free]
        x, solution = self._solved(b, start, tolerance)
        return replace(solution, x=constraints.expand(x[constraints.free], c))

    def _solved(self, b: Array, start: Array | None, tolerance: float) -> tuple[Array, Solution]:
        """Solve for b (3a,); a small system whose iteration fails is factorized, unless options are given."""
        x, outcome = self._solve(b, start, tolerance)
        failure, small = outcome.failure, self._unknowns <= MUMPS_FALLBACK
        if failure and self._plan.iterates and not self._options and small:
            self.destroy()
            self._plan = Plan("direct", failure)
            x, outcome = self._solve(b, None, tolerance)
        solution, self._system.warnings = outcome.solution(x, self._plan)
        return x, solution

    def _solve(self, b: Array, start: Array | None, tolerance: float) -> tuple[Array, Outcome]:
        self._assemble()
        own, near = self._cut.own, b if start is None else start

        def of_rank(rank: int) -> tuple[Array, Array | None]:
            forces, first = (vector.reshape(-1, 3)[own[rank]] for vector in (b, near))
            return forces, None if start is None else first

        parts, outcome = self._run(_solve, self._key, tolerance, each=of_rank)
        x = np.zeros((len(b) // 3, 3))
        x[np.concatenate(own)] = np.concatenate(parts)
        return x.ravel(), outcome

    def destroy(self) -> None:
        """Let all ranks release matrix and solver."""
        if self._key >= 0:
            key, self._key = self._key, -1
            self._ranks.run(_destroy, key)


class PartSystem:
    """K u = f + reactions of a mesh in parts; all ranks make it and call each method."""

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
        self._elastic = [group.without_initial for group in groups]
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
        x, outcome = self._equations.solve(b, self._tolerance)
        u = prescribed.copy()
        u[self._rows] += x
        u = np.asarray(partition.fetch(u))
        solution, self.warnings = outcome.solution(u, self.plan)
        return u, solution

    def destroy(self) -> None:
        """Release matrix and solver."""
        self._equations.destroy()


class Postponed:
    """A progress callback whose error waits until all ranks have come out of what they do together."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._error: BaseException | None = None

    def __call__(self, phase: str, fraction: float) -> None:
        """Call the callback, unless it has raised something."""
        if self._error is None:
            try:
                self._progress(phase, fraction)
            except BaseException as error:  # such as the user's Ctrl-C
                self._error = error

    def raise_error(self) -> None:
        """Raise what the callback has raised."""
        if self._error is not None:
            error, self._error = self._error, None
            raise error


def _make(ranks: Alone, key: int, method: Method, given: tuple[Part, Progress | None]) -> float:
    KEPT[key] = Equations(ranks, given[0], method, given[1])
    return KEPT[key].norm


def _solve(ranks: Alone, key: int, tolerance: float, given: tuple[Array, Array | None]) -> tuple[Any, ...]:
    x, outcome = KEPT[key].solve(given[0], tolerance, given[1])
    return ranks.collect(x), outcome


def _destroy(ranks: Alone, key: int) -> None:
    KEPT.pop(key).destroy()
