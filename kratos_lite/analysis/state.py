"""State: a body or a model at one time, with all that it needs to go on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from kratos_lite.bodies.body import Body
from kratos_lite.errors import InputError
from kratos_lite.typing import Array

BODY_FIELDS = ("q", "u", "external_work")
MODEL_FIELDS = ("u", "v", "a", "reactions", "imbalance")


class InTime(Protocol):
    """A model in time, which makes and takes states."""

    def state(self) -> State:
        """Return the state of now."""

    def restore(self, state: State) -> None:
        """Go on from a state."""


@dataclass(frozen=True, eq=False)
class State:
    """A body or a model at one time; one that is restored goes on bit by bit as if it had never stopped.

    Attributes
    ----------
    kind : kind of the body, or ``"model"``.
    integrator : name of the integrator that came here.
    time, step : s, and number of steps taken.
    values : arrays by name, copies; each is an attribute too.
    substeps : parts into which steps were divided to come here.
    q, u, external_work : of bodies: configuration, velocity, and work of loads and reactions in J.
    u, v, a, reactions : of models, (n, 3): displacement in m, velocity, acceleration, and forces of supports
        and constraints on the model in N, 0 where nothing acts.
    imbalance : of models, N: largest free component of M a + C v + K u - f, which tells other loads.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    >>> start = kl.State.of(body)
    >>> *_, end = kl.integrate(body, dt=0.1, steps=5)
    >>> start.restore(body)
    >>> end.time, body.time
    (0.5, 0.0)
    """

    kind: str
    integrator: str
    time: float
    step: int
    values: Mapping[str, Array]
    substeps: int = 1

    @classmethod
    def of(cls, subject: Body | InTime) -> State:
        """Return the present state of a body or of a model in time.

        Parameters
        ----------
        subject : a body, or a `TransientAnalysis`.

        Returns
        -------
        State
        """
        return subject.state() if not isinstance(subject, Body) else state_of_body(subject)

    def restore(self, subject: Body | InTime) -> None:
        """Let a body or a model go on from this state.

        Parameters
        ----------
        subject : a body of the same kind and size, or a `TransientAnalysis` of the same mesh.

        Raises
        ------
        InputError
            It is of another kind or size, or, of a model, not where the supports hold it at that time.
        """
        if not isinstance(subject, Body):
            subject.restore(self)
            return
        mine, its = ([np.shape(_value(one, name)) for name in BODY_FIELDS] for one in (self, subject))
        if subject.kind != self.kind or mine != its:
            shapes = "q {}, u {} and work {}".format
            whose = "model" if self.kind == "model" else f"{self.kind} body with {shapes(*mine)}"
            text = f"it does not fit a {subject.kind} body with {shapes(*its)}"
            raise InputError(f"this is the state of a {whose}; {text}")
        q, u = self.values["q"], self.values["u"]
        subject.q[...], subject.u[...] = q, u  # bodies that advance together share these arrays
        subject.time, subject.step = self.time, self.step
        subject.integrated_velocity = u.copy() if self.step else None
        subject.external_work[...] = self.values["external_work"]

    def __getattr__(self, name: str) -> Array:
        values = self.__dict__.get("values", {})
        if name not in values:
            raise AttributeError(f"the state of a {self.__dict__.get('kind')} has no {name!r}")
        found: Array = values[name]
        return found


def _value(owner: State | Body, name: str) -> Array:
    """Return an array of a state, empty where it has none, or of a body."""
    return owner.values.get(name, np.zeros(0)) if isinstance(owner, State) else getattr(owner, name)


def state_of_body(body: Body, substeps: int = 1) -> State:
    """Return the state of a body after steps in so many parts."""
    values = {name: np.array(getattr(body, name)) for name in BODY_FIELDS}
    return State(body.kind, body.integrator, body.time, body.step, values, substeps)


@contextmanager
def at(body: Body, state: State) -> Iterator[None]:
    """Let a body be in a state for a while."""
    if state.time == body.time and np.array_equal(state.q, body.q) and np.array_equal(state.u, body.u):
        yield
        return
    kept, clock = State.of(body), body.clock
    state.restore(body)
    try:
        yield
    finally:
        kept.restore(body)
        body.clock = clock
