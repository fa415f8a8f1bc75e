"""Schemes: one step of a body in time.

Every step is drift–kick–drift: half a step of configuration with the old velocity, loads at the middle,
the new velocity, and half a step with that.  Rigid schemes differ in what they do with the rotation,
deformable ones in the matrix of the kick.

Source: bodies of Solfec-1.0 (Koziara & Bićanić, IJNME 81 (2010) 1073-1092; Zhang & Skeel, Appl. Numer.
Math. 25 (1997) 297-302); Simo & Tarnow, ZAMP 43 (1992) 757-792.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from kratos_lite.bodies import steps
from kratos_lite.bodies.body import Body
from kratos_lite.bodies.deformable import Deformable, Solve
from kratos_lite.bodies.rigid import RigidBody
from kratos_lite.errors import SolveError

Array = NDArray[np.float64]
Advance: TypeAlias = Callable[[Array], tuple[Array, Array]]
"""Gives configuration and velocity at the end of a step under an additional generalised force."""

NEWTON_MAX = 50
"""Iterations of one step; a step that needs more is too long."""
SLOW = 0.2
"""Rate of an iteration with old factors above which new ones are made."""


def rigid_step(body: RigidBody, h: float) -> Array:
    """Advance a rigid body by h s; return the generalised load at the middle."""
    qh = steps.rigid_half(body.q, body.u, h)
    load = body.external_load(qh, body.time + h / 2)
    c = body.characteristics

    def advance(extra: Array) -> tuple[Array, Array]:
        q, u = body.q.copy(), body.u.copy()
        steps.rigid_finish(q, u, qh, load + extra, c.inertia, c.mass, h, body.scheme, body.tolerance)
        return q, u

    def apart(b: Array) -> Array:
        spin = np.linalg.solve(c.inertia, b[:3])
        return np.concatenate([spin, b[3:] / c.mass])

    return _finish(body, h, qh, load, advance, apart)


def explicit_step(body: Deformable, h: float) -> Array:
    """Advance by ``DEF_EXP``: the kick takes the mass matrix alone; return the load at the middle."""
    return _kick(body, h, lambda qh: body.mass_solver())


def linearly_implicit_step(body: Deformable, h: float) -> Array:
    """Advance by ``DEF_LIM``: M + (η h/2 + h²/4) K at the middle; return the load there."""
    c = body.damping * h / 2 + h * h / 4
    return _kick(body, h, lambda qh: body.solver(qh, c))


def _kick(body: Deformable, h: float, solver: Callable[[Array], Solve]) -> Array:
    qh = body.q + h / 2 * body.u
    load = body.external_load(qh, body.time + h / 2)
    force = load - body.internal_load(qh)
    if body.damping:
        force -= body.damping * body.damping_load(qh, body.u)
    solve = solver(qh)

    def advance(extra: Array) -> tuple[Array, Array]:
        u = body.u + h * solve(force + extra)
        return qh + h / 2 * u, u

    return _finish(body, h, qh, load, advance, solve)


def energy_momentum_step(body: Deformable, h: float) -> Array:
    """Advance by ``ENERGY_MOMENTUM``; return the external load at the middle.

    M (u⁺ - u) / h + f(q, dq) = f_ext at q + dq/2, with dq = h/2 (u + u⁺).
    """
    c = h * h / 4 * (1 + 2 * body.damping / h)
    middle = body.q + h / 2 * body.u
    first = body.solver(middle, c)
    loads = [body.external_load(middle, body.time + h / 2)]

    def advance(extra: Array) -> tuple[Array, Array]:
        u = _balanced(body, h, extra, first, loads)
        return body.q + h / 2 * (body.u + u), u

    return _finish(body, h, middle, loads[0], advance, first, loads)


def _balanced(body: Deformable, h: float, extra: Array, solve: Solve, loads: list[Array]) -> Array:
    """Return the velocity at the end of a step, by Newton with factors kept for as long as they do."""
    q, u, ratio, time = body.q, body.u, body.damping / h, body.time + h / 2
    v, last = u.copy(), np.inf
    for _ in range(NEWTON_MAX):
        dq = h / 2 * (u + v)
        loads[0] = body.external_load(q + dq / 2, time) if body.loads else loads[0]
        force = loads[0] + extra - body.load_over(q, dq, ratio)
        step = solve(h * force - body.times_mass(v - u))
        size, scale = float(np.abs(step).max()), float(np.abs(v).max())
        if not np.isfinite(size):
            break
        v = v + step
        if size <= body.tolerance * scale:
            return v
        if size > SLOW * last:
            given = float(np.abs(solve(h * (loads[0] + extra))).max())  # at rest, loads tell what is small
            if size <= 1e-9 * max(scale, given):
                return v
            solve = body.increment_solver(q, h / 2 * (u + v), ratio, h * h / 2)
        last = size
    raise SolveError(
        f"the energy–momentum step at t = {body.time:g} s with dt = {h:g} s does not converge; "
        "take a shorter step"
    )


# ---- constraints -----------------------------------------------------------------------------------


def _finish(
    body: Body,
    h: float,
    qh: Array,
    load: Array,
    advance: Advance,
    solve: Solve,
    loads: list[Array] | None = None,
) -> Array:
    """Take the step, with the reactions of the constraints; return load and reactions at the middle."""
    if not body.constraints:
        body.q, body.u = advance(np.zeros_like(load))
        return load if loads is None else loads[0]
    for constraint in body.constraints:
        constraint.begin(body, h)
    H = np.concatenate([constraint.rows(body, qh) for constraint in body.constraints])
    response = h * (
        H @ solve(np.ascontiguousarray(H.T)) if body.dofs > 12 else H @ np.stack([solve(r) for r in H], 1)
    )
    inverse = np.linalg.pinv(response, rcond=1e-12, hermitian=True)
    multipliers, last, q, u = np.zeros(len(H)), np.inf, body.q, body.u
    for _ in range(NEWTON_MAX):
        q, u = advance(H.T @ multipliers)
        end = body.time + h
        gap = np.concatenate([c.gaps(body, q, u, end, h) for c in body.constraints])
        size, scale = float(np.abs(gap).max()), float((np.abs(H) @ np.abs(u)).max())
        if size <= 1e-15 * scale or (size > 0.5 * last and size <= 1e-6 * scale + 1e-11 / h):
            break
        if not np.isfinite(size) or size > 10 * last:
            raise SolveError(_unmet(body, h))
        multipliers = multipliers - inverse @ gap
        last = size
    else:
        raise SolveError(_unmet(body, h))
    at = 0
    for constraint in body.constraints:
        constraint.react(body, qh, multipliers[at : at + constraint.count])
        at += constraint.count
    body.q, body.u = q, u
    return (load if loads is None else loads[0]) + H.T @ multipliers


def _unmet(body: Body, h: float) -> str:
    return (
        f"the constraints cannot be met in the step at t = {body.time:g} s with dt = {h:g} s: "
        "they contradict each other, or the step is too long"
    )


SCHEMES: dict[str, Callable[..., Array]] = {
    "RIG_POS": rigid_step,
    "RIG_NEG": rigid_step,
    "RIG_IMP": rigid_step,
    "DEF_EXP": explicit_step,
    "DEF_LIM": linearly_implicit_step,
    "ENERGY_MOMENTUM": energy_momentum_step,
}
"""One step of each scheme: takes a body and h, moves the body, returns the load on it at the middle."""
