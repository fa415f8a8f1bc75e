"""Supports and loads of a deck: the cards that give them, and what acts at the end of a step."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.io.abaqus.mesh import Geometry, face_number
from kratos_lite.typing import Array, ArrayLike, Ints, Mask, Numbers

Body: TypeAlias = tuple[str, str, tuple[float, ...]]
"""A load on elements of size 1: GRAV or CENTRIF, their set, and its direction or axis."""
OPTIONS = {"BOUNDARY": ("FIXED",), "CLOAD": ("LOADCASE",), "DLOAD": (), "DSLOAD": (), "TEMPERATURE": ()}
"""Cards of supports and loads, and their options beside OP and AMPLITUDE."""
_FACE = re.compile(rb",[ \t]*[Pp]([1-6])[ \t]*,")


@dataclass
class Given:
    """Values at nodes along directions, of elements on faces, or of bodies, (n, k)."""

    given: Mask
    values: Array
    amplitudes: Numbers  # from 1 in the order of the deck; 0 without
    steps: Numbers  # in which each was given

    def put(self, rows: Ints, axes: int | slice, value: float, amplitude: int) -> None:
        """Give a value to rows."""
        self.given[rows, axes], self.values[rows, axes] = True, value
        self.amplitudes[rows, axes] = amplitude

    def add(self, rows: Ints, axes: Ints | int, value: ArrayLike, amplitude: int, step: int) -> None:
        """Add values to those of the same step, and replace those of earlier ones."""
        at = rows, np.broadcast_to(axes, rows.shape)
        self.values[at] = np.where(self.steps[at] < step, 0.0, self.values[at])
        np.add.at(self.values, at, value)
        self.given[at], self.steps[at], self.amplitudes[at] = True, step, amplitude


class Acting(dict[str, Given]):
    """What acts at the end of a step, by cards; IMAGINARY are forces a quarter of a period ahead."""

    def __init__(self, nodes: int, elements: int, bodies: int) -> None:
        self.shapes = {"DLOAD": (elements, 6), "TEMPERATURE": (nodes, 1), "BODIES": (bodies, 1)}
        self.shapes |= dict.fromkeys(("BOUNDARY", "CLOAD", "IMAGINARY"), (nodes, 3))

    def __missing__(self, kind: str) -> Given:
        """Return nothing of a kind; many do not occur in a deck."""
        shape = self.shapes[kind]
        none = np.zeros(shape, dtype=np.int16), np.zeros(shape, dtype=np.int16)
        self[kind] = Given(np.zeros(shape, dtype=bool), np.zeros(shape), *none)
        return self[kind]

    def clear(self, *kinds: str) -> None:
        """Remove what some cards gave."""
        for kind in kinds:
            self.pop(kind, None)

    def settle(self, ends: ArrayLike) -> None:
        """Let amplitudes end at factors, all but those of nan."""
        for one in self.values() if np.size(ends) else ():
            factors = np.append(np.nan, ends)[one.amplitudes]
            over = np.isfinite(factors)
            one.values[over] *= factors[over]
            one.amplitudes[over] = 0


def courses(each: Sequence[Given], none: int = 0) -> tuple[Mask, Ints, list[Ints]]:
    """Return what some step gives, the number of its course, (n, k), and the amplitudes of each course.

    A step that does not give it counts as having the amplitude `none`.
    """
    given = np.any([one.given for one in each], axis=0)
    every = np.stack([np.where(one.given, one.amplitudes, none) for one in each], axis=-1)
    some, numbers = given & every.any(axis=-1), np.zeros(given.shape, dtype=np.int64)
    found, of = np.unique(every[some], axis=0, return_inverse=True)
    numbers[some] = 1 + of.ravel()
    return given, numbers, [np.zeros(len(each), dtype=int), *found]


def read_rows(card: Card, acting: Acting, geometry: Geometry, amplitude: int, step: int) -> None:
    """Read *BOUNDARY, *CLOAD, *DLOAD, *DSLOAD or *TEMPERATURE."""
    with suppress(InputError):  # the line that is wrong is told below
        if card.keyword in ("CLOAD", "DLOAD") and _read_at_once(card, acting, geometry, amplitude, step):
            return
    for row in card.rows():
        _read_row(card, row, acting, geometry, amplitude, step)


def _read_at_once(card: Card, acting: Acting, geometry: Geometry, amplitude: int, step: int) -> bool:
    """Read forces on directions 1 to 3 of nodes, or pressures on faces of elements, if all lines are such."""
    data, count = _FACE.subn(rb",\1,", card.data)
    plain = replace(card, data=data).plain("iir")
    if plain is None or count != (len(plain[0]) if card.keyword == "DLOAD" else 0):
        return False
    (ids, axes), values = plain[0].T, plain[1][:, 0]
    if count:
        rows, axes = geometry.faces(ids, axes - 1, card).T
    elif np.isin(axes, (1, 2, 3)).all() and "LOADCASE" not in card.options:
        rows, axes = geometry.nodes(ids, card), axes - 1
    else:
        return False
    acting[card.keyword].add(rows, axes, values, amplitude, step)
    return True


def _read_row(card: Card, row: Row, acting: Acting, geometry: Geometry, amplitude: int, step: int) -> None:
    """Read a row of such a card."""
    if card.keyword == "BOUNDARY":
        _support(row, acting["BOUNDARY"], geometry, amplitude)
    elif card.keyword == "CLOAD":
        axis, nodes = row.integer(1), geometry.nodes(row.text(0), row)
        if axis in (4, 5, 6):
            nodes = geometry.rotations(nodes, row)
        if axis not in range(1, 7) or not len(nodes):
            row.wrong(f"a force on solids has direction 1, 2 or 3, on reference nodes 1 … 6; got {axis}")
        kind = "IMAGINARY" if card.options.get("LOADCASE") == "2" else "CLOAD"
        acting[kind].add(nodes, (axis - 1) % 3, row.number(2, 0.0), amplitude, step)
    elif card.keyword == "TEMPERATURE":
        nodes = geometry.nodes(row.text(0), row)
        acting["TEMPERATURE"].put(nodes, 0, row.number(1), amplitude)
    elif card.keyword == "DLOAD" and row.text(1).upper() in ("GRAV", "CENTRIF"):
        _body(row, acting["BODIES"], geometry, amplitude, step)
    else:
        faces = _faces(row, card, geometry)
        acting["DLOAD"].add(faces[:, 0], faces[:, 1], row.number(2), amplitude, step)


def _support(row: Row, held: Given, geometry: Geometry, amplitude: int) -> None:
    """Read a row of *BOUNDARY."""
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
    amplitude = amplitude if value else 0
    held.put(rows, slice(first - 1, min(last, 3)), value, amplitude)
    if last > 3:  # rotations, which solids do not have
        turned = geometry.rotations(rows, row)
        held.put(turned, slice(max(first, 4) - 4, min(last, 6) - 3), value, amplitude)


def _body(row: Row, bodies: Given, geometry: Geometry, amplitude: int, step: int) -> None:
    """Read GRAV or CENTRIF."""
    kind = row.text(1).upper()
    size, *places = row.numbers(4 if kind == "GRAV" else 7, 2)
    body, ids = (kind, row.text(0).upper(), tuple(places)), geometry.elements_of(row.text(0), row)
    known = geometry.bodies
    for other in (known[i] for i in np.flatnonzero(bodies.given) if known[i] != body):
        if kind == other[0] == "CENTRIF" and np.isin(ids, geometry.elements_of(other[1])).any():
            row.wrong("an element turns about another axis already, and CalculiX counts one; remove one")
    if body not in known:
        known.append(body)
    bodies.add(np.array([known.index(body)]), 0, size, amplitude, step)


def _faces(row: Row, card: Card, geometry: Geometry) -> Ints:
    """Return the faces (k, 2) of a pressure."""
    kind = row.text(1).upper()
    if card.keyword == "DLOAD":
        return geometry.faces(geometry.elements_of(row.text(0), row), face_number(kind, row, "P"), row)
    if kind != "P":
        row.wrong(f"a load on a surface is P, a pressure; got {row.text(1)}")
    return geometry.surface_faces(row.text(0), row)
