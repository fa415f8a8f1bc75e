"""Trajectories: the states of a body or a model in time as files for ParaView, as tables and arrays."""

from __future__ import annotations

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
        check_single(owner, path)
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
        check_single(owner, path)

    def add(self, state: State) -> None:
        self.rows.append(row_of(self.owner, state))


class _BodyArrays(Arrays):
    """Configurations and velocities."""

    owner: Body
    names = ("time", "step", "q", "u", "external_work")

    def extra(self) -> dict[str, Any]:
        return {"kind": np.array(self.owner.kind)}


def check_single(body: Body, path: Path) -> None:
    """Raise ModelError for bodies that hold many."""
    if body.q.ndim > 1:
        raise ModelError(f"{path}: only a single body can be written so; for many bodies write .npz")


class SeriesWriter:
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
    >>> with SeriesWriter(folder / "spin.pvd", body) as series:
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
        """Take one more state.

        Parameters
        ----------
        state : of the owner; as it is now if none is given.
        """
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

    def __enter__(self) -> SeriesWriter:
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
    if Path(path).suffix.lower() not in SeriesWriter.kinds:
        raise InputError(f"{path}: a series of states is written as {', '.join(SeriesWriter.kinds)}")
