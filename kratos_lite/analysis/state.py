"""State: a body or a model at one time, with all that it needs to go on."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from kratos_lite.analysis.fields import Fields
from kratos_lite.bodies.body import Body
from kratos_lite.errors import InputError, ModelError
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array
from kratos_lite.validation import finite, number, short, whole_number

BODY_FIELDS = ("q", "u", "external_work")
MODEL_FIELDS = ("u", "v", "a", "reactions", "imbalance")
STEP_FIELDS = ("u", "reactions", "load", "internal", "work")


class Stepper(ABC):
    """What `kratos_lite.integrate` advances: a body, a list of bodies, or a model in time."""

    parts = 1  # substeps into which each step is divided

    def critical_step(self) -> float:
        """Return the longest stable step in s; infinite for implicit integrators."""
        return np.inf

    @abstractmethod
    def prepare(self, h: float, parts: int) -> None:
        """Make ready for steps of h s in so many parts; `kratos_lite.integrate` does."""

    @abstractmethod
    def advance(self, h: float, count: int) -> None:
        """Take steps of h s; `kratos_lite.integrate` does."""

    def diverged(self) -> bool:
        """Return whether the motion has grown without bound."""
        return False

    @abstractmethod
    def state(self) -> Any:
        """Return the state of now."""


class ModelInTime(Stepper):
    """A model with a time, whose states can be saved and restored."""

    model: Structure
    time: float
    step: int

    def __init__(self, model: Structure) -> None:
        self.model, self.time, self.step = model, 0.0, 0
        self._version = self._versions()

    def _versions(self) -> list[Any]:
        """Return what must stay as it is; equal as long as it does."""
        model = self.model
        return [model.version, model.supports.value_version, model.motion, *model.loads]

    def check_unchanged(self) -> None:
        """Raise ModelError if the model has changed."""
        if self._version != self._versions():
            raise ModelError(
                "the model has changed since this analysis was made; make a new one and restore the state"
            )

    @abstractmethod
    def check_state(self, state: State) -> State:
        """Return a state that is one of this model; InputError for any other."""

    @abstractmethod
    def restore(self, state: State) -> None:
        """Go on from a state of a model of the same mesh, loaded or held otherwise perhaps."""

    @abstractmethod
    def result(self, state: State | None = None) -> Fields:
        """Return a state of this model, or that of now, as a result with strains and stresses."""


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
    def of(cls, subject: Body | ModelInTime) -> State:
        """Return the present state of a body or of a model in time.

        Parameters
        ----------
        subject : a body, or a `TransientAnalysis`.

        Returns
        -------
        State

        Raises
        ------
        InputError
            It is neither.
        """
        _check_subject(subject)
        return subject.state() if not isinstance(subject, Body) else state_of_body(subject)

    def restore(self, subject: Body | ModelInTime) -> None:
        """Let a body or a model go on from this state.

        Parameters
        ----------
        subject : a body of the same kind and size, or a `TransientAnalysis` of the same mesh.

        Raises
        ------
        InputError
            The state is of another kind or size, not finite, or, of a model, not where the supports are then.
        """
        _check_subject(subject)
        if not isinstance(subject, Body):
            subject.restore(self)
            return
        check_state_of_body(self, subject)
        q, u = self.values["q"], self.values["u"]
        subject.q[...], subject.u[...] = q, u  # bodies of a batch share these arrays
        subject.time, subject.step = self.time, self.step
        subject.integrated_velocity = u.copy() if self.step else None
        subject.external_work[...] = self.values["external_work"]

    def __getattr__(self, name: str) -> Array:
        values = self.__dict__.get("values", {})
        if name not in values:
            raise AttributeError(f"the state of a {self.__dict__.get('kind')} has no {name!r}")
        value: Array = values[name]
        return value


def _check_subject(subject: object) -> None:
    """Raise InputError for what has no states."""
    if not isinstance(subject, (Body, ModelInTime)):
        raise InputError(
            f"a body, or a model in time, model.transient(), has states; got {type(subject).__name__}"
        )


def check_state(state: object, kind: str, shapes: Mapping[str, tuple[int, ...]]) -> State:
    """Return a state of a kind of body, or of models, whose arrays have these shapes and are finite."""
    whose = "a model" if kind == "model" else f"a {kind} body"
    if not isinstance(state, State):
        raise InputError(f"a State of {whose} is needed, such as kl.read_state gives; got {short(state)}")
    if state.kind != kind:
        other = "a model" if state.kind == "model" else f"a {state.kind} body"
        raise InputError(f"this is the state of {other}; one of {whose} is needed")
    for name, shape in shapes.items():
        actual = np.shape(state.values[name]) if name in state.values else "none"
        if actual != shape:
            raise InputError(
                f"this state does not fit: {name} of {whose} has shape {shape} here; got {actual}"
            )
    number(state.time, "the time of a state", least=0, unit="s")
    whole_number(state.step, "the steps of a state", least=0)
    for name in shapes:
        finite(state.values[name], f"{name} of a state")
    return state


def check_state_of_body(state: object, body: Body) -> State:
    """Return a state that is one of a body; InputError otherwise."""
    return check_state(state, body.kind, {name: np.shape(getattr(body, name)) for name in BODY_FIELDS})


def state_of_body(body: Body, substeps: int = 1) -> State:
    """Return the state of a body after steps in so many parts."""
    values = {name: np.array(getattr(body, name)) for name in BODY_FIELDS}
    return State(body.kind, body.integrator, body.time, body.step, values, substeps)


@contextmanager
def at(body: Body, state: State) -> Iterator[None]:
    """Let a body be in a state for a while; InputError unless it is one of this body."""
    check_state_of_body(state, body)
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
