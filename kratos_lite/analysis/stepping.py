"""Stepping: the one loop through time, of bodies and of models."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import ceil, inf
from typing import Any, overload

import numpy as np

from kratos_lite.analysis.integrators import body_integrator
from kratos_lite.analysis.state import ModelInTime, State, Stepper, state_of_body
from kratos_lite.bodies.batched import batch, forms_batch, groups_of
from kratos_lite.bodies.body import Body
from kratos_lite.bodies.constraint_projection import project_velocity
from kratos_lite.errors import InputError, KratosLiteError, SolveError
from kratos_lite.typing import Array, Progress
from kratos_lite.validation import function_or_none, positive_step, short, takes, whole_number
from kratos_lite.view.progress import watched

_log = logging.getLogger("kratos_lite")
SAFETY = 0.95  # fraction of the critical step that automatic substeps take
MOST_SUBSTEPS = 1_000_000  # parts of one step; more would take the time of a whole run until the first state


@overload
def integrate(
    subject: Body | ModelInTime,
    dt: float,
    steps: int | None = ...,
    *,
    every: int = ...,
    substeps: int | str = ...,
    until: Callable[[State], bool] | None = ...,
    progress: Progress | None = ...,
) -> Iterator[State]: ...
@overload
def integrate(
    subject: Sequence[Body],
    dt: float,
    steps: int | None = ...,
    *,
    every: int = ...,
    substeps: int | str = ...,
    until: Callable[[Any], bool] | None = ...,
    progress: Progress | None = ...,
) -> Iterator[Any]: ...
def integrate(
    subject: Any,
    dt: float,
    steps: int | None = None,
    *,
    every: int = 1,
    substeps: int | str = 1,
    until: Callable[[Any], bool] | None = None,
    progress: Progress | None = None,
) -> Iterator[Any]:
    """Advance bodies or a model in time, and yield their states.

    The subject itself is advanced: after the loop, or after leaving it early, also by Ctrl-C, it is in the
    state after its last step (bodies of a list in the states yielded last, unless they are one batch); a
    second call continues from there, possibly with another step.

    Parameters
    ----------
    subject : one body; one object that holds a batch of bodies; a list of bodies of any kinds, those that
        are alike advanced together on arrays; or a model in time, `Model.transient()` or
        `Model.quasi_static()`.
    dt : step in s, > 0.
    steps : number of steps; if not given, until the loop is left or `until` returns true.
    every : output interval in steps; the state after the last step is always yielded.
    substeps : parts into which each step is divided, or ``"auto"``: as many as an explicit integrator needs
        to be stable; each state tells how many.
    until : function of a state; the loop ends after the first yielded state for which it returns true.
    progress : called with ``"integrate"`` and the fraction of `steps` done, 0 … 1, before a state is yielded.

    Yields
    ------
    State
        Copies of the state of the subject.  Of a list whose bodies are one batch, it has a row for each; of
        another list, a list of the states of its bodies is yielded, in their order.

    Raises
    ------
    InputError
        An argument is wrong, a step is longer than the critical one of an explicit integrator, or a
        constraint is not met at the start.
    ModelError
        The model has changed since the transient analysis was created.
    SolveError
        A step has no solution, or the motion grows without bound.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> stone = kl.RigidBody(kl.box((0.1, 0.1, 0.1)), kl.Isotropic3D(E=1e9, nu=0.3, density=2000.0))
    >>> stone.add(kl.Gravity((0, 0, -10.0)))
    >>> states = list(integrate(stone, dt=0.1, steps=10, every=5))
    >>> [round(float(state.q[11]), 9) for state in states]
    [-1.2, -4.95]
    """
    h, every = positive_step(dt), whole_number(every, "every")
    count = None if steps is None else whole_number(steps, "steps")
    if until is not None and not takes(until, 1):
        raise InputError(f"until must be a function of a state; got {short(until)}")
    function_or_none(progress, "progress must be a function of a phase and a fraction")
    stepper = _stepper(subject)
    parts = 1 if substeps == "auto" else whole_number(substeps, "substeps", ", or 'auto'")
    if substeps == "auto":
        critical = stepper.critical_step()
        parts = max(1, ceil(min(h / (SAFETY * critical) if critical > 0 else inf, 10.0 * MOST_SUBSTEPS)))
        _log.info("each step of %g s in %d parts; the critical step is %g s", h, parts, critical)
    if parts > MOST_SUBSTEPS:
        stable = f"; the critical step is {stepper.critical_step():.3g} s" if substeps == "auto" else ""
        raise InputError(
            f"a step of {h:g} s has more than {MOST_SUBSTEPS} substeps{stable}; take shorter steps"
        )
    stepper.prepare(h, parts)
    return _states(stepper, h, count, every, until, progress)


def _stepper(subject: Any) -> Stepper:
    if isinstance(subject, ModelInTime):
        return subject
    if isinstance(subject, Body):
        return BodyStepper(subject)
    groups = groups_of(subject)
    if len(groups) == 1 and forms_batch(subject[0]):
        return BodyStepper(subject)
    return ListStepper(subject, groups)


def _states(
    stepper: Stepper,
    h: float,
    count: int | None,
    every: int,
    until: Callable[[Any], bool] | None,
    progress: Progress | None,
) -> Iterator[Any]:
    done = 0
    with watched(progress, "integrate") as shown:
        while count is None or done < count:
            chunk = every if count is None else min(every, count - done)
            stepper.advance(h, chunk)
            done += chunk
            if stepper.diverged():
                raise _divergence(stepper, h)
            if shown and count:
                shown("integrate", done / count)
            state = stepper.state()
            yield state
            answer = until is not None and until(state)
            if np.size(answer) != 1:
                raise InputError(
                    f"until must return True or False; got {short(answer)}; use .any() or .all()"
                )
            if answer:
                return


def _divergence(stepper: Stepper, h: float) -> SolveError:
    with np.errstate(over="ignore", invalid="ignore"):
        state = stepper.state()
    return SolveError(
        f"the motion grows without bound: at t = {state.time:g} s it is no longer finite, or far beyond the "
        f"size of the model; is {state.integrator} stable with steps of {h / state.substeps:g} s "
        "(take shorter ones), and are all units SI?"
    )


CHECKED = 100  # steps after which the critical step is found anew, as the tangent may have stiffened


class BodyStepper(Stepper):
    """A body, or a batch of them as one, with a clock of its own."""

    def __init__(self, body: Body | Sequence[Body]) -> None:
        if isinstance(body, Body):
            body.clock = replace(body.clock)  # it may have been in a batch before
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
        """Advance by h s; return the load on the body, reactions included, at the middle."""
        # Loads that depend on the velocity see the old one first; then the step is taken again with the mean
        # of old and new, so that they too are of second order.
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


class ListStepper(Stepper):
    """Bodies of any kinds, each batch among them as one; if one fails, all stay in the states before."""

    def __init__(self, bodies: Sequence[Body], groups: list[list[Body]]) -> None:
        self.bodies, self.parts = bodies, 1
        self.steppers = {
            ", ".join(str(bodies.index(body)) for body in group): BodyStepper(
                group if group[1:] else group[0]
            )
            for group in groups
        }

    def critical_step(self) -> float:
        """Return the longest step in s that is stable for all."""
        return min(stepper.critical_step() for stepper in self.steppers.values())

    def prepare(self, h: float, parts: int) -> None:
        """Check steps of h s in so many parts."""
        self.parts = parts
        self._each(lambda stepper: stepper.prepare(h, parts))

    def advance(self, h: float, count: int) -> None:
        """Take steps of h s."""

        def advance(stepper: BodyStepper) -> None:
            stepper.advance(h, count)
            if stepper.diverged():
                raise _divergence(stepper, h)

        before = self.state()
        try:
            self._each(advance)
        except BaseException:  # Ctrl-C, too
            for body, state in zip(self.bodies, before, strict=True):
                state.restore(body)
            raise

    def _each(self, act: Callable[[BodyStepper], None]) -> None:
        """Do something with each stepper; an error gets the rows of its bodies."""
        for rows, stepper in self.steppers.items():
            try:
                act(stepper)
            except KratosLiteError as error:
                raise type(error)(f"body {rows} of the list: {error}") from error

    def state(self) -> list[State]:
        """Return the states of now."""
        return [state_of_body(body, self.parts) for body in self.bodies]
