"""What every solution without time has in common: its arguments, phases, quality and verdict."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any

import numpy as np

from kratos_lite.errors import InputError, SolveError
from kratos_lite.mesh import Mesh
from kratos_lite.model.checks import equilibrium
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.solvers.plan import METHODS
from kratos_lite.typing import Array, Progress
from kratos_lite.validation import choice, function_or_none


class Phases:
    """Seconds spent in each named phase; `progress` is called where one begins and ends."""

    def __init__(self, progress: Progress | None = None) -> None:
        function_or_none(progress, "progress must be a function of a phase and a share")
        self.seconds: dict[str, float] = {}
        self.progress = progress

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Measure the body of a ``with`` statement."""
        start = perf_counter()
        if self.progress:
            self.progress(name, 0.0)
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start
        if self.progress:
            self.progress(name, 1.0)


def check_arguments(solver: str, tolerance: float) -> None:
    """Raise InputError for an unknown solver, or a tolerance beyond 0 … 1."""
    if isinstance(tolerance, bool) or not isinstance(tolerance, (float, int)) or not 0 < tolerance < 1:
        raise InputError(f"tolerance must be a number between 0 and 1; got {tolerance!r}")
    choice(solver, "solver", METHODS)


def quality(solution: Solution, balance: tuple[float, float]) -> dict[str, Any]:
    """Return how a solution was found and how good it is, by the names of a `Report`."""
    return {
        "solver": solution.method,
        "reason": solution.reason,
        "iterations": solution.iterations,
        "backward_error": solution.backward_error,
        "force_error": balance[0],
        "moment_error": balance[1],
    }


def initial_noise(model: Structure, norm: float, tolerance: float, forces: Array) -> float:
    """Return what rounding and the solver leave of the forces (n, 3) of an initial state, in N."""
    u0 = model.initial_displacement
    largest = 0.0 if u0 is None else float(np.abs(u0).max(initial=0.0))
    return float(max(np.finfo(float).eps * norm * largest, tolerance * np.linalg.norm(forces)))


def balance_of(
    mesh: Mesh, external: Array, forces: Array, reactions: Array, inner: Array, noise: float, unknowns: int
) -> tuple[float, float]:
    """Return what forces and moments miss to equilibrium, relative; `noise` in N is that of one unknown.

    `forces` are `external` ones without those of the initial stress, `inner` those of the stresses, (n, 3).
    """
    # Without loads, each prescribed degree of freedom may hold nothing but the rounding of K u.
    rounding = (unknowns**0.5 if forces.any() else np.count_nonzero(reactions)) * noise
    return equilibrium(mesh.points, external, reactions, inner, rounding)


def judge(solution: Solution, u: Array, balance: tuple[float, float]) -> None:
    """Raise SolveError for a solution that does not solve its equations or is not in equilibrium."""
    if not np.isfinite(u).all() or solution.backward_error > 1e-8:
        raise SolveError(
            f"{solution.method} solver reached a backward error of {solution.backward_error:.1e} only; "
            "ask for a smaller tolerance, or look for very thin elements, a large stiffness contrast or "
            "nearly free parts"
        )
    if max(balance) > 1e-2:
        raise SolveError(
            f"loads, reactions and stresses miss equilibrium by {balance[0]:.1e} (forces) and "
            f"{balance[1]:.1e} (moments) of their size; look for a large stiffness contrast, spurious modes, "
            "nearly free parts or an element class whose stiffness is not that of its stresses, and please "
            "report a model that has none"
        )
