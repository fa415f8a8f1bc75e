"""Newton's method, cuts of steps that it does not find, and arc length: for laws, transients and bodies."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from kratos_lite.errors import SolveError
from kratos_lite.typing import Array, Ints

_log = logging.getLogger("kratos_lite")
SMALLEST_PART = 1 / 1024
"""Fraction of a step below which it is not cut further."""
EASY = 6
"""Iterations of a part of a step after which the next part is twice as long."""
GROWN = 1e4
"""Growth of the residual from which an iteration has diverged."""
FORCING = 1e-3
"""Largest relative residual to which corrections are solved where multigrid solves them."""
Known = TypeVar("Known")


def newton(
    x: Array,
    evaluate: Callable[[Array], tuple[float, Known]],
    correction: Callable[[Array, Known, list[float]], Array],
    tolerance: float,
    iterations: int,
    least: int = 0,
) -> tuple[Array, Known, list[float]]:
    """Correct x until a relative residual is small; return x, what is known there, and the residuals.

    `evaluate` returns the relative residual at x and what `correction`, which has the residuals, too, needs.
    At least so many corrections are made, at most `iterations`.
    """
    residuals: list[float] = []
    while True:
        with np.errstate(over="ignore", invalid="ignore"):  # x may have run away, which is refused below
            residual, known = evaluate(x)
        residuals.append(residual)
        count = len(residuals) - 1
        if count >= least and residual <= tolerance:
            return x, known, residuals
        if not residual <= GROWN * max(residuals[0], 1.0):
            raise SolveError("the iteration diverges")
        if count == iterations:
            last = ", ".join(f"{value:.1e}" for value in residuals[-3:])
            raise SolveError(f"no convergence in {iterations} iterations: relative residuals … {last}")
        x = x + correction(x, known, residuals)


def forcing(residuals: list[float], tolerance: float) -> float:
    """Return the relative residual to which a correction is worth being solved."""
    # Source: Eisenstat & Walker, SIAM J. Sci. Comput. 17 (1996) 16-32.
    ratio = residuals[-1] / residuals[-2] if len(residuals) > 1 and residuals[-2] else 1.0
    return max(min(FORCING, ratio**2), 0.1 * tolerance / max(residuals[-1], tolerance))


def in_parts(advance: Callable[[float, float], int]) -> tuple[float, SolveError | None]:
    """Advance from the fraction 0 of a step to 1, in parts where that does not converge.

    `advance` goes from one fraction to another and returns the iterations.  What is returned is the fraction
    that was reached, and why no more was.
    """
    done, part = 0.0, 1.0
    while done < 1.0:
        fraction = min(done + part, 1.0)
        try:
            iterations = advance(done, fraction)
        except SolveError as error:
            part /= 2
            if part < SMALLEST_PART:
                return done, error
            _log.info("a step is cut to %g of its length: %s", part, error)
            continue
        done = fraction
        part *= 2 if iterations < EASY else 1
    return done, None


def along_path(
    start: tuple[Array, float],
    before: Array,
    length: float,
    free: Ints,
    evaluate: Callable[[Array, float], tuple[float, Known]],
    solve: Callable[[Array, Known, list[float]], list[Array]],
    tolerance: float,
    iterations: int,
) -> tuple[Array, float, Known, list[float]]:
    """Go a length along the path, on a cylinder about the start in the free components.

    `start` is displacements and load factor, `before` the step before this one, which says where to go on.
    `evaluate` returns the relative residual and what `solve` needs, which returns K⁻¹ of the load of a unit
    factor and of the residual.  Returns displacements, factor, what is known there, and the residuals.
    Source: Crisfield, Comput. Struct. 13 (1981) 55-62; the direction: Feng, Perić & Owen, Comput. Struct. 54
    (1995) 293-302.
    """

    def correction(x: Array, known: Known, residuals: list[float]) -> Array:
        unit, rest = solve(x[:-1], known, residuals)
        done = (x[:-1] - start[0])[free]
        along, other = unit[free], done + rest[free]
        ahead = (done if len(residuals) > 1 else before[free]) @ along
        a, b = along @ along, along @ other
        root = b**2 - a * (other @ other - length**2)
        if root < 0:
            raise SolveError("the arc misses the path")
        factor = (np.copysign(root**0.5, ahead) - b) / a
        return np.append(rest + factor * unit, factor)

    x, known, residuals = newton(
        np.append(*start), lambda x: evaluate(x[:-1], float(x[-1])), correction, tolerance, iterations, 1
    )
    return x[:-1], float(x[-1]), known, residuals
