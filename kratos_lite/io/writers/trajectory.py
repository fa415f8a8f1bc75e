"""Trajectories: pictures of a body along its path, and of its energies against time."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from pathlib import Path

import numpy as np

from kratos_lite import view
from kratos_lite.analysis.state import State
from kratos_lite.bodies import Body
from kratos_lite.errors import InputError, ModelError
from kratos_lite.io.writers.pictures import save_figure
from kratos_lite.io.writers.recorded import RecordedBody, check_single
from kratos_lite.typing import Array
from kratos_lite.validation import short

SHOWN = 6
"""Positions in a picture."""
CANDIDATES = 400
"""States, evenly spread, among which they are chosen."""
ALIKE = 0.02
"""Share of its size that a body moves between positions that are worth drawing."""


def draw_trajectory(
    path: str | Path,
    body: Body,
    states: Iterable[State],
    *,
    shown: int = SHOWN,
    title: str = "",
    size: tuple[float, float] = (8, 8),
) -> None:
    """Draw a body along its path, and its energies against time beneath if there is more than one state.

    Parameters
    ----------
    path : picture to write; .png, .pdf or .svg.
    body : a single body with a mesh.
    states : in the order of time.
    shown : how many positions are drawn at most: the first, the last, and those that differ most from each
        other, such as turning points; the later the stronger.
    title : above the picture.
    size : largest width and height in inches, at 150 dots per inch.

    Raises
    ------
    InputError
        There are no states, one is not of this body, or the file cannot be written.
    ModelError
        The body has no mesh, or is a batch of bodies.
    KratosLiteError
        matplotlib is missing.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = kl.PseudoRigidBody(kl.box(), kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0))
    >>> body.set_velocity(linear=(1, 0, 0), angular=(0, 0, 1))
    >>> draw_trajectory(getfixture("tmp_path") / "spin.png", body, kl.integrate(body, 0.01, 100, every=10))
    """
    if not isinstance(body, Body):
        raise InputError(f"{path}: a path is that of a body, such as kl.RigidBody; got {type(body).__name__}")
    if not isinstance(states, Iterable):
        raise InputError(f"{path}: states in the order of time are needed; got {short(states)}")
    check_single(body, path)
    if body.mesh is None:
        raise ModelError(f"{path}: this body has no mesh to be drawn")
    subject, rows, kept = RecordedBody(body, path), [], []
    for state in states:
        rows.append(subject.row(state))
        kept.append(state.q)
    if not kept:
        raise InputError(f"{path}: there is no state to draw")
    table = np.array(rows)
    positions = [body.position(body.mesh.points, kept[i]) for i in _telling(body, kept, shown)]
    names = ("kinetic", "internal", "potential", "sum")
    curves = {name: table[:, 1 + i] for i, name in enumerate(names) if table[:, 1 + i].any()}
    figure = view.trajectory_figure(
        body.mesh,
        positions,
        table[:, 6:9],
        table[:, 0],
        curves,
        title=title,
        unit="energy in J",
        size=size,
    )
    save_figure(path, figure)


def _telling(body: Body, kept: list[Array], shown: int) -> list[int]:
    """Return the states to draw: first and last, then again and again the one farthest from those chosen."""
    assert body.mesh is not None
    X = body.mesh.points
    corners = np.unique([np.argmax(X @ side) for side in product((-1, 1), repeat=3)])
    rows = np.unique(np.linspace(0, len(kept) - 1, CANDIDATES).round().astype(int))
    places = np.array([body.position(X, kept[row])[corners] for row in rows])

    def away(i: int) -> Array:
        return np.asarray(((places - places[i]) ** 2).sum(axis=(1, 2)))

    chosen = [len(rows) - 1, 0][: max(shown, 1)]
    distance = np.min([away(i) for i in chosen], axis=0)
    alike = (ALIKE * np.ptp(X, axis=0).max()) ** 2 * len(corners)
    while len(chosen) < shown and distance.max() > alike:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, away(chosen[-1]))
    return sorted({int(rows[i]) for i in chosen})
