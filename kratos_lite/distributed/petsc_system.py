"""PetscSystem: K u = f of elements under constraints, which rank 0 has and all ranks solve by PETSc."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.distributed.communicator import Alone
from kratos_lite.distributed.cut import Cut, Part
from kratos_lite.distributed.equations import Equations, Method
from kratos_lite.distributed.petsc import parsed
from kratos_lite.distributed.preconditioner import plan_of
from kratos_lite.elements.formulations import bulk_over_shear
from kratos_lite.errors import SolveError
from kratos_lite.solvers.constrained_system import renumber
from kratos_lite.solvers.constraint_map import ConstraintMap
from kratos_lite.solvers.iteration import MAX_ITERATIONS
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.solvers.plan import MUMPS_FALLBACK
from kratos_lite.typing import Array, Ints, Progress

PATIENCE = 5 * MAX_ITERATIONS
"""Iterations where nothing else is left, as ν near 0.5 needs many."""
CURE = (
    "look for thin elements, nearly free parts or plain elements with ν near 0.5 "
    "(formulation='non_locking' takes others), or ask for solver='direct'"
)
"""What helps where an iteration fails."""
CURE_OF_FACTORS = "look for nearly free parts or a large stiffness contrast, or take more memory"
"""What helps where a factorization fails."""
KEYS = count()
KEPT: dict[int, Equations] = {}
"""The equations of this rank, by the number of their system."""


class PetscSystem:
    """K u = f + reactions on the nodes of some elements, with u = T q + c, as a `ConstrainedSystem`.

    The rank that makes it has all elements; all ranks assemble and solve their parts of the equations.

    Parameters
    ----------
    points : (n, 3) m.
    groups : the elements, by indices of the points.
    constraints : gives the constraint map of the nodes that carry equations, by their indices.
    ranks : that assemble and solve.
    solver : ``auto``, ``dense`` and ``direct`` (both MUMPS), or ``amg``.
    tolerance : relative residual at which the iteration stops.
    options : of PETSc, which win over all others, such as ``-ksp_type cg -pc_type hypre``.
    progress : called with the phase and the fraction done, 0 … 1.

    Attributes
    ----------
    nodes : (a,) int, indices of the nodes of these elements.
    reduced : the constraint map, from the free degrees of freedom to all 3a.
    method, reason : which solver is used, and why.
    skipped, warnings : what assembly left out, and what is to be said, in words.
    """

    def __init__(
        self,
        points: Array,
        groups: Sequence[ElementGroup],
        constraints: Callable[[Ints], ConstraintMap],
        ranks: Alone,
        *,
        solver: str = "auto",
        tolerance: float = 1e-10,
        options: str | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.n_nodes, self.ranks = len(points), ranks
        self.nodes, self.groups = renumber(self.n_nodes, groups)
        self.points = points[self.nodes]
        self.reduced = constraints(self.nodes)
        self.tolerance, self._progress = tolerance, Postponed(progress) if progress else None
        self.skipped: list[str] = []
        self.warnings: list[str] = []
        self._elastic = [replace(group, prestress=None) for group in self.groups]
        self._options = parsed(options)
        self.unknowns = len(self.reduced.free)
        ratios = [bulk_over_shear(group.material.C) for group in groups]
        plan = plan_of(solver, self.unknowns, max(ratios, default=0.0), self._options)
        self.method, self.reason = plan.method, plan.reason
        self._key: int | None = None

    @cached_property
    def _cut(self) -> Cut:
        return Cut(self.points, self._elastic, self.reduced, self.ranks.size)

    @cached_property
    def norm(self) -> float:
        """The largest row sum of |K| at nodes with equations."""
        self._assemble()
        return self._norm

    def _assemble(self) -> None:
        """Let all ranks make their equations."""
        if self._key is not None:
            return
        most = MAX_ITERATIONS if self.unknowns <= MUMPS_FALLBACK else PATIENCE
        method = Method(self.method, self._options, self._cut.is_constrained, most)
        key = next(KEYS)

        def of_rank(rank: int) -> tuple[Part, Progress | None]:
            return self._cut.part(rank), None if rank else self._progress

        self._norm, self.skipped = self._run(_make, key, method, each=of_rank)
        self._key = key

    def _run(
        self, task: Callable[..., Any], *arguments: Any, each: Callable[[int], Any] | None = None
    ) -> Any:
        found = self.ranks.run(task, *arguments, each=each)
        if self._progress:
            self._progress.raise_error()
        return found

    def solve(
        self,
        forces: Array,
        prescribed: Array | None = None,
        tolerance: float | None = None,
        start: Array | None = None,
    ) -> tuple[Array, Solution]:
        """Return the displacements (n, 3) under nodal forces (n, 3), and how they were found.

        Parameters
        ----------
        forces : (n, 3) N.
        prescribed : (3a,) m, in place of c of the constraint map.
        tolerance : in place of that of the system.
        start : (n, 3) m, near the solution; an iteration begins there.

        Raises
        ------
        SolveError
            If the matrix is singular or the accuracy asked for cannot be reached.
        """
        c = self.reduced.c if prescribed is None else prescribed
        load = self.gather(forces)
        if c.any():
            load = load - self._product(c)
        b, x0 = np.zeros(len(c)), None
        b[self.reduced.free] = self.reduced.reduce(load)
        if start is not None:
            x0 = np.zeros(len(c))
            x0[self.reduced.free] = (self.gather(start) - c)[self.reduced.free]
        x, solution = self._found(b, x0, self.tolerance if tolerance is None else tolerance)
        u = self.scatter(self.reduced.expand(x[self.reduced.free], c))
        return u, replace(solution, x=u)

    def _found(self, b: Array, start: Array | None, tolerance: float) -> tuple[Array, Solution]:
        """Solve for b (3a,); a small system whose iteration fails is factorized, unless options are given."""
        x, name, iterations, error, failure, unused = self._solve(b, start, tolerance)
        reason = self.reason
        if failure and self.method == "amg" and not self._options and self.unknowns <= MUMPS_FALLBACK:
            self.destroy()
            self.method, reason = "direct", failure
            x, name, iterations, error, failure, unused = self._solve(b, None, tolerance)
        if failure:
            raise SolveError(f"{failure}; {CURE if self.method == 'amg' else CURE_OF_FACTORS}")
        if unused:
            words = " ".join(f"-{option}" for option in unused)
            self.warnings = [f"PETSc has not used these options: {words}; they may be misspelt"]
        return x, Solution(np.zeros(0), name, reason, iterations, error)

    def _solve(self, b: Array, start: Array | None, tolerance: float) -> Any:
        self._assemble()
        own, forces = self._cut.own, b.reshape(-1, 3)
        near = None if start is None else start.reshape(-1, 3)

        def of_rank(rank: int) -> tuple[Array, Array | None]:
            return forces[own[rank]], None if near is None else near[own[rank]]

        found, *rest = self._run(_solve, self._key, tolerance, each=of_rank)
        x = np.zeros_like(forces)
        for nodes, values in zip(own, found, strict=True):
            x[nodes] = values
        return x.ravel(), *rest

    def _product(self, u: Array) -> Array:
        """Return K u (3a,)."""
        return internal_load(self.points, self._elastic, u.reshape(-1, 3)).ravel()

    def internal_load(self, u: Array) -> Array:
        """Return ∫ B^T σ dV of displacements (n, 3) as nodal forces (n, 3) in N."""
        return self.scatter(internal_load(self.points, self.groups, u[self.nodes]).ravel())

    def residual(self, u: Array, forces: Array) -> Array:
        """Return K u - f as nodal forces (n, 3) in N: reactions where something is prescribed."""
        return self.scatter(self._product(self.gather(u))) - forces

    def gather(self, values: Array) -> Array:
        """Return nodal values (n, 3) as those of the nodes of the elements, (3a,)."""
        return values[self.nodes].ravel()

    def scatter(self, values: Array) -> Array:
        """Return values (3a,) as nodal values (n, 3), 0 on other nodes."""
        out = np.zeros((self.n_nodes, 3))
        out[self.nodes] = values.reshape(-1, 3)
        return out

    def destroy(self) -> None:
        """Let all ranks release matrix and solver."""
        if self._key is not None:
            key, self._key = self._key, None
            self.ranks.run(_destroy, key)


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


def _make(
    ranks: Alone, key: int, method: Method, given: tuple[Part, Progress | None]
) -> tuple[float, list[str]]:
    KEPT[key] = Equations(ranks, given[0], method, given[1])
    return KEPT[key].norm, KEPT[key].skipped


def _solve(ranks: Alone, key: int, tolerance: float, given: tuple[Array, Array | None]) -> tuple[Any, ...]:
    found, *rest = KEPT[key].solve(given[0], tolerance, given[1])
    return collected(ranks, found), *rest, KEPT[key].unused_options()


def _destroy(ranks: Alone, key: int) -> None:
    KEPT.pop(key).destroy()


def collected(ranks: Alone, values: Array) -> list[Array]:
    """Return the values of all ranks on rank 0, an empty list on the others."""
    nowhere = values[:0]
    found = ranks.exchange([values] + [nowhere] * (ranks.size - 1))
    return found if ranks.rank == 0 else []
