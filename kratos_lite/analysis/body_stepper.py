"""Bodies for the stepping loop: substeps, loads that depend on the velocity, and starts under constraints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kratos_lite.analysis.integrators import body_integrator
from kratos_lite.analysis.state import State, state_of_body
from kratos_lite.bodies.batched import batch
from kratos_lite.bodies.body import Body
from kratos_lite.bodies.constraint_projection import project_velocity
from kratos_lite.typing import Array

CHECKED = 100
"""Steps after which the critical step is found anew, as the tangent may have stiffened."""


class BodyStepper:
    """One body, or many of one kind as one, with a clock of its own.

    Parameters
    ----------
    body : a body, or bodies that advance together.
    """

    def __init__(self, body: Body | Sequence[Body]) -> None:
        if isinstance(body, Body):
            body.clock = replace(body.clock)  # it may have advanced together with others before
        self.body = body if isinstance(body, Body) else batch(body)
        self.integrator = body_integrator(self.body)
        self.parts, self._free = 1, False

    def critical_step(self) -> float:
        """Return the longest stable step in s."""
        return self.integrator.critical_step(self.body)

    def prepare(self, h: float, parts: int) -> None:
        """Check steps of h s in so many parts."""
        body, self.parts = self.body, parts
        self.integrator.check_stable(body, h / parts)
        self.integrator.check(body, h / parts)

    def advance(self, h: float, count: int) -> None:
        """Take steps of h s."""
        body, part = self.body, h / self.parts
        moved = body.integrated_velocity is None or not np.array_equal(body.u, body.integrated_velocity)
        if body.constraints and moved:
            project_velocity(body, part)
        free = not body.constraints and all(load.is_constant for load in body.loads)
        self._free = free and self.integrator.free_steps(body, part, count * self.parts)
        with self.integrator.running():
            for _ in range(count):
                if not self._free:
                    self._step(part)
                body.clock.time += h  # one after the other, so that a restart comes to the same times
                body.clock.step += 1
        body.integrated_velocity = body.u.copy() if body.constraints else None
        if body.step // CHECKED > (body.step - count) // CHECKED:
            self.integrator.check_stable(body, part)

    def _step(self, h: float) -> None:
        """Take one step in parts of h s."""
        body, begin = self.body, self.body.time
        for part in range(self.parts):
            body.clock.time = begin + part * h
            before = body.u
            load = self._part(h)
            body.external_work += h / 2 * ((before + body.u) * load).sum(axis=-1)
            self.integrator.finish(body)
        body.clock.time = begin

    def _part(self, h: float) -> Array:
        """Advance by h s; return the load on the body, reactions included, at the middle.

        Loads that depend on the velocity see the old one first; then the step is taken again with the mean
        of old and new, so that they too are of second order.
        """
        body, q, u = self.body, self.body.q, self.body.u
        load: Array = self.integrator.step(body, h, u)
        if any(load.follows_velocity for load in body.loads):
            mean = (u + body.u) / 2
            body.q, body.u = q, u
            load = self.integrator.step(body, h, mean)
        return load

    def diverged(self) -> bool:
        """Return whether the velocity is no longer finite; steps all at once find that themselves."""
        return not self._free and not np.isfinite(self.body.u).all()

    def state(self) -> State:
        """Return the state of now."""
        return state_of_body(self.body, self.parts)
