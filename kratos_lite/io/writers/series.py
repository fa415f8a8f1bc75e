"""Series of states in time: frames for ParaView, tables, arrays and increments of CalculiX."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from kratos_lite.analysis.fields import labelled
from kratos_lite.analysis.quasi_static import QuasiStaticAnalysis
from kratos_lite.analysis.transient import TransientAnalysis
from kratos_lite.atomic import refuse_nan, write_arrays
from kratos_lite.bodies import Body
from kratos_lite.errors import InputError
from kratos_lite.io.formats import check_series
from kratos_lite.io.formats.vtu import check_mode, write_pvd, write_vtu
from kratos_lite.io.writers.recorded import Recorded, arrays_of, recorded
from kratos_lite.io.writers.results import write_table
from kratos_lite.typing import Array
from kratos_lite.validation import path_of


class Arrays:
    """Numbers of each state as arrays, one row for each state; other kinds of files take states likewise."""

    def __init__(self, path: Path, subject: Recorded, mode: str) -> None:
        self.path, self.subject, self.mode = path, subject, mode
        self.states: list[Any] = []

    def add(self, state: Any) -> None:
        """Take one state."""
        self.states.append(state)

    def write(self) -> None:
        """Write what all states together make, as a whole or not at all."""
        write_arrays(self.path, arrays_of(self.subject, self.states))


class Frames(Arrays):
    """Meshes, one for each state, and their index."""

    def __init__(self, path: Path, subject: Recorded, mode: str) -> None:
        super().__init__(path, subject, mode)
        check_mode(mode)
        self.mesh = subject.mesh()
        self.frames: list[tuple[float, str]] = []

    def add(self, state: Any) -> None:
        """Write the frame of a state."""
        name = f"{self.path.stem}_{len(self.frames):05d}.vtu"
        fields, cells = self.subject.fields(state)
        points: dict[str, Any] = {**fields, "NODE_ID": self.mesh.node_ids}
        write_vtu(self.path.with_name(name), self.mesh, points, cells, mode=self.mode)
        self.frames.append((state.time, name))

    def write(self) -> None:
        """Write the index."""
        write_pvd(self.path, self.frames)


class Table(Arrays):
    """Numbers as text, one line for each state."""

    def __init__(self, path: Path, subject: Recorded, mode: str) -> None:
        super().__init__(path, subject, mode)
        subject.row(subject.now())  # refuses many bodies before the first step
        self.rows: list[Array] = []

    def add(self, state: Any) -> None:
        """Take the row of a state."""
        row = self.subject.row(state)
        refuse_nan(self.path, f"a number at t = {row[0]:g} s", row)
        self.rows.append(row)

    def write(self) -> None:
        """Write the lines."""
        columns = dict(zip(self.subject.columns, np.transpose(self.rows), strict=True))
        write_table(self.path, labelled(columns, self.subject.units))


class Page(Arrays):
    """A page for the browser."""

    def __init__(self, path: Path, subject: Recorded, mode: str) -> None:
        super().__init__(path, subject, mode)
        subject.mesh()  # refuses a body without one before the first step

    def write(self) -> None:
        """Write the page."""
        from kratos_lite.io.writers.page.write import write_states_page  # rarely needed

        write_states_page(self.path, self.subject, self.states)


class Increments(Page):
    """A file of CalculiX."""

    def write(self) -> None:
        """Write the file."""
        from kratos_lite.io.writers.frd import FrdStep, write_frd  # rarely needed

        kind, states = self.subject.kind, enumerate(self.states, 1)
        steps = (FrdStep(self.subject.at_nodes(s), s.time, kind, increment=i) for i, s in states)
        write_frd(self.path, self.subject.mesh(), steps)


KINDS: dict[str, type[Arrays]] = {
    ".pvd": Frames, ".html": Page, ".csv": Table, ".npz": Arrays, ".frd": Increments
}  # fmt: skip


class SeriesWriter:
    """Write a series of states to a file; the extension of the path selects the format.

    - ``.pvd``: for ParaView; an index, and beside it ``NAME_00000.vtu`` … with the undeformed mesh, and
      DISPLACEMENT (m) and VELOCITY (m/s) on its nodes; of a transient also ACCELERATION (m/s²), REACTION (N)
      and stresses (Pa).
    - ``.html``: a page for the browser that plays the states, in color; some of them, evenly spread, where
      there are very many.
    - ``.csv``: a table with a line for each state: time, energies, mass center, momenta; of a transient time,
      energy, largest displacement, total reaction.
    - ``.npz``: arrays with a row for each state: ``time``, ``step``, and ``q``, ``u``, ``external_work`` of a
      body, or ``u``, ``v``, ``a``, ``reactions`` of a transient, or ``u``,
      ``reactions``, ``work`` of quasi-static steps.
    - ``.frd``: for programs that read files of CalculiX, an increment for each state.

    The folder is made if it is missing.  Every file is written as a whole or not at all.  Index, page, table
    and arrays come at the end, also when the loop ends early or by an error: then they hold the states up to
    there.

    Parameters
    ----------
    path : the file to write.
    owner : the body whose states come, many at once only as ``.npz``; the transient or quasi-static analysis.
    mode : of ``.vtu`` files: ``binary``, ``compressed`` or ``ascii``.

    Raises
    ------
    InputError
        The extension is not one of these, or a file cannot be written.
    ModelError
        The body has no mesh, or is a batch of bodies.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    >>> folder = getfixture("tmp_path")
    >>> with SeriesWriter(folder / "spin.pvd", body) as series:
    ...     series.add()
    ...     for state in kl.integrate(body, dt=0.01, steps=20, every=10):
    ...         series.add(state)
    >>> sorted(path.name for path in folder.iterdir())
    ['spin.pvd', 'spin_00000.vtu', 'spin_00001.vtu', 'spin_00002.vtu']
    """

    def __init__(
        self, path: str | Path, owner: Body | TransientAnalysis | QuasiStaticAnalysis, *, mode: str = "binary"
    ) -> None:
        path = path_of(path)
        check_series(path)
        self.count = 0
        self._subject = recorded(owner, path)
        self._writer = KINDS[path.suffix.lower()](path, self._subject, mode)

    def add(self, state: Any = None) -> None:
        """Take one more state.

        Parameters
        ----------
        state : of the owner; as it is now if none is given.

        Raises
        ------
        InputError
            It is a state of another body or mesh, or none.
        """
        taken = self._subject.now() if state is None else self._subject.checked(state)
        if not self.count:
            make_folder(self._writer.path)
        self._writer.add(taken)
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


def make_folder(path: str | Path) -> None:
    """Make the folder of a file if it is missing; InputError if that cannot be done."""
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: its folder cannot be made: {error.strerror}") from error
