"""Conjugate gradients, the share of the work they have done, and when to give them up."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from kratos_lite.solvers import plan
from kratos_lite.typing import Array, Progress

MAX_ITERATIONS = 1000
"""A multigrid that needs more than these does not converge."""
STALLED = 200
"""A multigrid that finds no smaller residual in as many iterations does not converge either."""


class ConvergenceForecast:
    """Forecasts from the residuals so far, as shares of the first, whether an iteration ends soon.

    It does not if, after 60 iterations, their rate promises more than `plan.PATIENCE` in all.  The rate is
    that between the last two quarters, each the mean of its logarithms: residuals grow at first and jump.

    Attributes
    ----------
    stopped : whether the forecast was too many iterations.

    Examples
    --------
    >>> fast, slow = ConvergenceForecast(1e-8), ConvergenceForecast(1e-8)
    >>> all(fast(0.9**k) for k in range(150)), [slow(0.99**k) for k in range(100)].index(False)
    (True, 59)
    """

    def __init__(self, tolerance: float) -> None:
        self.tolerance, self.stopped = tolerance, False
        self._logs: list[float] = []

    def __call__(self, residual: float) -> bool:
        """Take the next residual; return whether to go on."""
        self._logs.append(math.log(max(residual, 1e-300)))
        done, left = len(self._logs), self._logs[-1] - math.log(self.tolerance)
        if done < plan.PATIENCE_FROM or left <= 0:
            return True
        quarter = done // 4
        before, now = self._logs[-2 * quarter : -quarter], self._logs[-quarter:]
        rate = (math.fsum(before) - math.fsum(now)) / quarter**2
        self.stopped = (plan.PATIENCE - done) * rate < left
        return not self.stopped


class Share:
    """Turns residuals, as shares of the first, into the share of the work that is done; it never falls."""

    def __init__(self, tolerance: float, progress: Progress) -> None:
        self.tolerance, self.progress, self.done = tolerance, progress, 0.0

    def __call__(self, residual: float) -> None:
        """Report after an iteration."""
        share = float(np.log(max(residual, 1e-300)) / np.log(self.tolerance))
        self.done = min(max(self.done, share), 1.0)
        self.progress("solve", self.done)

    def finish(self) -> None:
        """Report that all is done, where round-off ended the iteration before its tolerance did."""
        if self.done < 1:
            self(self.tolerance)


def conjugate_gradients(
    A: Any,
    b: Array,
    precondition: Callable[[Array], Array],
    tolerance: float,
    norm_A: float,
    max_iterations: int = MAX_ITERATIONS,
    progress: Progress | None = None,
    go_on: Callable[[float], bool] | None = None,
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
    each = Share(tolerance, progress) if progress else None
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
        if each:
            each(norm / norm_b)
        limit = max(tolerance * norm_b, 2 * np.finfo(float).eps * (norm_A * np.linalg.norm(x) + norm_b))
        if norm <= limit:
            if each:
                each.finish()
            return x, iteration, True
        if go_on and not go_on(norm / norm_b):
            return x, iteration, False
        if norm < best:
            best, best_at = norm, iteration
        elif iteration - best_at > STALLED:
            return x, iteration, False
        z = precondition(r)
        rz, old = float(r @ z), rz
        p = z + (rz / old) * p
    return x, max_iterations, False
