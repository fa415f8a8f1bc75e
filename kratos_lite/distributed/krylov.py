"""A x = b by PETSc: which solver with which options, progress, and why it has stopped, in plain words."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count
from typing import Any

import numpy as np

from kratos_lite.distributed.petsc import PREFIX, has_mumps, petsc, plain_errors, unused
from kratos_lite.solvers.iteration import MAX_ITERATIONS, Monitor
from kratos_lite.solvers.plan import Facts, Plan, over_ranks
from kratos_lite.typing import Progress

CONJUGATE_GRADIENTS: dict[str, str | None] = {"ksp_type": "cg", "ksp_norm_type": "unpreconditioned"}
"""K is symmetric and positive definite; the norm is that of the residual, to which tolerances refer."""
MULTIGRID: dict[str, str | None] = CONJUGATE_GRADIENTS | {
    "pc_type": "gamg",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_pc_type": "jacobi",
    "pc_gamg_threshold": "0.02",
    "pc_gamg_coarse_eq_limit": "1000",
}
"""Smoothed aggregation of PETSc.

Chosen on clamped blocks; a cube on rollers, whose load excites few modes, would choose wrongly.  Jacobi, as
aggregates of too few nodes leave zeros on the diagonal of coarse levels, on which others fail.  Two steps of
Chebyshev: three save fewer iterations than they cost, one takes 60 % more.  The threshold takes 10 % of the
iterations of 27N, none of 8N and 10N.  Without aggressive coarsening (the default of PETSc) there are a third
fewer iterations, but preparing takes five times as long, and twice the memory.
"""
NORMED = ("cg", "fcg", "pipecg", "gmres", "fgmres", "gcr", "bcgs")
"""Iterations that know the residual itself."""
FACTORIZATION: dict[str, str | None] = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
}
"""MUMPS, which factorizes over ranks."""


STOPPED = {
    "DIVERGED_MAX_IT": "not converged after {} iterations",
    "DIVERGED_DTOL": "the residual grows; diverged after {} iterations",
    "DIVERGED_BREAKDOWN": "the method broke down after {} iterations",
    "DIVERGED_INDEFINITE_PC": "the preconditioner is not positive definite (iteration {})",
    "DIVERGED_INDEFINITE_MAT": "the matrix is not positive definite (iteration {})",
    "DIVERGED_NANORINF": "a number is not finite (iteration {})",
    "DIVERGED_PCSETUP_FAILED": "the factorization failed: a pivot is 0, or memory is too little",
}
"""Reasons of PETSc, in words."""
NUMBERS = count()
EPSILON = float(np.finfo(float).eps)
MAXIMUM = 3
"""PETSc's number of the maximum norm."""
NO_DIGITS = 0.3
"""Rounding of A x, as a fraction of b, from which nothing is solved; slender bodies have 0.01."""
REFINEMENTS = 2
"""Solutions for the residual where the true one is too large."""


def plan_of(solver: str, unknowns: int, ratio: float, given: Mapping[str, str | None]) -> Plan:
    """Return how PETSc solves: of all ranks, the unknowns and the largest bulk over shear modulus."""
    facts = Facts(unknowns, bulk_over_shear=lambda: (ratio, ratio))
    return over_ranks(solver, facts, has_mumps(), bool({"ksp_type", "pc_type"} & set(given)))


def options_of(method: str, given: Mapping[str, str | None], multigrid: bool) -> dict[str, str | None]:
    """Return the options of PETSc for a method, but for what contradicts those of the user."""
    chosen = dict(CONJUGATE_GRADIENTS if method == "amg" and not multigrid else MULTIGRID)
    if method == "direct" and not {"ksp_type", "pc_type"} & set(given):
        chosen = dict(FACTORIZATION)
    if given.get("pc_type") in ("lu", "cholesky"):
        chosen["pc_factor_mat_solver_type"] = "mumps"
    if "pc_factor_mat_solver_type" in chosen and not has_mumps():
        del chosen["pc_factor_mat_solver_type"]  # PETSc's own, on one process
    if given.get("ksp_type", "cg") not in NORMED:
        chosen.pop("ksp_norm_type", None)
    return chosen


class Krylov:
    """A solver of PETSc for one matrix, prepared when it is first needed and kept."""

    def __init__(
        self,
        A: Any,
        chosen: Mapping[str, str | None],
        given: Mapping[str, str | None],
        most: int = MAX_ITERATIONS,
    ) -> None:
        self.prefix = f"{PREFIX}{next(NUMBERS)}_"
        self.options, self.given = {**chosen, **given}, dict(given)
        self._A, self._is_ready, self.most = A, False, most
        self._monitor: Monitor | None = None
        with plain_errors():
            self._options = petsc().Options(self.prefix)  # they hold for this solver alone
            for name, value in self.options.items():
                self._options[name] = value
            self.ksp = petsc().KSP().create(A.comm)
            self.ksp.setOptionsPrefix(self.prefix)
            self.ksp.setOperators(A)
            self.ksp.setFromOptions()
            self.ksp.setMonitor(self._report)

    @property
    def name(self) -> str:
        """What solves, such as ``cg + gamg (PETSc)``."""
        kind, preconditioner = self.ksp.getType(), self.ksp.getPC().getType()
        if kind == "preonly":
            return f"{self.options.get('pc_factor_mat_solver_type') or preconditioner} (PETSc)"
        return f"{kind} + {'own multigrid' if preconditioner == 'python' else preconditioner} (PETSc)"

    def set_up(self, progress: Progress | None = None) -> None:
        """Prepare what does not depend on the right side, once."""
        if self._is_ready:
            return
        report = progress or (lambda phase, fraction: None)
        report("set up", 0.0)
        with plain_errors():
            self.ksp.setUp()
            self.ksp.setUpOnBlocks()
        report("set up", 1.0)
        self._is_ready = True

    def solve(
        self,
        b: Any,
        x: Any,
        tolerance: float,
        norm: float,
        progress: Progress | None = None,
        near: bool = False,
    ) -> tuple[int, float, str]:
        """Solve for x, until the true residual is small; that of the iteration drifts from it by rounding."""
        if self.given.get("ksp_rtol"):
            tolerance = float(self.given["ksp_rtol"] or tolerance)
        size = b.norm()
        if size == 0.0:
            x.set(0.0)
            return 0, 0.0, ""
        self.set_up(progress)
        iterations, failure = self._iterate(b, x, tolerance, progress, near)
        residual, step = b.duplicate(), x.duplicate()
        for attempt in range(1 + REFINEMENTS):
            self._A.mult(x, residual)
            residual.aypx(-1.0, b)
            rounding = 2 * EPSILON * (norm * x.norm() + size)
            norm_r = residual.norm()
            if failure or attempt == REFINEMENTS or norm_r <= max(tolerance * size, rounding):
                break
            more, failure = self._iterate(residual, step, min(max(tolerance * size, rounding) / norm_r, 0.1))
            iterations += more
            x.axpy(1.0, step)
        error = residual.norm(MAXIMUM) / (norm * x.norm(MAXIMUM) + b.norm(MAXIMUM))
        if not iterations and 2 * EPSILON * norm * x.norm() > NO_DIGITS * size:
            failure = failure or f"{self.name}: the matrix is singular: parts are free to move, or nearly so"
        residual.destroy()
        step.destroy()
        return iterations, float(error), failure

    def _iterate(
        self, b: Any, x: Any, tolerance: float, progress: Progress | None = None, near: bool = False
    ) -> tuple[int, str]:
        """Run PETSc's solver once; return the iterations, and why it failed."""
        ksp = self.ksp
        ksp.setInitialGuessNonzero(near)
        ksp.setTolerances(
            rtol=tolerance if "ksp_rtol" not in self.given else None,
            max_it=self.most if "ksp_max_it" not in self.given else None,
        )
        self._monitor = Monitor(tolerance, progress) if progress else None
        self._size = 0.0
        with plain_errors():
            ksp.solve(b, x)
        if self._monitor:
            self._monitor.finish()
        return (0 if ksp.getType() == "preonly" else ksp.getIterationNumber()), self._failure()

    def _failure(self) -> str:
        """Return why the iteration failed, or an empty text."""
        reason = self.ksp.getConvergedReason()
        if reason > 0:
            return ""
        kinds = vars(type(self.ksp).ConvergedReason)
        name = next((key for key, code in kinds.items() if code == reason and key in STOPPED), "")
        words = STOPPED.get(name, f"it stopped for PETSc's reason {reason} after {{}} iterations")
        return f"{self.name}: {words.format(self.ksp.getIterationNumber())}"

    def _report(self, ksp: Any, iteration: int, residual: float) -> None:
        """Report progress."""
        self._size = self._size or residual
        if self._monitor is not None and self._size > 0:
            self._monitor(residual / self._size)

    def unused(self) -> list[str]:
        """Return the user's options that PETSc has not used."""
        return unused(self.prefix, self.given)

    def destroy(self) -> None:
        """Release matrix and solver; all ranks call it."""
        for name in self.options:
            self._options.delValue(name)
        self.ksp.destroy()
