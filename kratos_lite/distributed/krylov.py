"""A x = b by PETSc: the solver and its options, progress, and why it has stopped, in plain words."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count
from typing import Any

from kratos_lite.distributed.petsc import PREFIX, clear_options, petsc, plain_errors, set_options, unused
from kratos_lite.solvers.iteration import MAX_ITERATIONS, Share
from kratos_lite.typing import Progress

STOPPED = {
    "DIVERGED_MAX_IT": "not converged after {} iterations",
    "DIVERGED_DTOL": "the residual grows; diverged after {} iterations",
    "DIVERGED_BREAKDOWN": "the method broke down after {} iterations",
    "DIVERGED_INDEFINITE_PC": "the preconditioner is not positive definite (iteration {})",
    "DIVERGED_INDEFINITE_MAT": "the matrix is not positive definite (iteration {})",
    "DIVERGED_NANORINF": "a number is not finite (iteration {})",
    "DIVERGED_PC_FAILED": "the factorization failed: a pivot is 0, or memory is too little",
}
"""Reasons of PETSc, in words."""
NUMBERS = count()


class Krylov:
    """A solver of PETSc for one matrix, prepared when it is first needed and kept.

    Parameters
    ----------
    A : matrix of PETSc.
    chosen : options that we choose; its own prefix keeps them from other solvers.
    given : options of the user, which win.

    Attributes
    ----------
    ksp : the solver of PETSc.
    prefix : of its options.
    """

    def __init__(self, A: Any, chosen: Mapping[str, str | None], given: Mapping[str, str | None]) -> None:
        self.prefix = f"{PREFIX}{next(NUMBERS)}_"
        self.options, self.given = {**chosen, **given}, dict(given)
        self.is_ready = False
        self._error: BaseException | None = None
        self._share: Share | None = None
        with plain_errors():
            set_options(self.prefix, self.options)
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

    def set_up(self) -> None:
        """Prepare what does not depend on the right side."""
        with plain_errors():
            self.ksp.setUp()
            self.ksp.setUpOnBlocks()
        self.is_ready = True

    def solve(
        self, b: Any, x: Any, tolerance: float, progress: Progress | None = None, near: bool = False
    ) -> tuple[int, str]:
        """Solve for x, from where it is if `near`; return the iterations, and why it failed ("" if not).

        Parameters
        ----------
        b, x : vectors of PETSc.
        tolerance : of the residual, relative to b, unless the user's options have one.
        progress : called on the ranks that give one.
        """
        ksp = self.ksp
        ksp.setInitialGuessNonzero(near)
        ksp.setTolerances(
            rtol=tolerance if "ksp_rtol" not in self.given else None,
            max_it=MAX_ITERATIONS if "ksp_max_it" not in self.given else None,
        )
        self._share = Share(tolerance, progress) if progress else None
        self._size = 0.0
        with plain_errors():
            ksp.solve(b, x)
        if self._error:
            error, self._error = self._error, None
            raise error
        if self._share:
            self._share.finish()
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
        """Report progress; an error waits until all ranks have come out of the iteration."""
        if self._share is None or self._error:
            return
        try:
            self._size = self._size or residual
            if self._size > 0:
                self._share(residual / self._size)
        except BaseException as error:  # such as the user's Ctrl-C
            self._error = error

    def unused(self) -> list[str]:
        """Return the user's options that PETSc has not asked for."""
        return unused(self.prefix, self.given)

    def destroy(self) -> None:
        """Let go of all; all ranks call it."""
        clear_options(self.prefix, self.options)
        self.ksp.destroy()
