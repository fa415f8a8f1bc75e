"""PetscSystem: K u = f of a mesh that ranks share, solved by PETSc."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.distributed.constraints import numbers_of_dofs, slaves_over_ranks
from kratos_lite.distributed.krylov import Krylov
from kratos_lite.distributed.petsc import LIVE, parsed, petsc, plain_errors
from kratos_lite.distributed.petsc_matrix import (
    add_rigid_modes,
    eliminated,
    largest_row_sum,
    petsc_matrix,
    transformation,
)
from kratos_lite.distributed.preconditioner import FALLBACK_LIMIT, choose, options_of
from kratos_lite.distributed.shell import product_of, set_multigrid
from kratos_lite.distributed.stiffness import SharedStiffness
from kratos_lite.elements.formulations import NEAR_HALF, bulk_over_shear
from kratos_lite.errors import SolveError
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.subdomain import ALONE, Subdomain
from kratos_lite.native import kernels
from kratos_lite.solvers.constraint_map import MultiPointConstraint
from kratos_lite.solvers.iteration import MAX_ITERATIONS
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.typing import Array, Mask, Progress

PATIENCE = 5 * MAX_ITERATIONS
"""Iterations where nothing else is left, as ν near 0.5 needs many."""
CURE = (
    "look for thin elements, nearly free parts or plain elements with ν near 0.5 "
    "(formulation='non_locking' takes others), or ask for solver='direct'"
)
"""What helps where an iteration fails."""
CURE_OF_FACTORS = "look for nearly free parts or a large stiffness contrast, or take more memory"
"""What helps where a factorization fails."""


@dataclass(eq=False)
class Prescribed:
    """What holds the nodes of a rank: supports and constraints, by its degrees of freedom.

    Attributes
    ----------
    fixed, values : (n, 3), at all its nodes, also those of others.
    constraints : that this rank knows.
    name : gives the name of a degree of freedom for messages.
    """

    fixed: Mask
    values: Array
    constraints: Sequence[MultiPointConstraint]
    name: Callable[[int], str]


class PetscSystem:
    """K u = f + reactions on the nodes of some elements over ranks, with u = T q + c.

    It has the interface of a `ConstrainedSystem`.  Each rank assembles the rows of its own nodes.  Nodes
    where all is prescribed, or that no element uses, carry no equations.  All ranks call each method.

    Parameters
    ----------
    mesh : of this rank; one without a subdomain is whole on this process.
    groups : all its elements, also those around its own nodes that belong to others.
    prescribed : supports and constraints.
    solver : ``auto``, ``dense`` and ``direct`` (both MUMPS), or ``amg``.
    tolerance : relative residual at which the iteration stops.
    options : of PETSc, which win over all others, such as ``-ksp_type cg -pc_type hypre``.
    progress : called with the phase and the share done, 0 … 1, on rank 0.

    Attributes
    ----------
    nodes : (a,) int, rows of the nodes of these elements.
    method, reason : which solver is used, and why.
    skipped, warnings : what assembly left out, and what is to be said, in words.
    """

    def __init__(
        self,
        mesh: Mesh,
        groups: Sequence[ElementGroup],
        prescribed: Prescribed,
        *,
        solver: str = "auto",
        tolerance: float = 1e-10,
        options: str | None = None,
        progress: Progress | None = None,
    ) -> None:
        petsc()
        self._share = mesh.subdomain or _whole(mesh)
        self.ranks = self._share.ranks
        self.points, self.groups, self.n_nodes = mesh.points, list(groups), mesh.n_nodes
        self._elastic = [replace(group, prestress=None) for group in groups]
        self._given = parsed(options)
        self.tolerance, self.progress = tolerance, progress if self.ranks.rank == 0 else None
        self.skipped: list[str] = []
        self.warnings: list[str] = []
        self._prescribed = prescribed
        self._number_equations()
        self.c = self.displacements()
        unknowns = int(self.ranks.sum(int(self._free[self._rows].sum())))
        nearly = bool(self.ranks.any(any(bulk_over_shear(one.material.C) > NEAR_HALF for one in groups)))
        self.unknowns = unknowns
        self.method, self.reason = choose(solver, unknowns, nearly, self._given)
        self._solver: Krylov | None = None
        self._A: Any = None
        self._T: Any = None
        LIVE.add(self)

    # ---- numbering ---------------------------------------------------------------------------------

    def _number_equations(self) -> None:
        """Count the nodes with equations over all ranks, by rank and row."""
        share, given = self._share, self._prescribed
        used = np.zeros(self.n_nodes, dtype=bool)
        for group in self.groups:
            used[group.nodes] = True
        used = share.fetch(used)
        self.nodes = np.flatnonzero(used)
        self._fixed = share.fetch(given.fixed)
        any_tied = self.ranks.any(len(given.constraints) > 0)
        self._slaves = self._eliminated(given.values) if any_tied else {}
        tied = np.isin(numbers_of_dofs(share), list(self._slaves)).reshape(-1, 3)
        self._free = ~self._fixed & ~tied & used[:, None]
        equations = used & ~self._fixed.all(axis=1)
        self._rows = np.flatnonzero(equations & share.mine)
        counts = self.ranks.gather(len(self._rows))
        number = np.full(self.n_nodes, -1, dtype=np.int64)
        number[self._rows] = sum(counts[: self.ranks.rank]) + np.arange(len(self._rows))
        self._number = share.fetch(number)

    def _eliminated(self, values: Array) -> Any:
        given = self._prescribed
        return slaves_over_ranks(self._share, given.constraints, given.fixed, values, given.name)

    def displacements(self, values: Array | None = None) -> Array:
        """Return what is prescribed at the nodes, c (3a,); `values` (n, 3) in place of those of supports."""
        given, share = self._prescribed, self._share
        slaves = self._slaves if values is None else self._eliminated(values) if self._slaves else {}
        values = share.fetch(given.values if values is None else values)
        c = np.where(self._fixed, values, 0.0)
        if slaves:
            numbers = numbers_of_dofs(share)
            at = np.flatnonzero(np.isin(numbers, list(slaves)))
            c.flat[at] = [slaves[int(dof)][1] for dof in numbers[at]]
        else:
            self._carry(c)
        return self.gather(c)

    def _carry(self, c: Array) -> None:
        """Let c carry the free along where all supports displace alike, as `constraint_map` does."""
        held, at = self._fixed[self.nodes], c[self.nodes]
        low = self.ranks.min(np.where(held, at, np.inf).min(axis=0, initial=np.inf))
        high = self.ranks.max(np.where(held, at, -np.inf).max(axis=0, initial=-np.inf))
        for axis in np.flatnonzero((low == high) & (low != 0)):
            c[:, axis] = low[axis]

    # ---- matrix and solver -------------------------------------------------------------------------

    @cached_property
    def norm(self) -> float:
        """The largest row sum of |K| at free nodes."""
        self._solver_made()
        return self._norm

    def _solver_made(self) -> Krylov:
        """Return the solver of T^T K T, made once."""
        if self._solver is None:
            self._assemble()
        assert self._solver is not None
        return self._solver

    def _assemble(self) -> None:
        """Make T^T K T, and what solves with it."""
        self.ranks.agree()
        if self._takes_own_multigrid():
            self._use_own_multigrid()
            return
        pattern = Pattern(self.n_nodes, [group.nodes for group in self.groups])
        skipped: set[str] = set()
        K = assemble_stiffness(self.points, self.groups, pattern, self.progress, skipped)
        self.skipped = sorted({one for some in self.ranks.gather(skipped) for one in some})
        self._norm = float(self.ranks.max(largest_row_sum(K, self._rows)))
        with plain_errors():
            A = petsc_matrix(self.ranks, K, self._rows, self._number, self._fixed)
            del K, pattern
            if self._slaves:
                slaves = self._masters()
                self._T = transformation(A, slaves)
                A = eliminated(A, self._T, np.array(sorted(slaves), dtype=np.int64))
            add_rigid_modes(self.ranks, A, self.points[self._rows], self._free[self._rows])
        self._A, self._solver = A, self._iteration(A, multigrid=True)

    def _takes_own_multigrid(self) -> bool:
        """Return whether our multigrid preconditions: without constraints, and unless options name another.

        It takes a third of the time of that of PETSc.
        """
        return (
            self.method == "amg"
            and not self._slaves
            and "pc_type" not in self._given
            and kernels("multigrid") is not None
        )

    def _use_own_multigrid(self) -> None:
        K = SharedStiffness(
            self.ranks, self.points, self._elastic, self._rows, self._number, self._free, self.progress
        )
        self.skipped = sorted({one for some in self.ranks.gather(K.skipped) for one in some})
        self._norm = K.norm()
        with plain_errors():
            self._A = product_of(K)
            self._solver = self._iteration(self._A, multigrid=False)
            set_multigrid(self._solver.ksp, K)

    def _iteration(self, A: Any, multigrid: bool) -> Krylov:
        most = MAX_ITERATIONS if self.unknowns <= FALLBACK_LIMIT else PATIENCE
        return Krylov(A, options_of(self.method, self._given, multigrid), self._given, most)

    def _masters(self) -> dict[int, dict[int, float]]:
        """Return the weights of the masters of own slaves, by the numbers of equations."""
        share = self._share
        dofs = np.unique([dof for slave, (terms, _) in self._slaves.items() for dof in (slave, *terms)])
        nodes = dofs // 3 - share.offsets[self.ranks.rank]
        own = (nodes >= 0) & (nodes < len(share.own_nodes))
        equation = np.full(len(dofs), -1, dtype=np.int64)
        at = self._number[share.own_nodes[nodes[own]]]
        equation[own] = np.where(at >= 0, 3 * at + dofs[own] % 3, -1)
        mine = dict(zip(dofs[own].tolist(), equation[own].tolist(), strict=True))
        number = dict(zip(dofs.tolist(), self.ranks.max(equation).tolist(), strict=True))
        return {
            mine[slave]: {number[dof]: weight for dof, weight in terms.items()}
            for slave, (terms, _) in self._slaves.items()
            if mine.get(slave, -1) >= 0
        }

    # ---- solution ----------------------------------------------------------------------------------

    def solve(
        self,
        forces: Array,
        prescribed: Array | None = None,
        tolerance: float | None = None,
        start: Array | None = None,
    ) -> tuple[Array, Solution]:
        """Return the displacements (n, 3) under nodal forces (n, 3), also at ghosts, and how they were found.

        Parameters
        ----------
        forces : (n, 3) N, complete at own nodes.
        prescribed : (3a,) m, in place of `c`.
        tolerance : in place of that of the system.
        start : (n, 3) m, near the solution; an iteration begins there.

        Raises
        ------
        SolveError
            If the matrix is singular or the accuracy asked for cannot be reached.
        """
        c = self.scatter(self.c if prescribed is None else prescribed)
        load = forces - self._product(c) if self.ranks.any(bool(c.any())) else forces
        self._solver_made()
        tolerance = self.tolerance if tolerance is None else tolerance
        with plain_errors():
            b, x = self._A.createVecLeft(), self._A.createVecLeft()
            self._reduce(load, b)
            if start is not None:
                x.setArray(((start - c) * self._free)[self._rows].ravel())
            solution = self._found(b, x, tolerance, start is not None)
            u = self._expand(x, c)
            b.destroy()
            x.destroy()
        return u, replace(solution, x=u)

    def _found(self, b: Any, x: Any, tolerance: float, near: bool) -> Solution:
        """Solve A x = b; where the iteration fails and no options are given, a small one by factorization."""
        solver = self._solver_made()
        count, error, failure = solver.solve(b, x, tolerance, self._norm, self.progress, near)
        reason = self.reason
        if failure and self.method == "amg" and not self._given and self.unknowns <= FALLBACK_LIMIT:
            self.destroy()
            self.method = "direct"
            solver, reason = self._solver_made(), failure
            count, error, failure = solver.solve(b, x, tolerance, self._norm, self.progress)
        if failure:
            raise SolveError(f"{failure}; {CURE if self.method == 'amg' else CURE_OF_FACTORS}")
        if left := solver.unused():
            words = " ".join(f"-{one}" for one in left)
            self.warnings = [f"PETSc has not used these options: {words}; they may be misspelt"]
        return Solution(np.zeros(0), solver.name, reason, count, error)

    def _reduce(self, forces: Array, b: Any) -> None:
        """Put T^T f of nodal forces (n, 3) into b."""
        b.setArray(forces[self._rows].ravel())
        if self._T is not None:
            reduced = b.duplicate()
            self._T.multTranspose(b, reduced)
            reduced.copy(b)
            reduced.destroy()
        b.setArray(b.getArray() * self._free[self._rows].ravel())

    def _expand(self, x: Any, c: Array) -> Array:
        """Return T x + c (n, 3), also at ghosts."""
        found = x
        if self._T is not None:
            found = x.duplicate()
            self._T.mult(x, found)
        u = c.copy()
        u[self._rows] += found.getArray().reshape(-1, 3)
        if found is not x:
            found.destroy()
        return self._share.fetch(u)

    def _product(self, u: Array) -> Array:
        """Return K u (n, 3) at own nodes."""
        return internal_load(self.points, self._elastic, u)

    def internal_load(self, u: Array) -> Array:
        """Return ∫ B^T σ dV of displacements (n, 3) as nodal forces (n, 3) in N."""
        return self._share.fetch(internal_load(self.points, self.groups, u))

    def residual(self, u: Array, forces: Array) -> Array:
        """Return K u - f as nodal forces (n, 3) in N: reactions where something is prescribed."""
        return self._share.fetch(self._product(u) - forces)

    def gather(self, values: Array) -> Array:
        """Return nodal values (n, 3) as those of the nodes of the elements, (3a,)."""
        return values[self.nodes].ravel()

    def scatter(self, values: Array) -> Array:
        """Return values (3a,) as nodal values (n, 3), 0 on other nodes."""
        out = np.zeros((self.n_nodes, 3))
        out[self.nodes] = values.reshape(-1, 3)
        return out

    def destroy(self) -> None:
        """Let go of matrix and solver; all ranks call it at the same time, as PETSc asks for."""
        for one in (self._solver, self._A, self._T):
            if one is not None:
                one.destroy()
        self._solver = self._A = self._T = None

    def keep(self) -> None:
        """Leave matrix and solver to the end of the process."""
        for one in (None if self._solver is None else self._solver.ksp, self._A, self._T):
            if one is not None:
                one.incRef()


def _whole(mesh: Mesh) -> Subdomain:
    """Return the subdomain of a process that has the whole mesh."""
    n, m, c = mesh.n_nodes, mesh.n_elements, mesh.n_conditions
    every = np.ones(m, dtype=bool), np.ones(c, dtype=bool)
    return Subdomain(ALONE, np.zeros(n, dtype=np.int32), np.arange(n), *every)
