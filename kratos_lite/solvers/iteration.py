"""Conjugate gradients, the fraction of the work they have done, and when to give them up."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.solvers import plan
from kratos_lite.typing import Array, Progress

MAX_ITERATIONS = 1000
"""A multigrid that needs more than these does not converge."""
STALLED = 200
"""A multigrid that finds no smaller residual in as many iterations does not converge either."""
GoOn: TypeAlias = Callable[[float], bool]
"""Takes a residual as a fraction of the first; returns whether to go on."""


class ConvergenceForecast:
    """Forecasts from the residuals so far, as fractions of the first, whether an iteration ends soon.

    It does not if, after 60 iterations, their rate promises more than `plan.PATIENCE` in all.  The rate is
    that between the last two quarters, each the mean of its logarithms: residuals grow at first and jump.
    """

    def __init__(self, tolerance: float) -> None:
        self.tolerance, self.stopped = tolerance, False
        self._logs: list[float] = []

    def __call__(self, residual: float) -> bool:
        """Take the next residual; return whether to go on."""
        self._logs.append(math.log(max(residual, 1e-300)))
        done, remaining = len(self._logs), self._logs[-1] - math.log(self.tolerance)
        if done < plan.PATIENCE_FROM or remaining <= 0:
            return True
        quarter = done // 4
        before, now = self._logs[-2 * quarter : -quarter], self._logs[-quarter:]
        rate = (math.fsum(before) - math.fsum(now)) / quarter**2
        self.stopped = (plan.PATIENCE - done) * rate < remaining
        return not self.stopped


class FractionDone:
    """Turns residuals, as fractions of the first, into the fraction of work that is done; it never falls."""

    def __init__(self, tolerance: float, progress: Progress | None, go_on: GoOn | None = None) -> None:
        self.tolerance, self.progress, self.go_on, self.done = tolerance, progress, go_on, 0.0

    def __call__(self, residual: float) -> bool:
        """Report after an iteration; return whether to go on."""
        if self.progress:
            fraction = float(np.log(max(residual, 1e-300)) / np.log(self.tolerance))
            self.done = min(max(self.done, fraction), 1.0)
            self.progress("solve", self.done)
        return self.go_on is None or self.go_on(residual)

    def finish(self) -> None:
        """Report that all is done, where round-off ended the iteration before its tolerance did."""
        if self.progress and self.done < 1:
            self.progress("solve", 1.0)


def conjugate_gradients(
    A: Any,
    b: Array,
    precondition: Callable[[Array], Array],
    tolerance: float,
    norm_A: float,
    max_iterations: int = MAX_ITERATIONS,
    progress: Progress | None = None,
    go_on: GoOn | None = None,
) -> tuple[Array, int, bool]:
    """Solve A x = b with symmetric positive definite A; return x, iterations and success.

    It stops when |r| ≤ tolerance |b|, or when |r| reaches what round-off allows,
    2 eps (|A| |x| + |b|); and gives up when `STALLED` iterations bring no new smallest residual, or when
    `go_on`, called with |r| / |b|, returns False.
    Source: Saad, Iterative Methods for Sparse Linear Systems (2003), algorithm 9.1.
    """
    x, r = np.zeros_like(b), b.copy()
    norm_b = float(np.linalg.norm(b))
    if norm_b == 0:
        return x, 0, True
    each = FractionDone(tolerance, progress, go_on)
    best, best_at = np.inf, 0  # residuals may grow at first
    z = precondition(r)
    p, rz = z.copy(), float(r @ z)
    for iteration in range(1, max_iterations + 1):
        Ap = A @ p
        curvature = float(p @ Ap)
        if not (curvature > 0 and rz > 0):
            return x, iteration, False
        alpha = rz / curvature
        x += alpha * p
        r -= alpha * Ap
        norm = float(np.linalg.norm(r))
        going = each(norm / norm_b)
        limit = max(tolerance * norm_b, 2 * np.finfo(float).eps * (norm_A * np.linalg.norm(x) + norm_b))
        if norm <= limit:
            each.finish()
            return x, iteration, True
        if not going:
            return x, iteration, False
        if norm < best:
            best, best_at = norm, iteration
        elif iteration - best_at > STALLED:
            return x, iteration, False
        z = precondition(r)
        rz, old = float(r @ z), rz
        p = z + (rz / old) * p
    return x, max_iterations, False
