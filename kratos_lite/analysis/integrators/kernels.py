"""Compiled steps of rigid and pseudo-rigid bodies, one or many, and what both kinds of them share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from kratos_lite import native
from kratos_lite.errors import SolveError
from kratos_lite.typing import Array

Finish: TypeAlias = Callable[..., int]
"""Completes a step in NumPy; returns the first body that failed, or -1."""
Step: TypeAlias = Callable[..., tuple[Array, int]]
"""Takes a step in NumPy under constant loads; returns the load at mid-step, too."""
AT_ONCE = 100_000  # steps of one body in one call of a kernel: they take less than 0.1 s


def compiled(name: str, *arguments: Any) -> Any:
    """Return what a compiled function returns, NotImplemented without it or where arrays do not fit."""
    motion = native.kernels("motion")
    if motion is None:
        return NotImplemented
    try:
        return getattr(motion, name)(*arguments)
    except TypeError:  # how the bindings refuse arrays that are not C-contiguous float64: NumPy takes those
        return NotImplemented


@dataclass(frozen=True)
class StepKernel:
    """Compiled steps of bodies of a class beside those in NumPy."""

    word: str  # with which its functions start
    methods: tuple[str, ...]  # names by their numbers in the kernel
    newton: str  # the one that iterates
    tolerance: float  # of that
    in_numpy: Finish
    step_in_numpy: Step

    def finish(self, *arrays: Any, h: float, method: str, tolerance: float | None = None) -> None:
        """Take a step h of bodies q, u, the first of the arrays, in place, with the load at mid-step."""
        arrays = tuple(map(np.asarray, arrays))
        settings = h, self.methods.index(method), tolerance or self.tolerance
        failed = compiled(f"{self.word}_finish", *arrays, *settings)
        if failed is NotImplemented:
            failed = self.in_numpy(*arrays, h, method, settings[2])
        if failed >= 0:
            raise self._failure(method, arrays[0], failed, h)

    def advance(self, body: Any, *loads: Array, h: float, count: int) -> None:
        """Take steps h of a body under constant loads."""
        how = {"method": body.integrator, "tolerance": body.tolerance, "work": body.external_work}
        self.steps(body.q, body.u, *body.step_constants(), *loads, h=h, count=count, **how)

    def steps(
        self,
        *arrays: Any,
        h: float,
        count: int,
        method: str,
        tolerance: float | None = None,
        work: Array | None = None,
    ) -> None:
        """Take steps h of bodies in place under constant loads, the last of the arrays; add up their work."""
        arrays, settings = tuple(map(np.asarray, arrays)), (method, tolerance or self.tolerance, work)
        u = arrays[1]
        most = max(1, AT_ONCE * u.shape[-1] // max(u.size, 1))
        for done in range(0, count, most):  # between calls Python handles signals
            failed, step = self._some_steps(arrays, h, min(most, count - done), *settings)
            if failed >= 0:
                raise self._failure(method, arrays[0], failed, h, done + step)

    def _some_steps(
        self, arrays: tuple[Any, ...], h: float, count: int, method: str, tolerance: float, work: Array | None
    ) -> tuple[int, int]:
        """Take steps; return the first body that failed, or -1, and in which step."""
        number, u = self.methods.index(method), arrays[1]
        ended: tuple[int, int] = compiled(f"{self.word}_steps", *arrays, h, count, number, tolerance, work)
        if ended is not NotImplemented:
            return ended
        for step in range(count):
            before = u.copy()
            load, failed = self.step_in_numpy(*arrays, h, method, tolerance)
            if failed >= 0:
                return failed, step
            if work is not None:
                work += h / 2 * ((before + u) * load).sum(axis=-1)
        return -1, 0

    def _failure(self, method: str, q: Array, body: int, h: float, step: int | None = None) -> SolveError:
        """Return the error of a body, counted through all leading axes, whose step failed."""
        place = tuple(int(i) for i in np.unravel_index(body, q.shape[:-1]))
        whose = f" of body {place[0] if len(place) == 1 else place}" if place else ""
        when = "" if step is None else f" number {step + 1}"
        why = "its velocity grew beyond all numbers"
        if method == self.newton:
            why = "Newton's method found no velocity at its end"
        return SolveError(f"{method}: step{when}{whose}, h = {h:g} s, failed: {why}; use a shorter step")
