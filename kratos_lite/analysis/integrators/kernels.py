"""Compiled steps of rigid and pseudo-rigid bodies, one or many, and what both kinds of them share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from kratos_lite import native
from kratos_lite.errors import SolveError
from kratos_lite.typing import Array

Arrays: TypeAlias = tuple[Array, ...]
"""q, u and what a step takes besides."""
Plain: TypeAlias = Callable[..., int]
"""Takes a step in NumPy; returns the first body that failed, or -1."""
PlainStep: TypeAlias = Callable[..., tuple[Array, int]]
"""The same under constant loads; returns the load at mid-step too."""
AT_ONCE = 100_000
"""Steps of one body in one call of a kernel: they take less than 0.1 s."""


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
    """Compiled steps of a kind of body beside those in NumPy.

    Attributes
    ----------
    word : with which its functions start.
    methods : names by their numbers in the kernel.
    newton : the one that iterates.
    """

    word: str
    methods: tuple[str, ...]
    newton: str

    def finish(self, plain: Plain, arrays: Arrays, h: float, method: str, tolerance: float) -> None:
        """Take a step of bodies, the first of the arrays, by the kernel or else in NumPy."""
        number = self.methods.index(method)
        failed = compiled(f"{self.word}_finish", *arrays, h, number, tolerance)
        if failed is NotImplemented:
            failed = plain(*arrays, h, method, tolerance)
        if failed >= 0:
            raise self._failure(method, arrays[0], failed, h)

    def steps(
        self,
        plain: PlainStep,
        arrays: Arrays,
        h: float,
        count: int,
        method: str,
        tolerance: float,
        work: Array | None,
    ) -> None:
        """Take steps of bodies under constant loads; errors are those of `finish`."""
        number, u = self.methods.index(method), arrays[1]
        most = max(1, AT_ONCE * u.shape[-1] // max(u.size, 1))
        for done in range(0, count, most):  # between calls Python handles signals
            few = min(most, count - done)
            failed = compiled(f"{self.word}_steps", *arrays, h, few, number, tolerance, work)
            if failed is NotImplemented:
                failed = _in_numpy(plain, arrays, h, few, method, tolerance, work)
            if failed[0] >= 0:
                raise self._failure(method, arrays[0], failed[0], h, done + failed[1])

    def _failure(self, method: str, q: Array, body: int, h: float, step: int | None = None) -> SolveError:
        """Return the error of a body, counted through all leading axes, whose step failed."""
        place = tuple(int(i) for i in np.unravel_index(body, q.shape[:-1]))
        whose = f" of body {place[0] if len(place) == 1 else place}" if place else ""
        when = "" if step is None else f" number {step + 1}"
        why = "its velocity grew beyond all numbers"
        if method == self.newton:
            why = "Newton's method found no velocity at its end"
        return SolveError(f"{method}: step{when}{whose}, h = {h:g} s, failed: {why}; use a shorter step")


def _in_numpy(
    plain: PlainStep, arrays: Arrays, h: float, count: int, method: str, tolerance: float, work: Array | None
) -> tuple[int, int]:
    """Take steps in NumPy; return the first body that failed, or -1, and in which step."""
    u = arrays[1]
    for step in range(count):
        before = u.copy()
        load, failed = plain(*arrays, h, method, tolerance)
        if failed >= 0:
            return failed, step
        if work is not None:
            work += h / 2 * ((before + u) * load).sum(axis=-1)
    return -1, 0
