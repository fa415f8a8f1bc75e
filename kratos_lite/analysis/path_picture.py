"""Bodies along their paths: which positions tell most, and energies against time."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np

from kratos_lite.analysis.state import State, at, check_state_of_body
from kratos_lite.analysis.subjects import evenly
from kratos_lite.bodies import Body, RigidLink
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh.selection import spread
from kratos_lite.typing import Array
from kratos_lite.validation import short, whole_number
from kratos_lite.view.marks import Marks
from kratos_lite.view.scene import Subject
from kratos_lite.view.trajectory import Path, trajectory_figure

SHOWN = 6  # positions in a picture
CANDIDATES = 400  # states, evenly spread, among which they are chosen
ALIKE = 0.02  # fraction of its size that a body moves between positions that are worth drawing
ENERGIES = ("kinetic", "internal", "potential", "sum")


def path_figure(body: Body, given: dict[str, Any]) -> Any:
    """Return the figure of a body along its path, with its energies if there is more than one state."""
    states = states_of(body, given["states"])
    shown = whole_number(SHOWN if given["shown"] is None else given["shown"], "shown")
    rows = np.array([_row(body, state) for state in states])
    assert body.mesh is not None
    X, kept = body.mesh.points, [state.q for state in states]
    chosen = telling(body, kept, shown)
    path = Path(
        body.mesh,
        [body.position(X, kept[i]) for i in chosen],
        [marks_of(body, kept[i]) for i in chosen],
        rows[:, 5:],
        rows[:, 0],
        {name: rows[:, i] for i, name in enumerate(ENERGIES, 1) if rows[:, i].any()},
    )
    return trajectory_figure(path, given["view"], given["title"] or "", given["size"] or (8, 8))


def states_of(body: Body, states: Any) -> list[State]:
    """Return the states of a single body with a mesh in a list, that of now if none are given."""
    if body.q.ndim > 1:
        raise ModelError("only a single body can be drawn, not a batch of bodies")
    if body.mesh is None:
        raise ModelError("this body has no mesh to be drawn")
    if states is None or isinstance(states, State):
        return [State.of(body) if states is None else states]
    if not isinstance(states, Iterable):
        raise InputError(f"states in the order of time are needed; got {short(states)}")
    found = list(states)
    if not found:
        raise InputError("there is no state to draw")
    return found


def _row(body: Body, state: State) -> Array:
    """Return time, energies and mass center (8,)."""
    with at(body, state):
        energies = body.kinetic_energy(), body.internal_energy(), body.potential_energy()
        return np.array([state.time, *energies, sum(energies), *body.mass_center()], dtype=float)


def moving_subjects(body: Body, states: Any, most: int, title: str | None) -> list[Subject]:
    """Return a body in its states, at most so many, with their times as titles."""
    found = states_of(body, states)
    if len(found) < 2:
        raise InputError("nothing moves here: give more than one state of the body")
    assert body.mesh is not None
    X, subjects = body.mesh.points, []
    for state in (found[row] for row in evenly(len(found), most)):
        u = body.position(X, check_state_of_body(state, body).q) - X
        head = f"{title or ''}\nt = {state.time:.3f} s".strip()
        subjects.append(Subject(body.mesh, u, None, head, marks_of(body, state.q), moving=True))
    return subjects


def marks_of(body: Body, q: Array) -> Marks:
    """Return what holds a body in a configuration."""
    rods, pivots = [], [np.zeros((0, 3))]
    for constraint in body.constraints:
        points = body.position(constraint.points, q)
        if isinstance(constraint, RigidLink):
            rods += [(point, constraint.anchor) for point in points]
        else:
            pivots.append(points)
    springs = [(body.position(load.ends[0], q), load.ends[1]) for load in body.loads if load.ends is not None]
    shape = (-1, 2, 3)
    return Marks(np.reshape(rods, shape), np.reshape(springs, shape), np.concatenate(pivots))


def telling(body: Body, kept: list[Array], shown: int) -> list[int]:
    """Return the states to draw: first and last, then again and again the one farthest from those chosen."""
    assert body.mesh is not None
    X = body.mesh.points
    corners = np.unique([np.argmax(X @ side) for side in product((-1, 1), repeat=3)])
    rows = np.unique(np.linspace(0, len(kept) - 1, CANDIDATES).round().astype(int))
    places = np.array([body.position(X, kept[row])[corners].ravel() for row in rows])
    alike = ALIKE * np.ptp(X, axis=0).max() * len(corners) ** 0.5
    chosen = spread(places, max(shown, 1), [len(rows) - 1, 0], alike)
    return sorted({int(rows[i]) for i in chosen})
