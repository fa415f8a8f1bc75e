"""Supports of a deck, on its mesh."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.io.abaqus.mesh import MeshCards
from kratos_lite.mesh import Mesh
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.typing import Array, Ints, Mask


@dataclass
class Nodal:
    """Values at nodes along directions, (n, k): which are given, with the names of their amplitudes."""

    given: Mask
    values: Array
    amplitudes: Array  # of str
    steps: Ints  # in which each was given

    @classmethod
    def none(cls, n: int, k: int = 3) -> Nodal:
        """Return nothing at n nodes."""
        steps, names = np.zeros((n, k), dtype=np.int64), np.full((n, k), "", dtype=object)
        return cls(np.zeros((n, k), dtype=bool), np.zeros((n, k)), names, steps)

    def copy(self) -> Nodal:
        """Return a copy."""
        return Nodal(self.given.copy(), self.values.copy(), self.amplitudes.copy(), self.steps.copy())

    def clear(self) -> None:
        """Remove everything."""
        self.given[:], self.values[:], self.steps[:] = False, 0.0, 0

    def settle(self, factors: dict[str, float]) -> None:
        """Let amplitudes end at factors."""
        for name in factors.keys() & set(self.amplitudes[self.given]):
            at = self.given & (self.amplitudes == name)
            self.values[at] *= factors[name]
            self.amplitudes[at] = ""

    def put(self, rows: Ints, axes: int | slice, value: float, amplitude: str) -> None:
        """Give a value to nodes."""
        self.given[rows, axes], self.values[rows, axes] = True, value
        self.amplitudes[rows, axes] = amplitude

    def add(self, rows: Ints, axis: int, value: float, amplitude: str, step: int) -> None:
        """Add a value to those of the same step, and replace those of earlier ones."""
        self.values[rows[self.steps[rows, axis] < step], axis] = 0.0
        self.steps[rows, axis] = step
        np.add.at(self.values[:, axis], rows, value)
        self.given[rows, axis], self.amplitudes[rows, axis] = True, amplitude


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


def node_rows(word: str, at: Row | Card, cards: MeshCards, mesh: Mesh) -> Ints:
    """Return the rows of nodes that a number or the name of a set means."""
    ids = cards.nodes_of(word, at)
    rows = mesh.node_rows(ids)
    if (rows < 0).any():
        at.wrong(f"there is no node {ids[rows < 0][0]}")
    return rows


def rotation_rows(rows: Ints, cards: MeshCards, mesh: Mesh, row: Row) -> Ints:
    """Return the nodes whose displacements are the rotations of reference nodes among some nodes."""
    known = np.array(list(cards.rotation), dtype=np.int64)
    refs = known[np.isin(known, mesh.node_ids[rows])].tolist()
    if alone := set(refs) & cards.rigid:
        row.wrong(f"rotations of the rigid body of node {min(alone)} are directions 1, 2, 3 of its ROT NODE")
    return mesh.node_rows(np.array([cards.rotation[ref] for ref in refs], dtype=np.int64))


def boundary(card: Card, held: Nodal, cards: MeshCards, mesh: Mesh) -> None:
    """Read *BOUNDARY."""
    card.check_options(("OP", "AMPLITUDE", "FIXED"))
    if card.options.get("OP", "").upper() == "NEW":
        held.clear()
    if "FIXED" in card.options:
        card.wrong("option FIXED is not supported; give the value")
    for row in card.rows():
        rows = node_rows(row.text(0), row, cards, mesh)
        word = row.text(1)
        if not word.isdigit():
            row.wrong(f"{word!r} is no number of a direction; 1, 2, 3 are x, y, z")
        first, last = row.integer(1), row.integer(2, row.integer(1))
        if not 1 <= first <= last:
            row.wrong(f"directions {first} to {last}: give the first and the last of 1, 2, 3")
        if first == 11:
            row.wrong("temperatures are given by *TEMPERATURE; degree of freedom 11 is not supported")
        value = row.number(3, 0.0)
        held.put(rows, slice(first - 1, min(last, 3)), value, card.amplitude)
        if last > 3:  # rotations, which solids do not have
            turned = rotation_rows(rows, cards, mesh, row)
            held.put(turned, slice(max(first, 4) - 4, min(last, 6) - 3), value, card.amplitude)
