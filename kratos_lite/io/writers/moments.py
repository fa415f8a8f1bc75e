"""Moments of transients as frames for ParaView, tables and arrays; and what all writers of series share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.io.atomic import write_arrays, write_whole
from kratos_lite.io.formats.vtu import check_mode, write_pvd, write_vtu
from kratos_lite.io.writers.results import fields
from kratos_lite.typing import Array

if TYPE_CHECKING:
    from kratos_lite.analysis import Moment, Transient
    from kratos_lite.mesh import Mesh

MOMENT_COLUMNS = (
    "time [s]",
    "energy [J]",
    "largest displacement [m]",
    *(f"total reaction {axis} [N]" for axis in "xyz"),
)
"""Columns of a table of moments."""


class Writer(ABC):
    """One kind of file of a series, of a body or a transient.

    Parameters
    ----------
    path : the file.
    owner : whose states come.
    mode : of ``.vtu`` files.
    """

    def __init__(self, path: Path, owner: Any, mode: str) -> None:
        self.path, self.owner, self.mode = path, owner, mode

    @abstractmethod
    def add(self, state: Any) -> None:
        """Take one state."""

    @abstractmethod
    def write(self) -> None:
        """Write what all states together make, as a whole or not at all."""


class Frames(Writer):
    """Meshes, one for each state, and their index."""

    def __init__(self, path: Path, owner: Any, mode: str) -> None:
        super().__init__(path, owner, mode)
        check_mode(mode)
        self.frames: list[tuple[float, str]] = []

    def frame(
        self, time: float, mesh: Mesh, data: dict[str, Array], cells: dict[str, Array] | None = None
    ) -> None:
        """Write the mesh at a time in s with data of nodes and elements by name."""
        name = f"{self.path.stem}_{len(self.frames):05d}.vtu"
        write_vtu(
            self.path.with_name(name), mesh, {**data, "NODE_ID": mesh.node_ids}, cells or {}, mode=self.mode
        )
        self.frames.append((time, name))

    def write(self) -> None:
        """Write the index."""
        write_pvd(self.path, self.frames)


class Table(Writer):
    """Numbers as text, one line for each state."""

    columns: tuple[str, ...]

    def __init__(self, path: Path, owner: Any, mode: str) -> None:
        super().__init__(path, owner, mode)
        self.rows: list[Array] = []

    def write(self) -> None:
        """Write the lines."""
        lines = [",".join(self.columns), *(",".join(map(repr, row.tolist())) for row in self.rows)]
        write_whole(self.path, ("\n".join(lines) + "\n").encode())


class Arrays(Writer):
    """Named numbers of each state as arrays, one row for each state."""

    names: tuple[str, ...]

    def __init__(self, path: Path, owner: Any, mode: str) -> None:
        super().__init__(path, owner, mode)
        self.states: list[Any] = []

    def add(self, state: Any) -> None:
        """Keep a state."""
        self.states.append(state)

    def extra(self) -> dict[str, Array]:
        """Return further arrays, of the owner."""
        return {}

    def write(self) -> None:
        """Write the arrays."""
        arrays = {name: np.array([getattr(state, name) for state in self.states]) for name in self.names}
        write_arrays(self.path, {**self.extra(), **arrays})


class MomentFrames(Frames):
    """DISPLACEMENT, VELOCITY, ACCELERATION, REACTION and stresses."""

    owner: Transient

    def add(self, state: Moment) -> None:
        """Write the frame of a moment."""
        points, cells = fields(self.owner.result(state))
        data = {**points, "VELOCITY": state.v, "ACCELERATION": state.a}
        self.frame(state.time, self.owner.equations.model.mesh, data, cells)


class MomentTable(Table):
    """Time, energy, largest displacement and total reaction."""

    owner: Transient
    columns = MOMENT_COLUMNS

    def add(self, state: Moment) -> None:
        """Take the row of a moment."""
        largest = np.linalg.norm(state.u, axis=1).max()
        reaction = state.reactions.sum(axis=0)
        self.rows.append(np.array([state.time, self.owner.energy(state), largest, *reaction]))


class MomentArrays(Arrays):
    """All that a moment holds."""

    owner: Transient
    names = ("time", "step", "u", "v", "a", "reactions")


MOMENT_WRITERS: dict[str, type[Writer]] = {
    ".pvd": MomentFrames,
    ".csv": MomentTable,
    ".npz": MomentArrays,
}
