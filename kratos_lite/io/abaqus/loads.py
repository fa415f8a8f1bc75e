"""Loads of a deck: what acts at the end of a step, and the loads of a model that these are."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.errors import ModelError
from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.io.abaqus.mesh import MeshCards, face_number, face_rows
from kratos_lite.io.abaqus.supports import Axes, Nodal, node_rows, rotation_rows
from kratos_lite.mesh import Block, Mesh, rows_of_ids, with_rows
from kratos_lite.model.loads.base import Load
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.loads.nodal import NodalForces
from kratos_lite.model.loads.surface import ConditionLoads
from kratos_lite.model.loads.temperature import Temperature
from kratos_lite.shapes.faces import FACE_SHAPES
from kratos_lite.typing import Array, Ints

Face: TypeAlias = tuple[int, int]
"""Row of an element, and the number of a face in it, from 0."""


@dataclass(frozen=True)
class Term:
    """A distributed load: its numbers, its amplitude, and the step in which it was given."""

    values: tuple[float, ...]
    amplitude: str
    step: int

    def settled(self, factors: dict[str, float], count: int) -> Term:
        """Return the load whose first numbers the end of its amplitude has multiplied."""
        if self.amplitude not in factors:
            return self
        factor = factors[self.amplitude]
        return Term((*(factor * v for v in self.values[:count]), *self.values[count:]), "", self.step)


@dataclass
class Acting:
    """The loads at the end of a step."""

    forces: Nodal
    temperatures: Nodal  # (n, 1)
    imaginary: Nodal  # forces that are a quarter of a period ahead, in *STEADY STATE DYNAMICS
    faces: dict[tuple[str, Face], Term] = field(default_factory=dict)  # P: a pressure, T: a traction
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
        for key, term in self.faces.items():
            self.faces[key] = term.settled(factors, len(term.values))
        for body, term in self.bodies.items():  # a size, then directions and places
            self.bodies[body] = term.settled(factors, 1)

    def names(self) -> set[str]:
        """Return the amplitudes of the loads."""
        of_nodes = (set(some.amplitudes[some.given]) for some in self.nodal)
        terms = (term.amplitude for term in (*self.faces.values(), *self.bodies.values()))
        return set().union(*of_nodes, terms) - {""}

    def put(self, key: tuple[str, Face], values: tuple[float, ...], amplitude: str, step: int) -> None:
        """Add to a load on a face of the same step, or replace that of an earlier one."""
        old = self.faces.get(key)
        if old is not None and old.step == step:
            values = tuple(a + b for a, b in zip(old.values, values, strict=True))
        self.faces[key] = Term(values, amplitude, step)


class LoadCards:
    """Reads the cards of loads on a mesh."""

    def __init__(self, cards: MeshCards, mesh: Mesh) -> None:
        self.cards, self.mesh = cards, mesh
        self._order = np.argsort(mesh.element_ids, kind="stable")
        self._faces = [
            (at.start, at.stop, face_rows(block.known_shape)) for block, at in with_rows(mesh.blocks)
        ]

    def cload(self, card: Card, acting: Acting, step: int) -> None:
        """Read *CLOAD."""
        card.check_options(("OP", "AMPLITUDE", "LOADCASE"))
        forces = acting.imaginary if card.options.get("LOADCASE") == "2" else acting.forces
        if _op(card) == "NEW":
            forces.clear()
        name = card.options.get("AMPLITUDE", "").upper()
        for row in card.rows():
            axis = row.integer(1)
            nodes = node_rows(row.text(0), row, self.cards, self.mesh)
            if axis in (4, 5, 6):
                nodes = rotation_rows(nodes, self.cards, self.mesh, row)
            if axis not in range(1, 7) or not len(nodes):
                row.wrong(f"a force on solids has direction 1, 2 or 3, on reference nodes 1 … 6; got {axis}")
            forces.add(nodes, (axis - 1) % 3, row.number(2), name, step)

    def dload(self, card: Card, acting: Acting, step: int) -> None:
        """Read *DLOAD."""
        card.check_options(("OP", "AMPLITUDE"))
        if _op(card) == "NEW":
            acting.faces.clear()
            acting.bodies.clear()
        name = card.options.get("AMPLITUDE", "").upper()
        for row in card.rows():
            kind = row.text(1).upper()
            if kind in ("GRAV", "CENTRIF"):
                at = row.text(0).upper()
                if not at.isdigit():
                    self.cards.elements_of(at, row)
                values = tuple(row.numbers(4 if kind == "GRAV" else 7, 2))
                acting.bodies[kind, at, values[1:]] = Term(values, name, step)
                continue
            face = face_number(kind, row, "P")
            for key in self.faces(self.cards.elements_of(row.text(0), row), face, row):
                acting.put(("P", key), (row.number(2),), name, step)

    def dsload(self, card: Card, acting: Acting, step: int) -> None:
        """Read *DSLOAD."""
        card.check_options(("OP", "AMPLITUDE"))
        if _op(card) == "NEW":  # as those of *DLOAD
            acting.faces.clear()
            acting.bodies.clear()
        name = card.options.get("AMPLITUDE", "").upper()
        for row in card.rows():
            if row.text(1).upper() != "P":
                row.wrong(f"a load on a surface is P, a pressure; got {row.text(1)}")
            for key in self.surface(row.text(0), row):
                acting.put(("P", key), (row.number(2),), name, step)

    def temperature(self, card: Card, acting: Acting, step: int) -> None:
        """Read *TEMPERATURE."""
        card.check_options(("OP", "AMPLITUDE"))
        if _op(card) == "NEW":
            acting.temperatures.clear()
        name = card.options.get("AMPLITUDE", "").upper()
        for row in card.rows():
            nodes = node_rows(row.text(0), row, self.cards, self.mesh)
            acting.temperatures.put(nodes, 0, row.number(1), name)

    def surface(self, name: str, at: Row | Card) -> list[Face]:
        """Return the faces of a surface."""
        found = self.cards.surfaces.get(name.upper())
        if found is None or found.nodes is not None:
            at.wrong(f"there is no *SURFACE {name} of faces")
        numbers = np.unique(found.faces).tolist()
        return [face for k in numbers for face in self.faces(found.elements[found.faces == k], k, at)]

    def faces(self, ids: Ints, face: int, at: Row | Card) -> list[Face]:
        """Return a face of elements."""
        rows = rows_of_ids(self.mesh.element_ids, ids, self._order)
        if (rows < 0).any():
            at.wrong(f"there is no solid element {ids[rows < 0][0]}")
        found = list[Face]()
        for start, stop, ours in self._faces:
            some = rows[(rows >= start) & (rows < stop)].tolist()
            if some and face >= len(ours):
                text = f"element {self.mesh.element_ids[some[0]]} has {len(ours)} faces"
                at.wrong(f"{text}; got number {face + 1}")
            found += [(row, ours[face]) for row in some]
        return found


def _op(card: Card) -> str:
    op = card.options.get("OP", "MOD").upper()
    return op if op in ("NEW", "MOD") else card.wrong(f"OP is NEW or MOD; got {op}")


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


def loads_of(
    model: Model,
    acting: Acting,
    number: dict[Face, int],
    axes: Axes,
    initial: Array,
    cards: MeshCards,
) -> Iterable[tuple[Load, str]]:
    """Yield the loads of a model, each with the name of its amplitude."""
    mesh, n = model.mesh, model.mesh.n_nodes
    F, carried = acting.forces, np.asarray if model.references is None else model.references.carried
    for name in sorted(set(F.amplitudes[F.given])):
        values = np.where(F.given & (F.amplitudes == name), F.values, 0.0)
        turned = np.flatnonzero(values.any(axis=1) & (axes.of_node >= 0))
        values[turned] = np.einsum("ni,nij->nj", values[turned], axes.directions(mesh, turned))
        yield NodalForces(carried(values)), name
    for name in sorted({term.amplitude for term in acting.faces.values()}):
        pressure = np.zeros(len(number))
        for (_, face), term in acting.faces.items():
            if term.amplitude == name:
                pressure[number[face]] = term.values[0]
        none = {cell: np.zeros((n, 3)) for cell in ("point", "line", "triangle", "quadrilateral")}
        yield ConditionLoads(np.zeros((len(number), 3)), none, pressure, np.zeros(n)), name
    for (kind, at, _), term in acting.bodies.items():
        where = rows_of_ids(mesh.element_ids, np.unique(cards.elements_in(at)))
        where, masses = where[where >= 0], cards.masses_of(at)
        if kind == "GRAV":
            size, *direction = term.values
            force = size * np.array(direction)
            if masses.any():
                yield NodalForces(carried(masses[:, None] * force)), term.amplitude
            yield Gravity(force, where), term.amplitude
        elif masses.any():
            raise ModelError("*DLOAD: CENTRIF on masses is not supported; give their force by *CLOAD")
        else:
            yield Gravity(_centrifugal(term.values), where), term.amplitude
    T, same = acting.temperatures, float(initial[0]) if (initial == initial[0]).all() else 0.0
    for name in sorted(set(T.amplitudes[T.given])):
        of = T.given[:, 0] & (T.amplitudes[:, 0] == name)
        difference = np.where(of, T.values[:, 0] - initial, 0.0)[cards.twin]
        yield Temperature(difference + same, same), name


def _centrifugal(values: tuple[float, ...]) -> Callable[[Array], Array]:
    """Return ω² times the distance from an axis, of places."""
    square, center, axis = values[0], np.array(values[1:4]), np.array(values[4:7])
    axis /= np.linalg.norm(axis)

    def acceleration(X: Array) -> Array:
        arm = X - center
        return np.asarray(square * (arm - (arm @ axis)[:, None] * axis))

    return acceleration
