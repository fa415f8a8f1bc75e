"""Supports of a deck, on its mesh."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from kratos_lite.io.abaqus.cards import Card
from kratos_lite.io.abaqus.mesh import Geometry
from kratos_lite.mesh import Mesh
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.typing import Array, Ints, Mask, Numbers


@dataclass
class Nodal:
    """Values at nodes along directions, or of elements on faces, (n, k), and names of their amplitudes."""

    given: Mask
    values: Array
    amplitudes: Numbers  # their numbers among the names
    steps: Numbers  # in which each was given
    names: list[str] = field(default_factory=lambda: [""])

    @classmethod
    def none(cls, n: int, k: int = 3) -> Nodal:
        """Return nothing at n nodes."""
        given, values = np.zeros((n, k), dtype=bool), np.zeros((n, k))
        return cls(given, values, np.zeros((n, k), dtype=np.int16), np.zeros((n, k), dtype=np.int16))

    def copy(self) -> Nodal:
        """Return a copy."""
        if not self.given.any():  # many do not occur in a deck
            return Nodal.none(*self.given.shape)
        numbers = self.amplitudes.copy(), self.steps.copy()
        return Nodal(self.given.copy(), self.values.copy(), *numbers, self.names)

    def clear(self) -> None:
        """Remove everything."""
        self.given[:], self.values[:], self.steps[:] = False, 0.0, 0

    def by_amplitude(self) -> Iterator[tuple[str, Mask]]:
        """Yield the names of the amplitudes in order, each with what has it, (n, k)."""
        numbers = np.flatnonzero(np.bincount(self.amplitudes[self.given])).tolist()
        for number in sorted(numbers, key=self.names.__getitem__):
            yield self.names[number], self.given & (self.amplitudes == number)

    def settle(self, factors: dict[str, float]) -> None:
        """Let amplitudes end at factors."""
        for name, at in self.by_amplitude() if len(self.names) > 1 else ():
            if name in factors:
                self.values[at] *= factors[name]
                self.amplitudes[at] = 0

    def put(self, rows: Ints, axes: int | slice, value: float, amplitude: str) -> None:
        """Give a value to nodes."""
        self.given[rows, axes], self.values[rows, axes] = True, value
        self.amplitudes[rows, axes] = self._number(amplitude)

    def add(self, rows: Ints, axes: Ints | int, value: float, amplitude: str, step: int) -> None:
        """Add a value to those of the same step, and replace those of earlier ones."""
        at = rows, np.broadcast_to(axes, rows.shape)
        self.values[at] = np.where(self.steps[at] < step, 0.0, self.values[at])
        np.add.at(self.values, at, value)
        self.given[at], self.steps[at], self.amplitudes[at] = True, step, self._number(amplitude)

    def _number(self, name: str) -> int:
        if name not in self.names:
            self.names.append(name)
        return self.names.index(name)


@dataclass
class Axes:
    """Local axes of nodes (*TRANSFORM)."""

    of_node: Ints  # index of `each`, or -1
    each: list[LocalAxes] = field(default_factory=list)

    def directions(self, mesh: Mesh, rows: Ints) -> Array:
        """Return the axes (m, 3, 3) of nodes."""
        out = np.broadcast_to(np.eye(3), (len(rows), 3, 3)).copy()
        for i, axes in enumerate(self.each):
            of = self.of_node[rows] == i
            out[of] = axes.directions(mesh.points[rows[of]])
        return out


def boundary(card: Card, held: Nodal, geometry: Geometry) -> None:
    """Read *BOUNDARY."""
    card.check_options(("OP", "AMPLITUDE", "FIXED"))
    if card.options.get("OP", "").upper() == "NEW":
        held.clear()
    if "FIXED" in card.options:
        card.wrong("option FIXED is not supported; give the value")
    for row in card.rows():
        rows = geometry.nodes(row.text(0), row)
        word = row.text(1)
        if not word.isdigit():
            row.wrong(f"{word!r} is no number of a direction; 1, 2, 3 are x, y, z")
        first, last = row.integer(1), row.integer(2, row.integer(1))
        if not 1 <= first <= last:
            row.wrong(f"directions {first} to {last}: give the first and the last of 1, 2, 3")
        if first == 11:
            row.wrong("temperatures are given by *TEMPERATURE; degree of freedom 11 is not supported")
        value = row.number(3, 0.0)
        amplitude = card.amplitude if value else ""
        held.put(rows, slice(first - 1, min(last, 3)), value, amplitude)
        if last > 3:  # rotations, which solids do not have
            turned = geometry.rotations(rows, row)
            held.put(turned, slice(max(first, 4) - 4, min(last, 6) - 3), value, amplitude)
