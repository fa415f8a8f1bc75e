"""March: bodies in time, step by step."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from math import ceil

import numpy as np

from kratos_lite.bodies.batched import together
from kratos_lite.bodies.body import Body
from kratos_lite.bodies.constraint_projection import project_velocity
from kratos_lite.bodies.deformable import Deformable
from kratos_lite.bodies.finite_element import FiniteElementBody
from kratos_lite.bodies.pseudo_rigid import PseudoRigidBody
from kratos_lite.bodies.rigid import RigidBody
from kratos_lite.bodies.schemes import take_step
from kratos_lite.bodies.state import State
from kratos_lite.errors import InputError, SolveError
from kratos_lite.solvers.blas import one_thread
from kratos_lite.typing import Progress
from kratos_lite.validation import positive_step, whole_number

_log = logging.getLogger("kratos_lite")
STIFF = 15.0
"""h ω up to which ``DEF_LIM`` has never been seen to blow up."""
SAFETY = 0.95
"""Share of the critical step that automatic sub-steps take."""
CHECKED = 100
"""Steps of ``DEF_EXP`` after which its critical step is found anew, as the tangent may have stiffened."""


def march(
    body: Body | Sequence[Body],
    dt: float,
    steps: int,
    *,
    every: int = 1,
    substeps: int | str = 1,
    until: Callable[[State], bool] | None = None,
    progress: Progress | None = None,
) -> Iterator[State]:
    """Advance a body, or many independent ones of one kind, and yield its states.

    The body itself moves along: after the loop, or after leaving it early, it is where the last state says.

    Parameters
    ----------
    body : one body; one object that holds many; or a sequence of rigid or pseudo-rigid bodies, which are
        advanced together on arrays.
    dt : step in s, > 0.
    steps : number of steps.
    every : a state is yielded after so many steps, and after the last.
    substeps : steps into which each is divided, or ``"auto"``: as many as ``DEF_EXP`` needs to be stable;
        each state tells how many.
    until : function of a state; the march ends when it is true.
    progress : called with ``"march"`` and the share done, 0 … 1, whenever a state is yielded.

    Yields
    ------
    State
        Copies of configuration and velocity, time and step.

    Raises
    ------
    InputError
        A number is wrong, or the step is beyond the stability of ``DEF_EXP``.
    SolveError
        A step has no solution, or the motion is no longer finite.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> stone = kl.RigidBody(kl.box((0.1, 0.1, 0.1)), kl.Isotropic3D(E=1e9, nu=0.3, density=2000.0))
    >>> stone.add(kl.Gravity((0, 0, -10.0)))
    >>> states = list(march(stone, dt=0.1, steps=10, every=5))
    >>> [round(float(state.q[11]), 9) for state in states]
    [-1.2, -4.95]
    """
    h, count, every = positive_step(dt), whole_number(steps, "steps"), whole_number(every, "every")
    one = _alone(body) if isinstance(body, Body) else together(body)
    return _states(one, h, count, every, _divided(one, h, substeps), until, progress)


def _states(
    body: Body,
    h: float,
    count: int,
    every: int,
    parts: int,
    until: Callable[[State], bool] | None,
    progress: Progress | None,
) -> Iterator[State]:
    if body.constraints and (
        body.integrated_velocity is None or not np.array_equal(body.u, body.integrated_velocity)
    ):
        project_velocity(body, h / parts)
    done = 0
    while done < count:
        chunk = min(every - done % every, count - done)
        _advance(body, h, chunk, parts)
        body.integrated_velocity = body.u.copy() if body.constraints else None
        done += chunk
        if progress:
            progress("march", done / count)
        state = State.of(body, parts)
        yield state
        if until and until(state):
            return


def _alone(body: Body) -> Body:
    """Return a body with a clock of its own, though it may have advanced together with others before."""
    body.clock = replace(body.clock)
    return body


def _divided(body: Body, h: float, substeps: int | str) -> int:
    """Return the number of parts of each step; InputError if an explicit one is too long."""
    parts = 1 if substeps == "auto" else whole_number(substeps, "substeps", ", or 'auto'")
    if not isinstance(body, Deformable):
        return parts
    if body.scheme == "DEF_EXP":
        critical = body.critical_step()
        if substeps == "auto":
            parts = max(1, ceil(h / (SAFETY * critical)))
            _log.info("DEF_EXP: each step of %g s in %d parts; the critical step is %g s", h, parts, critical)
        _check_stable(h / parts, critical)
    elif body.scheme == "DEF_LIM" and h / parts * body.highest_frequency() > STIFF:
        _log.warning(
            "DEF_LIM with h ω = %.3g: above %g a stiff body that spins may gain energy without bound; "
            "use ENERGY_MOMENTUM, a shorter step or damping",
            h / parts * body.highest_frequency(),
            STIFF,
        )
    return parts


def _check_stable(h: float, critical: float) -> None:
    if h > critical * (1 + 1e-9):
        raise InputError(
            f"DEF_EXP is not stable with steps of {h:g} s: the critical step is {critical:.4g} s; "
            "take a shorter step, substeps='auto', or an implicit scheme"
        )


def _advance(body: Body, h: float, count: int, parts: int) -> None:
    """Take `count` steps of h s, each in so many parts."""
    compiled = _advance_compiled(body, h / parts, count * parts)
    with one_thread() if isinstance(body, FiniteElementBody) else nullcontext():
        for _ in range(count):
            if not compiled:
                _step(body, h / parts, parts)
            body.clock.time += h  # one after the other, so that a restart comes to the same times
            body.clock.step += 1
    if body.scheme == "DEF_EXP" and isinstance(body, Deformable):
        _check_still_stable(body, h / parts, count)
    if not compiled and not np.isfinite(body.u).all():
        raise SolveError(
            f"the motion is no longer finite at t = {body.time:g} s: {body.scheme} with dt = {h / parts:g} s "
            "has blown up; take a shorter step or ENERGY_MOMENTUM"
        )


def _step(body: Body, h: float, parts: int) -> None:
    """Take one step in so many parts of h s."""
    start = body.time
    for part in range(parts):
        body.clock.time = start + part * h
        before = body.u
        load = take_step(body, h)
        body.external_work += h / 2 * ((before + body.u) * load).sum(axis=-1)
        if isinstance(body, FiniteElementBody):
            body.q, body.u = body.formulation.project(body.q, body.u)
    body.clock.time = start


def _check_still_stable(body: Deformable, h: float, count: int) -> None:
    """Raise InputError if the body has stiffened so much that steps of h s are no longer stable."""
    if body.step // CHECKED > (body.step - count) // CHECKED:
        _check_stable(h, body.critical_step())


def _advance_compiled(body: Body, h: float, count: int) -> bool:
    """Take steps with nothing but constant loads at once, without Python; return whether that is possible."""
    if body.constraints or not all(load.is_constant for load in body.loads):
        return False
    if not isinstance(body, (RigidBody, PseudoRigidBody)):
        return False
    body.step_free(h, count)
    return True
