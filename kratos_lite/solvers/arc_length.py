"""Arc length: steps of a given length along the path of equilibrium, beyond limit points."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from kratos_lite.errors import SolveError
from kratos_lite.solvers.newton import newton
from kratos_lite.typing import Array, Ints

Known = TypeVar("Known")


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
