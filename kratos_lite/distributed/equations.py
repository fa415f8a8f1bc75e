"""Equations of a part: own rows of T^T K T in PETSc, and the iteration or factorization that solves them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.distributed.communicator import Alone
from kratos_lite.distributed.cut import Part
from kratos_lite.distributed.krylov import Krylov
from kratos_lite.distributed.petsc import LIVE, plain_errors
from kratos_lite.distributed.petsc_matrix import (
    add_rigid_modes,
    eliminated,
    largest_row_sum,
    petsc_matrix,
    transformation,
)
from kratos_lite.distributed.preconditioner import options_of
from kratos_lite.distributed.shell import product_of, set_multigrid
from kratos_lite.distributed.stiffness import SharedStiffness
from kratos_lite.native import kernels
from kratos_lite.typing import Array, Progress


@dataclass(frozen=True)
class Method:
    """How equations are solved.

    Attributes
    ----------
    name : ``direct`` or ``amg``.
    options : of PETSc, by the user.
    constrained : whether any rank has dependent degrees of freedom.
    most : iterations.
    """

    name: str
    options: Mapping[str, str | None]
    constrained: bool
    most: int

    @property
    def takes_own_multigrid(self) -> bool:
        """Whether our multigrid preconditions, in a third of the time of PETSc's: without constraints."""
        is_free = not self.constrained and "pc_type" not in self.options
        return self.name == "amg" and is_free and kernels("multigrid") is not None


class Equations:
    """The equations of a part; all ranks make them and call each method.

    Parameters
    ----------
    ranks : that share the equations.
    part : of this one.
    method : of solution.
    progress : called with the phase and the fraction done, on rank 0.

    Attributes
    ----------
    norm : the largest row sum of |K| at nodes with equations.
    skipped : what assembly left out, in words.
    """

    def __init__(self, ranks: Alone, part: Part, method: Method, progress: Progress | None = None) -> None:
        self.ranks, self._part, self._progress = ranks, part, progress
        self._A: Any = None
        self._solver: Any = None
        LIVE.add(self)
        if method.takes_own_multigrid:
            own = ranks, part.points, part.groups, part.own, part.number, part.free
            K = SharedStiffness(*own, progress)
            skipped, self.norm = K.skipped, K.norm()
            with plain_errors():
                self._A = product_of(K)
                self._solver = self._iteration(method, own_multigrid=True)
                set_multigrid(self._solver.ksp, K)
        else:
            skipped = self._assemble()
            self._solver = self._iteration(method, own_multigrid=False)
        self.skipped = sorted({text for some in ranks.gather(skipped) for text in some})

    def _assemble(self) -> set[str]:
        """Make T^T K T as a matrix of PETSc; return what assembly left out."""
        ranks, part = self.ranks, self._part
        pattern = Pattern(len(part.points), [group.nodes for group in part.groups])
        skipped: set[str] = set()
        K = assemble_stiffness(part.points, part.groups, pattern, self._progress, skipped)
        self.norm = float(ranks.max(largest_row_sum(K, part.own)))
        with plain_errors():
            self._A = petsc_matrix(ranks, K, part.own, part.number, part.held)
            del K, pattern
            if ranks.sum(len(part.dependent)):
                T = transformation(self._A, part.dependent)
                self._A = eliminated(self._A, T, np.array(sorted(part.dependent), dtype=np.int64))
                T.destroy()
            add_rigid_modes(ranks, self._A, part.points[part.own], part.free[part.own])
        return skipped

    def _iteration(self, method: Method, own_multigrid: bool) -> Krylov:
        options = options_of(method.name, method.options, not own_multigrid)
        return Krylov(self._A, options, method.options, method.most)

    def solve(
        self, forces: Array, tolerance: float, start: Array | None = None
    ) -> tuple[Array, str, int, float, str]:
        """Solve for the free degrees of freedom of own nodes."""
        with plain_errors():
            b, x = self._A.createVecLeft(), self._A.createVecLeft()
            b.setArray(forces.ravel())
            if start is not None:
                x.setArray(start.ravel())
            given = tolerance, self.norm, self._progress, start is not None
            count, error, failure = self._solver.solve(b, x, *given)
            found = x.getArray().reshape(-1, 3).copy()
            b.destroy()
            x.destroy()
        return found, self._solver.name, count, error, failure

    def unused_options(self) -> list[str]:
        """Return the options of the user that PETSc has not asked for."""
        return self._solver.unused()

    def destroy(self) -> None:
        """Release matrix and solver; all ranks call it at the same time, as PETSc asks for."""
        for held in (self._solver, self._A):
            if held is not None:
                held.destroy()
        LIVE.discard(self)

    def keep(self) -> None:
        """Leave matrix and solver to the end of the process."""
        for held in (self._solver and self._solver.ksp, self._A):
            if held is not None:
                held.incRef()
