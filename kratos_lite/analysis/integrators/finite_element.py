"""Integrators of finite-element bodies.

Each step is drift–kick–drift: half a step of displacement with the old velocity, loads at the middle, the new
velocity, and half a step with that.  They differ in the matrix of the velocity update.

Source: bodies of Solfec-1.0 (Koziara & Bićanić, IJNME 81 (2010) 1073-1092; Zhang & Skeel, Appl. Numer.
Math. 25 (1997) 297-302); Simo & Tarnow, ZAMP 43 (1992) 757-792.
"""

from __future__ import annotations

import logging
from abc import abstractmethod
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from kratos_lite.analysis.integrators.base import BodyIntegrator
from kratos_lite.bodies.body import Deformable
from kratos_lite.bodies.constraint_projection import Step, constrained_step
from kratos_lite.bodies.finite_element import FiniteElementBody
from kratos_lite.bodies.formulations import Turned, correction
from kratos_lite.bodies.linear_algebra import Solve
from kratos_lite.errors import SolveError
from kratos_lite.solvers.direct import one_thread
from kratos_lite.typing import Array

_log = logging.getLogger("kratos_lite")
STIFF = 15.0  # h ω up to which the linearly implicit integrator has never been seen to blow up
NEWTON_MAX = 50  # iterations of one step; a step that needs more is too long
SLOW = 0.2  # rate of corrections above which another matrix is made
FIRST = 1e-5  # relative residual down to which the first one is solved
ROUNDING = float(np.finfo(float).eps)  # residual beside its terms that no correction makes smaller


class _FiniteElement(BodyIntegrator[FiniteElementBody]):
    bodies = FiniteElementBody

    def running(self) -> AbstractContextManager[Any]:
        """Keep dense algebra to one thread."""
        return one_thread()

    def finish(self, body: FiniteElementBody) -> None:
        """Bring displacement and velocity to what the formulation can represent."""
        body.q, body.u = body.formulation.project(body.q, body.u)


class _Kick(_FiniteElement):
    @abstractmethod
    def solver(self, body: FiniteElementBody, qh: Array, h: float) -> Solve:
        """Return what turns forces at the middle into changes of the velocity by h."""

    def step(self, body: FiniteElementBody, h: float, v: Array) -> Array:
        """Take a step; see `BodyIntegrator.step`."""
        qh = body.q + h / 2 * body.u
        solve = self.solver(body, qh, h)
        load = body.external_force(qh, body.time + h / 2, v)
        force = load - body.internal_force(qh)
        if body.damping:
            force -= body.damping * body.formulation.damping_load(qh, body.u)

        def advance(extra: Array) -> Step:
            u = body.u + h * solve(force + extra)
            return Step(qh + h / 2 * u, u, load)

        return constrained_step(body, h, qh, advance, lambda: solve)


class Explicit(_Kick):
    """Explicit (Solfec's DEF_EXP): momenta exact, energy bounded, steps up to the critical one."""

    name = "explicit"

    def critical_step(self, body: FiniteElementBody) -> float:
        """Return `Deformable.critical_step`."""
        return body.critical_step()

    def solver(self, body: FiniteElementBody, qh: Array, h: float) -> Solve:
        """Return the solution with the mass matrix."""
        return body.mass_solver()


class LinearlyImplicit(_Kick):
    """Linearly implicit (Solfec's DEF_LIM): M + (η h/2 + h²/4) K at the middle.

    The linear momentum is exact, the angular one to O(h⁴); a stiff body that spins may gain energy.
    """

    name = "linearly_implicit"

    def check(self, body: FiniteElementBody, h: float) -> None:
        """Warn of stiff bodies."""
        warn_of_stiffness(body, h)

    def solver(self, body: FiniteElementBody, qh: Array, h: float) -> Solve:
        """Return the solution with the tangent at the middle."""
        return body.solver(qh, body.damping * h / 2 + h * h / 4)


class EnergyMomentum(_FiniteElement):
    """Implicit: energy and both momenta exact whatever the step.

    M (u⁺ - u) / h + f(q, dq) = f_ext at q + dq/2, with dq = h/2 (u + u⁺).
    """

    name = "energy_momentum"

    def step(self, body: FiniteElementBody, h: float, v: Array) -> Array:
        """Take a step; see `BodyIntegrator.step`."""
        middle = body.q + h / 2 * body.u
        make = body.solver if body.constraints else body.formulation.solver_at_rest  # reactions need K(q)
        solve = make(middle, h * h / 4 * (1 + 2 * body.damping / h))

        def advance(extra: Array) -> Step:
            u, load = _balanced(body, h, v, extra, solve)
            return Step(body.q + h / 2 * (body.u + u), u, load)

        return constrained_step(body, h, middle, advance, lambda: solve)


def _balanced(
    body: FiniteElementBody, h: float, loading: Array, extra: Array, solve: Solve
) -> tuple[Array, Array]:
    """Return the velocity at the end and the load at the middle, by Newton with a matrix kept a while."""
    # A correction is solved a little better than the last one served, but not below rounding.
    # Source: Eisenstat & Walker, SIAM J. Sci. Comput. 17 (1996) 16-32 (inexact Newton methods).
    formulation, q, u, ratio = body.formulation, body.q, body.u, body.damping / h
    v, start, last, moved, exactness = u, body.times_mass(u), np.inf, np.inf, FIRST
    for _ in range(NEWTON_MAX):
        dq = h / 2 * (u + v)
        load = body.external_force(q + dq / 2, body.time + h / 2, loading)
        given, end = h * (load + extra), body.times_mass(v)
        r = given - h * formulation.load_over(q, dq, ratio) - (end - start)
        size = float(np.linalg.norm(r))
        terms = h * formulation.norm * dq, end, given
        rounding = ROUNDING * sum(float(np.linalg.norm(term)) for term in terms)
        if size <= rounding:
            return v, load
        if size > last / 2:
            by_loads = float(np.abs(correction(solve, given, FIRST)).max())  # of a body at rest
            if moved <= 1e-9 * max(float(np.abs(v).max()), by_loads):
                return v, load
        if size > SLOW * last:
            if isinstance(solve, Turned):  # the body is too far from that at rest: begin again
                v, last, exactness = u, np.inf, SLOW / 10
                solve = body.solver(q + h / 2 * u, h * h / 4 * (1 + 2 * ratio))
                continue
            solve = formulation.increment_solver(q, dq, ratio, h * h / 2)
        if size < last < np.inf:
            exactness = size / last / 10
        step = correction(solve, r, max(exactness, rounding / size / 2))
        v, last, moved = v + step, size, float(np.abs(step).max())
        if not np.isfinite(moved):
            break
        if moved <= body.tolerance * float(np.abs(v).max()):
            return v, load
    raise SolveError(
        f"the energy–momentum step at t = {body.time:g} s with dt = {h:g} s does not converge; "
        "take a shorter step"
    )


def warn_of_stiffness(body: Deformable, h: float) -> None:
    """Warn where linearly implicit steps of h s may let a stiff body that spins gain energy."""
    if (number := h * body.highest_frequency()) > STIFF:
        _log.warning(
            "linearly_implicit with h ω = %.3g: above %g a stiff body that spins may gain energy without "
            "bound; use energy_momentum, a shorter step or damping",
            number,
            STIFF,
        )
