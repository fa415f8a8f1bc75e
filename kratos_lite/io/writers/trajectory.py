"""Trajectories: the states of a body or a model in time as files for ParaView, as tables and as pictures."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from kratos_lite.bodies import Body, State
from kratos_lite.bodies.state import at
from kratos_lite.errors import InputError, ModelError
from kratos_lite.io.writers.moments import MOMENT_WRITERS, Arrays, Frames, Table, Writer
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from kratos_lite.analysis import Moment, Transient

COLUMNS = (
    "time [s]",
    "kinetic energy [J]",
    "internal energy [J]",
    "potential energy [J]",
    "energy [J]",
    "external work [J]",
    *(f"mass center {axis} [m]" for axis in "xyz"),
    *(f"linear momentum {axis} [kg m/s]" for axis in "xyz"),
    *(f"angular momentum {axis} [kg m2/s]" for axis in "xyz"),
)
"""Columns of a table: energy is the sum of the three before it, angular momentum about the mass center."""
SHOWN = 6
"""Positions in a picture."""
CANDIDATES = 400
"""States, evenly spread, among which they are chosen."""
ALIKE = 0.02
"""Share of its size that a body moves between positions that are worth drawing."""


def row_of(body: Body, state: State) -> Array:
    """Return the row of a state in a table, by `COLUMNS`."""
    with at(body, state):
        energies = [
            float(e) for e in (body.kinetic_energy(), body.internal_energy(), body.potential_energy())
        ]
        vectors = (body.mass_center(), body.linear_momentum(), body.angular_momentum())
        work = float(state.external_work)
        return np.concatenate([[state.time, *energies, sum(energies), work], *vectors])


class _BodyFrames(Frames):
    """DISPLACEMENT and VELOCITY on the nodes of a body."""

    owner: Body

    def __init__(self, path: Path, owner: Body, mode: str) -> None:
        super().__init__(path, owner, mode)
        _check_single(owner, path)
        if owner.mesh is None:
            raise ModelError(f"{path}: this body has no mesh to be shown; write .csv or .npz")

    def add(self, state: State) -> None:
        mesh, body = self.owner.mesh, self.owner
        assert mesh is not None
        with at(body, state):
            moved = body.position(mesh.points) - mesh.points
            self.frame(state.time, mesh, {"DISPLACEMENT": moved, "VELOCITY": body.velocity(mesh.points)})


class _BodyTable(Table):
    """Energies, momenta and the mass center."""

    owner: Body
    columns = COLUMNS

    def __init__(self, path: Path, owner: Body, mode: str) -> None:
        super().__init__(path, owner, mode)
        _check_single(owner, path)

    def add(self, state: State) -> None:
        self.rows.append(row_of(self.owner, state))


class _BodyArrays(Arrays):
    """Configurations and velocities."""

    owner: Body
    names = ("time", "step", "q", "u", "external_work")

    def extra(self) -> dict[str, Any]:
        return {"kind": np.array(self.owner.kind)}


def _check_single(body: Body, path: Path) -> None:
    if body.q.ndim > 1:
        raise ModelError(f"{path}: only a single body can be written so; for many bodies write .npz")


class Series:
    """The states of a march as files; what they are is said by the ending of the path.

    - ``.pvd``: for ParaView; an index, and beside it ``NAME_00000.vtu`` … with the undeformed mesh, and
      DISPLACEMENT (m) and VELOCITY (m/s) on its nodes; of a transient also ACCELERATION (m/s²), REACTION (N).
    - ``.csv``: a table with a line for each state: time, energies, mass center, momenta (`COLUMNS`); of a
      transient time, energy, largest displacement, total reaction (`MOMENT_COLUMNS`).
    - ``.npz``: arrays with a row for each state: ``time``, ``step``, and ``q``, ``u``, ``external_work`` of a
      body, or ``u``, ``v``, ``a``, ``reactions`` of a transient.

    The folder is made if it is missing.  Every file is written as a whole or not at all.  Index, table and
    arrays come at the end, also when the loop ends early or by an error: then they hold the states up to
    there.

    Parameters
    ----------
    path : the file to write.
    owner : the body whose states come, many at once only as ``.npz``; or the transient whose moments come.
    mode : of ``.vtu`` files: ``binary``, ``compressed`` or ``ascii``.

    Raises
    ------
    InputError
        The ending is none of these, or a file cannot be written.
    ModelError
        The body has no mesh, or is many bodies.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    >>> folder = getfixture("tmp_path")
    >>> with Series(folder / "spin.pvd", body) as series:
    ...     series.add()
    ...     for state in kl.march(body, dt=0.01, steps=20, every=10):
    ...         series.add(state)
    >>> sorted(path.name for path in folder.iterdir())
    ['spin.pvd', 'spin_00000.vtu', 'spin_00001.vtu', 'spin_00002.vtu']
    """

    kinds: ClassVar[dict[str, type[Writer]]] = {".pvd": _BodyFrames, ".csv": _BodyTable, ".npz": _BodyArrays}

    def __init__(self, path: str | Path, owner: Body | Transient, *, mode: str = "binary") -> None:
        check_ending(path)
        if not (isinstance(owner, Body) or hasattr(owner, "moment")):
            raise InputError(
                f"{path}: a series holds the states of one body, such as kl.RigidBody, or of a transient; "
                f"got {type(owner).__name__}; make one series for each body"
            )
        self.owner, self.count = owner, 0
        kinds = self.kinds if isinstance(owner, Body) else MOMENT_WRITERS
        self._writer = kinds[Path(path).suffix.lower()](Path(path), owner, mode)

    def add(self, state: State | Moment | None = None) -> None:
        """Take a state or moment, or body or transient as it is if none is given."""
        if not self.count:
            make_folder(self._writer.path)
        if state is None:
            state = State.of(self.owner) if isinstance(self.owner, Body) else self.owner.moment()
        self._writer.add(state)
        self.count += 1

    def close(self) -> None:
        """Write what is written at the end; nothing if there is no state."""
        if self.count:
            self._writer.write()

    def __enter__(self) -> Series:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def make_folder(path: Path) -> None:
    """Make the folder of a file if it is missing; InputError if that cannot be done."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: its folder cannot be made: {error.strerror}") from error


def check_ending(path: str | Path) -> None:
    """Raise InputError for a path whose ending is none of a series."""
    if Path(path).suffix.lower() not in Series.kinds:
        raise InputError(f"{path}: a series of states is written as {', '.join(Series.kinds)}")


def trajectory_picture(
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
        There are no states, or the file cannot be written.
    ModelError
        The body has no mesh, or is many bodies.
    KratosLiteError
        matplotlib is missing.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = kl.PseudoRigidBody(kl.box(), kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0))
    >>> body.set_velocity(linear=(1, 0, 0), angular=(0, 0, 1))
    >>> trajectory_picture(getfixture("tmp_path") / "spin.png", body, kl.march(body, 0.01, 100, every=10))
    """
    from kratos_lite.view import motion_picture

    _check_single(body, Path(path))
    if body.mesh is None:
        raise ModelError(f"{path}: this body has no mesh to be drawn")
    rows, kept = [], []
    for state in states:
        rows.append(row_of(body, state))
        kept.append(state.q)
    if not kept:
        raise InputError(f"{path}: there is no state to draw")
    table = np.array(rows)
    positions = [body.position(body.mesh.points, kept[i]) for i in _telling(body, kept, shown)]
    names = ("kinetic", "internal", "potential", "sum")
    curves = {name: table[:, 1 + i] for i, name in enumerate(names) if table[:, 1 + i].any()}
    motion_picture(
        path,
        body.mesh,
        positions,
        table[:, 6:9],
        table[:, 0],
        curves,
        title=title,
        unit="energy in J",
        size=size,
    )


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
