"""Loads of a deck: the cards of loads, and what acts at the end of a step."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.io.abaqus.mesh import Geometry, face_number
from kratos_lite.io.abaqus.supports import Nodal
from kratos_lite.mesh import Mesh

Body: TypeAlias = tuple[str, str, tuple[float, ...]]
"""A load on elements: its kind, their set, and its direction or axis."""


@dataclass
class Acting:
    """The loads at the end of a step."""

    forces: Nodal
    imaginary: Nodal  # forces that are a quarter of a period ahead, in *STEADY STATE DYNAMICS
    temperatures: Nodal  # (n, 1)
    pressures: Nodal  # (m, 6) of elements on their faces
    bodies: dict[Body, tuple[float, str, int]] = field(default_factory=dict)
    """Size, amplitude and step of GRAV and CENTRIF."""

    @classmethod
    def none(cls, mesh: Mesh) -> Acting:
        """Return no load on a mesh."""
        n = mesh.n_nodes
        return cls(Nodal.none(n), Nodal.none(n), Nodal.none(n, 1), Nodal.none(mesh.n_elements, 6))

    @property
    def arrays(self) -> tuple[Nodal, ...]:
        """What is given at nodes and faces."""
        return self.forces, self.imaginary, self.temperatures, self.pressures

    def copy(self) -> Acting:
        """Return a copy."""
        forces, imaginary, temperatures, pressures = (some.copy() for some in self.arrays)
        return Acting(forces, imaginary, temperatures, pressures, dict(self.bodies))

    def settle(self, factors: dict[str, float]) -> None:
        """Let amplitudes end at factors."""
        for some in self.arrays:
            some.settle(factors)
        for key, (size, name, step) in self.bodies.items():
            if name in factors:
                self.bodies[key] = factors[name] * size, "", step

    def names(self) -> set[str]:
        """Return the amplitudes of the loads."""
        given = {name for some in self.arrays for name, _ in some.by_amplitude()}
        return (given | {name for _, name, _ in self.bodies.values()}) - {""}


def read_load(card: Card, acting: Acting, geometry: Geometry, step: int) -> None:
    """Read *CLOAD, *DLOAD, *DSLOAD or *TEMPERATURE; OP=NEW removes the loads of its kind."""
    card.check_options(("OP", "AMPLITUDE", *["LOADCASE"] * (card.keyword == "CLOAD")))
    forces = acting.imaginary if card.options.get("LOADCASE") == "2" else acting.forces
    if (op := card.options.get("OP", "MOD").upper()) not in ("NEW", "MOD"):
        card.wrong(f"OP is NEW or MOD; got {op}")
    if op == "NEW":
        kinds: dict[str, tuple[Any, ...]] = {"CLOAD": (forces,), "TEMPERATURE": (acting.temperatures,)}
        kinds |= dict.fromkeys(("DLOAD", "DSLOAD"), (acting.pressures, acting.bodies))
        for loads in kinds[card.keyword]:
            loads.clear()
    for row in card.rows():
        if card.keyword == "CLOAD":
            _force(row, forces, card.amplitude, geometry, step)
        elif card.keyword == "TEMPERATURE":
            nodes = geometry.nodes(row.text(0), row)
            acting.temperatures.put(nodes, 0, row.number(1), card.amplitude)
        else:
            _distributed(row, acting, card, geometry, step)


def _force(row: Row, forces: Nodal, amplitude: str, geometry: Geometry, step: int) -> None:
    """Read a row of *CLOAD."""
    axis, nodes = row.integer(1), geometry.nodes(row.text(0), row)
    if axis in (4, 5, 6):
        nodes = geometry.rotations(nodes, row)
    if axis not in range(1, 7) or not len(nodes):
        row.wrong(f"a force on solids has direction 1, 2 or 3, on reference nodes 1 … 6; got {axis}")
    forces.add(nodes, (axis - 1) % 3, row.number(2, 0.0), amplitude, step)


def _distributed(row: Row, acting: Acting, card: Card, geometry: Geometry, step: int) -> None:
    """Read a row of *DLOAD or *DSLOAD."""
    kind = row.text(1).upper()
    if card.keyword == "DSLOAD":
        if kind != "P":
            row.wrong(f"a load on a surface is P, a pressure; got {row.text(1)}")
        faces = geometry.surface_faces(row.text(0), row)
    elif kind in ("GRAV", "CENTRIF"):
        size, *places = row.numbers(4 if kind == "GRAV" else 7, 2)
        key, ids = (kind, row.text(0).upper(), tuple(places)), geometry.elements_of(row.text(0), row)
        for other in acting.bodies.keys() - {key}:
            if kind == other[0] == "CENTRIF" and np.isin(ids, geometry.elements_of(other[1])).any():
                row.wrong("an element turns about another axis already, and CalculiX counts one; remove one")
        old = acting.bodies.get(key, (0.0, "", 0))
        acting.bodies[key] = size + old[0] * (old[2] == step), card.amplitude, step
        return
    else:
        faces = geometry.faces(geometry.elements_of(row.text(0), row), face_number(kind, row, "P"), row)
    acting.pressures.add(faces[:, 0], faces[:, 1], row.number(2), card.amplitude, step)
