"""Schemes: one step of a body in time.

Every step is drift–kick–drift: half a step of configuration with the old velocity, loads at the middle,
the new velocity, and half a step with that.  Rigid schemes differ in what they do with the rotation,
deformable ones in the matrix of the kick.

Source: bodies of Solfec-1.0 (Koziara & Bićanić, IJNME 81 (2010) 1073-1092; Zhang & Skeel, Appl. Numer.
Math. 25 (1997) 297-302); Simo & Tarnow, ZAMP 43 (1992) 757-792.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.bodies import steps
from kratos_lite.bodies.body import Body
from kratos_lite.bodies.constraint_projection import Step, constrained_step
from kratos_lite.bodies.finite_element import FiniteElementBody
from kratos_lite.bodies.linear_algebra import Solve
from kratos_lite.bodies.pseudo_rigid import PseudoRigidBody
from kratos_lite.bodies.rigid import RigidBody
from kratos_lite.errors import SolveError
from kratos_lite.typing import Array

NEWTON_MAX = 50
"""Iterations of one step; a step that needs more is too long."""
SLOW = 0.2
"""Rate of an iteration with old factors above which new ones are made."""


def rigid_step(body: RigidBody, h: float, v: Array) -> Array:
    """Advance a rigid body by h s, loaded as by the velocity v; return the generalized load at the middle."""
    qh = steps.rigid_half(body.q, body.u, h)
    load = body.external_load(qh, body.time + h / 2, v)

    def advance(extra: Array) -> Step:
        q, u = body.q.copy(), body.u.copy()
        steps.rigid_finish(q, u, qh, load + extra, *body.step_constants(), h, body.scheme, body.tolerance)
        return Step(q, u, load)

    return constrained_step(body, h, qh, advance, lambda: body.apart)


def pseudo_rigid_step(body: PseudoRigidBody, h: float, v: Array) -> Array:
    """Advance a pseudo-rigid body by h s; see `rigid_step`."""
    qh = body.q + h / 2 * body.u
    load = body.external_load(qh, body.time + h / 2, v)
    c = 0.0 if body.scheme == "DEF_EXP" else body.damping * h / 2 + h * h / 4

    def advance(extra: Array) -> Step:
        q, u = body.q.copy(), body.u.copy()
        steps.pseudo_finish(q, u, load + extra, *body.step_constants(), h, body.scheme, body.tolerance)
        return Step(q, u, load)

    return constrained_step(body, h, qh, advance, lambda: body.solver(qh, c))


def explicit_step(body: FiniteElementBody, h: float, v: Array) -> Array:
    """Advance by ``DEF_EXP``: the kick takes the mass matrix alone; see `rigid_step`."""
    return _kick(body, h, v, body.q + h / 2 * body.u, body.mass_solver())


def linearly_implicit_step(body: FiniteElementBody, h: float, v: Array) -> Array:
    """Advance by ``DEF_LIM``: M + (η h/2 + h²/4) K at the middle; see `rigid_step`."""
    qh = body.q + h / 2 * body.u
    return _kick(body, h, v, qh, body.solver(qh, body.damping * h / 2 + h * h / 4))


def _kick(body: FiniteElementBody, h: float, v: Array, qh: Array, solve: Solve) -> Array:
    load = body.external_load(qh, body.time + h / 2, v)
    force = load - body.internal_load(qh)
    if body.damping:
        force -= body.damping * body.damping_load(qh, body.u)

    def advance(extra: Array) -> Step:
        u = body.u + h * solve(force + extra)
        return Step(qh + h / 2 * u, u, load)

    return constrained_step(body, h, qh, advance, lambda: solve)


def energy_momentum_step(body: FiniteElementBody, h: float, v: Array) -> Array:
    """Advance by ``ENERGY_MOMENTUM``; see `rigid_step`.

    M (u⁺ - u) / h + f(q, dq) = f_ext at q + dq/2, with dq = h/2 (u + u⁺).
    """
    middle = body.q + h / 2 * body.u
    solve = body.solver(middle, h * h / 4 * (1 + 2 * body.damping / h))

    def advance(extra: Array) -> Step:
        u, load = _balanced(body, h, v, extra, solve)
        return Step(body.q + h / 2 * (body.u + u), u, load)

    return constrained_step(body, h, middle, advance, lambda: solve)


def _balanced(
    body: FiniteElementBody, h: float, loading: Array, extra: Array, solve: Solve
) -> tuple[Array, Array]:
    """Return the velocity at the end and the load at the middle, by Newton with factors kept a while."""
    q, u, ratio = body.q, body.u, body.damping / h
    v, last = u.copy(), np.inf
    for _ in range(NEWTON_MAX):
        dq = h / 2 * (u + v)
        load = body.external_load(q + dq / 2, body.time + h / 2, loading)
        force = load + extra - body.load_over(q, dq, ratio)
        step = solve(h * force - body.times_mass(v - u))
        size, scale = float(np.abs(step).max()), float(np.abs(v).max())
        if not np.isfinite(size):
            break
        v = v + step
        if size <= body.tolerance * scale:
            return v, load
        if size > SLOW * last:
            given = float(np.abs(solve(h * (load + extra))).max())  # at rest, loads tell what is small
            if size <= 1e-9 * max(scale, given):
                return v, load
            solve = body.increment_solver(q, h / 2 * (u + v), ratio, h * h / 2)
        last = size
    raise SolveError(
        f"the energy–momentum step at t = {body.time:g} s with dt = {h:g} s does not converge; "
        "take a shorter step"
    )


def take_step(body: Body, h: float) -> Array:
    """Advance a body by h s with its scheme; return the load on it, reactions included, at the middle.

    Loads that depend on the velocity see the old one first; then the step is taken again with the mean of
    old and new, so that they too are of second order.
    """
    q, u = body.q, body.u
    load = _loaded_by(body, h, u)
    if any(load.follows_velocity for load in body.loads):
        mean = (u + body.u) / 2
        body.q, body.u = q, u
        load = _loaded_by(body, h, mean)
    return load


def _loaded_by(body: Body, h: float, v: Array) -> Array:
    """Take the step with loads as they are at the velocity v."""
    if isinstance(body, RigidBody):
        return rigid_step(body, h, v)
    if isinstance(body, PseudoRigidBody):
        return pseudo_rigid_step(body, h, v)
    assert isinstance(body, FiniteElementBody)
    return FINITE_ELEMENT_SCHEMES[body.scheme](body, h, v)


FINITE_ELEMENT_SCHEMES: dict[str, Callable[[FiniteElementBody, float, Array], Array]] = {
    "DEF_EXP": explicit_step,
    "DEF_LIM": linearly_implicit_step,
    "ENERGY_MOMENTUM": energy_momentum_step,
}
