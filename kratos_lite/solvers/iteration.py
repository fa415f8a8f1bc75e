"""Conjugate gradients, how much of their work is done, and when to give them up."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from kratos_lite.solvers import plan
from kratos_lite.typing import Array, Progress

MAX_ITERATIONS = 1000
"""A multigrid that needs more than these does not converge."""
STALLED = 200
"""A multigrid that finds no smaller residual in as many iterations does not converge either."""
GoOn: TypeAlias = Callable[[float], bool]
"""Takes a residual as a fraction of the first; returns whether to go on."""


class Monitor:
    """Follows an iteration by its residuals, as fractions of the first: progress, and whether to go on."""

    # Progress never falls. With `may_stop` an iteration ends that is slow: whose rate, after
    # `plan.PATIENCE_FROM` iterations, promises more than `plan.PATIENCE` in all. The rate is that between the
    # last two quarters, each the mean of its logarithms: residuals grow at first and jump.

    def __init__(self, tolerance: float, progress: Progress | None = None, may_stop: bool = False) -> None:
        self.progress, self.may_stop, self.is_slow, self.done = progress, may_stop, False, 0.0
        self._aim = math.log(max(tolerance, 1e-300))
        self._logs: list[float] = []

    def __call__(self, residual: float) -> bool:
        """Take the residual after an iteration; return whether to go on."""
        self._logs.append(math.log(max(residual, 1e-300)))
        if self.progress:
            self.done = min(max(self.done, self._logs[-1] / self._aim), 1.0)
            self.progress("solve", self.done)
        count, remaining = len(self._logs), self._logs[-1] - self._aim
        if self.may_stop and count >= plan.PATIENCE_FROM and remaining > 0:
            quarter = count // 4
            before, now = self._logs[-2 * quarter : -quarter], self._logs[-quarter:]
            rate = (math.fsum(before) - math.fsum(now)) / quarter**2
            self.is_slow = (plan.PATIENCE - count) * rate < remaining
        return not self.is_slow

    def finish(self) -> None:
        """Report that all is done, where round-off ended the iteration before its tolerance did."""
        if self.progress and self.done < 1:
            self.progress("solve", 1.0)


def conjugate_gradients(
    times: Callable[[Array], Array],
    b: Array,
    precondition: Callable[[Array], Array],
    tolerance: float,
    norm_A: float,
    each: GoOn | None = None,
) -> tuple[Array, int, bool]:
    """Solve A x = b, A positive definite and given by its product; return x, iterations, success."""
    # It stops when |r| ≤ tolerance |b|, or when |r| reaches what round-off allows, 2 eps (|A| |x| + |b|); and
    # gives up when `STALLED` iterations bring no new smallest residual, or when `each`, called with |r| /
    # |b|, returns False. Source: Saad, Iterative Methods for Sparse Linear Systems (2003), algorithm 9.1.
    x, r = np.zeros_like(b), b.copy()
    norm_b = float(np.linalg.norm(b))
    if norm_b == 0:
        return x, 0, True
    best, best_at = np.inf, 0  # residuals may grow at first
    z = precondition(r)
    p, rz = z.copy(), float(r @ z)
    for iteration in range(1, MAX_ITERATIONS + 1):
        Ap = times(p)
        curvature = float(p @ Ap)
        if not (curvature > 0 and rz > 0):
            return x, iteration, False
        alpha = rz / curvature
        x += alpha * p
        r -= alpha * Ap
        norm = float(np.linalg.norm(r))
        going = each is None or each(norm / norm_b)
        limit = max(tolerance * norm_b, 2 * np.finfo(float).eps * (norm_A * np.linalg.norm(x) + norm_b))
        if norm <= limit:
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
    return x, MAX_ITERATIONS, False
