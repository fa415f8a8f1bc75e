"""Loads of a deck: the cards of loads, and what acts at the end of a step."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.io.abaqus.mesh import MeshCards, face_number, face_rows
from kratos_lite.io.abaqus.supports import Nodal, node_rows, rotation_rows
from kratos_lite.mesh import Block, Mesh, rows_of_ids, with_rows
from kratos_lite.shapes.faces import FACE_SHAPES
from kratos_lite.typing import Ints

Face: TypeAlias = tuple[int, int]
"""Row of an element, and the number of a face in it, from 0."""


@dataclass(frozen=True)
class Term:
    """A distributed load: its size, directions and places, its amplitude, and the step that gave it."""

    values: tuple[float, ...]
    amplitude: str
    step: int

    def settled(self, factors: dict[str, float]) -> Term:
        """Return the load whose size the end of its amplitude has multiplied."""
        if self.amplitude not in factors:
            return self
        size, *places = self.values
        return Term((factors[self.amplitude] * size, *places), "", self.step)


@dataclass
class Acting:
    """The loads at the end of a step."""

    forces: Nodal
    temperatures: Nodal  # (n, 1)
    imaginary: Nodal  # forces that are a quarter of a period ahead, in *STEADY STATE DYNAMICS
    faces: dict[Face, Term] = field(default_factory=dict)  # pressures
    bodies: dict[tuple[str, str, tuple[float, ...]], Term] = field(default_factory=dict)  # GRAV and CENTRIF

    @classmethod
    def none(cls, n: int) -> Acting:
        """Return no load on n nodes."""
        return cls(Nodal.none(n), Nodal.none(n, 1), Nodal.none(n))

    @property
    def nodal(self) -> tuple[Nodal, ...]:
        """What is given at nodes."""
        return self.forces, self.temperatures, self.imaginary

    def copy(self) -> Acting:
        """Return a copy."""
        forces, temperatures, imaginary = (some.copy() for some in self.nodal)
        return Acting(forces, temperatures, imaginary, dict(self.faces), dict(self.bodies))

    def settle(self, factors: dict[str, float]) -> None:
        """Let amplitudes end at factors."""
        for some in self.nodal:
            some.settle(factors)
        self.faces = {key: term.settled(factors) for key, term in self.faces.items()}
        self.bodies = {key: term.settled(factors) for key, term in self.bodies.items()}

    def names(self) -> set[str]:
        """Return the amplitudes of the loads."""
        of_nodes = (set(some.amplitudes[some.given]) for some in self.nodal)
        terms = (term.amplitude for term in (*self.faces.values(), *self.bodies.values()))
        return set().union(*of_nodes, terms) - {""}

    def press(self, face: Face, pressure: float, amplitude: str, step: int) -> None:
        """Add to the pressure on a face of the same step, or replace that of an earlier one."""
        old = self.faces.get(face)
        if old is not None and old.step == step:
            pressure += old.values[0]
        self.faces[face] = Term((pressure,), amplitude, step)


class LoadCards:
    """Reads the cards of loads on a mesh."""

    def __init__(self, cards: MeshCards, mesh: Mesh) -> None:
        self.cards, self.mesh = cards, mesh
        self._ids = mesh.element_ids  # kept, as decks may name faces line by line
        self._order = np.argsort(self._ids, kind="stable")
        self._faces = [
            (at.start, at.stop, face_rows(block.known_shape)) for block, at in with_rows(mesh.blocks)
        ]

    def read(self, card: Card, acting: Acting, step: int) -> None:
        """Read *CLOAD, *DLOAD, *DSLOAD or *TEMPERATURE; OP=NEW removes the loads of its kind."""
        card.check_options(("OP", "AMPLITUDE", *["LOADCASE"] * (card.keyword == "CLOAD")))
        forces = acting.imaginary if card.options.get("LOADCASE") == "2" else acting.forces
        if (op := card.options.get("OP", "MOD").upper()) not in ("NEW", "MOD"):
            card.wrong(f"OP is NEW or MOD; got {op}")
        if op == "NEW":
            kinds: dict[str, tuple[Any, ...]] = {"CLOAD": (forces,), "TEMPERATURE": (acting.temperatures,)}
            kinds |= dict.fromkeys(("DLOAD", "DSLOAD"), (acting.faces, acting.bodies))
            for loads in kinds[card.keyword]:
                loads.clear()
        for row in card.rows():
            if card.keyword == "CLOAD":
                self._force(row, forces, card.amplitude, step)
            elif card.keyword == "TEMPERATURE":
                nodes = node_rows(row.text(0), row, self.cards, self.mesh)
                acting.temperatures.put(nodes, 0, row.number(1), card.amplitude)
            else:
                self._distributed(row, acting, card, step)

    def _force(self, row: Row, forces: Nodal, amplitude: str, step: int) -> None:
        """Read a row of *CLOAD."""
        axis = row.integer(1)
        nodes = node_rows(row.text(0), row, self.cards, self.mesh)
        if axis in (4, 5, 6):
            nodes = rotation_rows(nodes, self.cards, self.mesh, row)
        if axis not in range(1, 7) or not len(nodes):
            row.wrong(f"a force on solids has direction 1, 2 or 3, on reference nodes 1 … 6; got {axis}")
        forces.add(nodes, (axis - 1) % 3, row.number(2), amplitude, step)

    def _distributed(self, row: Row, acting: Acting, card: Card, step: int) -> None:
        """Read a row of *DLOAD or *DSLOAD."""
        kind = row.text(1).upper()
        if card.keyword == "DSLOAD":
            if kind != "P":
                row.wrong(f"a load on a surface is P, a pressure; got {row.text(1)}")
            faces = self.surface(row.text(0), row)
        elif kind in ("GRAV", "CENTRIF"):
            at = row.text(0).upper()
            self.cards.elements_of(at, row)
            values = tuple(row.numbers(4 if kind == "GRAV" else 7, 2))
            acting.bodies[kind, at, values[1:]] = Term(values, card.amplitude, step)
            return
        else:
            faces = self.faces(self.cards.elements_of(row.text(0), row), face_number(kind, row, "P"), row)
        for face in faces:
            acting.press(face, row.number(2), card.amplitude, step)

    def surface(self, name: str, at: Row | Card) -> list[Face]:
        """Return the faces of a surface."""
        found = self.cards.surfaces.get(name.upper())
        if found is None or found.nodes is not None:
            at.wrong(f"there is no *SURFACE {name} of faces")
        numbers = np.unique(found.faces).tolist()
        return [face for k in numbers for face in self.faces(found.elements[found.faces == k], k, at)]

    def faces(self, ids: Ints, face: int, at: Row | Card) -> list[Face]:
        """Return a face of elements."""
        rows = rows_of_ids(self._ids, ids, self._order)
        if (rows < 0).any():
            at.wrong(f"there is no solid element {ids[rows < 0][0]}")
        found = list[Face]()
        for start, stop, ours in self._faces:
            some = rows[(rows >= start) & (rows < stop)].tolist()
            if some and face >= len(ours):
                text = f"element {self._ids[some[0]]} has {len(ours)} faces"
                at.wrong(f"{text}; got number {face + 1}")
            found += [(row, ours[face]) for row in some]
        return found


def with_faces(mesh: Mesh, every: Iterable[Face], name: str) -> tuple[Mesh, dict[Face, int]]:
    """Return the mesh with conditions on faces, and the number of each."""
    groups = dict[type, list[tuple[Face, Ints]]]()
    blocks = [(block, at) for block, at in with_rows(mesh.blocks)]
    for face in sorted(set(every)):
        block, at = next((b, s) for b, s in blocks if s.start <= face[0] < s.stop)
        nodes = block.nodes[face[0] - at.start][list(block.known_shape.faces[face[1]])]
        groups.setdefault(FACE_SHAPES[len(nodes)], []).append((face, nodes))
    number, conditions = dict[Face, int](), list[Block]()
    for shape, found in groups.items():
        ids = len(number) + 1 + np.arange(len(found))
        number |= {face: len(number) + i for i, (face, _) in enumerate(found)}
        nodes = np.array([n for _, n in found])
        conditions.append(Block(f"{name}3D{nodes.shape[1]}N", nodes, ids, shape=shape))
    return mesh.replace(conditions=conditions) if conditions else mesh, number
