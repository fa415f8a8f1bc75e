"""State: all that a body needs to go on as if it had never stopped."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kratos_lite.bodies.body import Body
from kratos_lite.errors import InputError
from kratos_lite.io.atomic import read_arrays, write_arrays
from kratos_lite.typing import Array

FIELDS = ("kind", "q", "u", "time", "step", "external_work")


@dataclass(frozen=True, eq=False)
class State:
    """A body at one time.

    Attributes
    ----------
    kind : kind of the body.
    q, u : configuration and velocity, copies.
    time : s.
    step : number of steps taken.
    external_work : J.
    substeps : parts into which steps were divided to come here.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    >>> path = getfixture("tmp_path") / "rest.npz"
    >>> State.of(body).save(path)
    >>> State.load(path).put_into(body)
    """

    kind: str
    q: Array
    u: Array
    time: float
    step: int
    external_work: Array
    substeps: int = 1

    @classmethod
    def of(cls, body: Body, substeps: int = 1) -> State:
        """Return the state of a body."""
        work = np.array(body.external_work)
        return cls(body.kind, body.q.copy(), body.u.copy(), body.time, body.step, work, substeps)

    def put_into(self, body: Body) -> None:
        """Let a body go on from this state; InputError if it is of another kind or size."""
        if body.kind != self.kind or body.q.shape != self.q.shape or body.u.shape != self.u.shape:
            raise InputError(
                f"this is the state of a {self.kind} body with q {self.q.shape}; "
                f"it does not fit a {body.kind} one with q {body.q.shape}"
            )
        body.q[...], body.u[...] = self.q, self.u  # bodies that advance together share these arrays
        body.time, body.step = self.time, self.step
        body.integrated_velocity = self.u.copy() if self.step else None
        body.external_work[...] = self.external_work

    def save(self, path: str | Path) -> None:
        """Write the state to an .npz file, as a whole or not at all."""
        write_arrays(path, {name: np.asarray(getattr(self, name)) for name in FIELDS})

    @classmethod
    def load(cls, path: str | Path) -> State:
        """Read a state; InputError if the file is none."""
        values = read_arrays(path, FIELDS, "a state that State.save wrote")
        try:
            kind, step, time = str(values["kind"]), int(values["step"]), float(values["time"])
        except (ValueError, TypeError):
            raise InputError(f"{path}: not a state that State.save wrote") from None
        return cls(kind, values["q"], values["u"], time, step, values["external_work"])


@contextmanager
def at(body: Body, state: State) -> Iterator[None]:
    """Let a body be in a state for a while."""
    if state.time == body.time and np.array_equal(state.q, body.q) and np.array_equal(state.u, body.u):
        yield
        return
    kept, clock = State.of(body), body.clock
    state.put_into(body)
    try:
        yield
    finally:
        kept.put_into(body)
        body.clock = clock
