"""Constraint projection: the reactions with which a step ends on the constraints.

What a step makes of an additional force is known only by taking it; how the ends of the constraints answer
to their reactions, W = h H A^-1 H^T, is known well enough to correct the reactions until the gaps close.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from kratos_lite.bodies.body import Body
from kratos_lite.bodies.constraints import with_slices
from kratos_lite.bodies.linear_algebra import Solve
from kratos_lite.errors import InputError, SolveError
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_log = logging.getLogger("kratos_lite")

CORRECTIONS_MAX = 50
ROUND_OFF = 1e-15
"""Fraction of the velocities that a gap cannot get below."""
CLOSED = 1e-9
"""Fraction of the velocities that a gap may be where corrections no longer help."""
JUMP = 1e-9
"""Fraction of the positions by which a constraint may be violated at the start."""
PLACED = 1e-13
"""Fraction of the positions that it may be there."""


class Step(NamedTuple):
    """The end of a step: configuration, velocity, and the generalized load at its middle."""

    q: Array
    u: Array
    load: Array


Advance: TypeAlias = Callable[[Array], Step]
"""Gives the end of a step under an additional generalized force."""


def constrained_step(body: Body, h: float, qh: Array, advance: Advance, solver: Callable[[], Solve]) -> Array:
    """Take a step of h s that meets the constraints; return the load with reactions (..., dofs)."""
    if not body.constraints:
        step = advance(np.zeros_like(body.u))
        body.q, body.u = step.q, step.u
        return step.load
    for constraint in body.constraints:
        constraint.begin(body, h)
    H = constraint_jacobian(body, qh)
    inverse = np.asarray(np.linalg.pinv(h * H @ solver()(H.T), rcond=1e-12, hermitian=True), dtype=float)
    step, multipliers = _corrected(body, h, H, inverse, advance)
    for constraint, part in with_slices(body.constraints):
        constraint.set_reactions(body, qh, multipliers[part])
    body.q, body.u = step.q, step.u
    return step.load + H.T @ multipliers


def project_velocity(body: Body, h: float) -> None:
    """Make the velocities of a body satisfy its constraints by an impulse; InputError if they are not met."""
    before, H = float(body.kinetic_energy()), constraint_jacobian(body, body.q)
    wanted, size = [], _extent(body)
    for constraint in body.constraints:
        x, v = body.position(constraint.points), body.velocity(constraint.points)
        gap = float(np.abs(constraint.violation(x, v, body.time)).max()) if constraint.positional else 0.0
        if gap > JUMP * size:
            raise InputError(
                f"a {type(constraint).__name__} is not met: its gap is {gap:.3g} m at t = {body.time:g} s, "
                "where the body is: it would have to jump; let the motion start there, or bring the body to "
                "rest with find_equilibrium"
            )
        along = np.einsum("mri,mi->mr", constraint.directions(x), v)
        wanted.append(constraint.starting_velocities(along, body.time, h).ravel())
    miss = np.concatenate(wanted) - H @ body.u
    if not np.abs(miss).max() > ROUND_OFF * np.abs(H @ np.abs(body.u)).max():
        return
    columns = body.mass_solver()(H.T)
    u = body.u + columns @ (np.linalg.pinv(H @ columns, rcond=1e-12, hermitian=True) @ miss)
    residual = np.concatenate(wanted) - H @ u
    if np.abs(residual).max() > CLOSED * max(np.abs(miss).max(), np.abs(H @ np.abs(u)).max()):
        raise SolveError("the constraints cannot be met at the start: they contradict each other")
    body.u = u
    after = float(body.kinetic_energy())
    if abs(after - before) > 1e-9 * max(before, after):
        _log.warning(
            "the velocity at the start is not one that the constraints allow: an impulse changes the kinetic "
            "energy from %.6g to %.6g J",
            before,
            after,
        )


def _extent(body: Body) -> float:
    """Return the size of the positions of the constrained points, and of the body about them, in m."""
    constrained = np.concatenate([body.position(constraint.points) for constraint in body.constraints])
    return float(max(np.abs(constrained).max(), np.abs(constrained - body.mass_center()).max()))


def constraint_jacobian(body: Body, q: Array) -> Array:
    """Return H (c, dofs) of all constraints of a body."""
    return np.concatenate([constraint.jacobian(body, q) for constraint in body.constraints])


def unconstrained_motions(H: Array) -> csr_array[Any, Any]:
    """Return a basis (dofs, k) of the motions that rows H (c, dofs) leave free: H T = 0."""
    from scipy.linalg import null_space
    from scipy.sparse import csr_array, eye_array, hstack

    tied = (H != 0).any(axis=0)  # only these dofs take part in constraints
    several = ((H != 0).sum(axis=1) > 1).any()  # else each row fixes one displacement
    inner = null_space(H[:, tied]) if several else np.zeros((tied.sum(), 0))
    unit = eye_array(H.shape[1], format="csc")
    return csr_array(hstack([csr_array(unit[:, tied] @ inner), unit[:, ~tied]], format="csr"))


def _corrected(body: Body, h: float, H: Array, inverse: Array, advance: Advance) -> tuple[Step, Array]:
    """Return the step and the multipliers with which the gaps close."""
    multipliers, last, end = np.zeros(len(H)), np.inf, body.time + h
    extent = _extent(body)
    for _ in range(CORRECTIONS_MAX):
        step = advance(H.T @ multipliers)
        gap = np.concatenate([c.gaps(body, step.q, step.u, end, h) for c in body.constraints])
        size, speed = float(np.abs(gap).max()), float(np.abs(H @ step.u).max())
        allowed = CLOSED * speed + PLACED * extent * 2 / h
        if size <= ROUND_OFF * speed or (size > 0.5 * last and size <= allowed):
            return step, multipliers
        if not size <= 10 * last:  # nor if it is NaN
            break
        multipliers, last = multipliers - inverse @ gap, size
    raise SolveError(
        f"the constraints cannot be met in the step at t = {body.time:g} s with dt = {h:g} s: "
        "they contradict each other, or the step is too long"
    )
