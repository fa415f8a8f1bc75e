"""Nodes, elements, sets and surfaces of a deck, and the mesh that they are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import InputError, nearest
from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.mesh import (
    NO_ROWS,
    Block,
    Mesh,
    Part,
    distinct,
    ids_of,
    mask_of,
    rows_of_ids,
    select,
    with_rows,
)
from kratos_lite.shapes import Shape
from kratos_lite.shapes.faces import FACE_SHAPES
from kratos_lite.typing import Array, Ints

ELEMENT_TYPES = {
    "C3D4": "KinematicLinear3D4N", "C3D6": "KinematicLinear3D6N", "C3D8": "KinematicLinear3D8N",
    "C3D8I": "EnhancedStrain3D8N", "C3D10": "KinematicLinear3D10N", "C3D15": "KinematicLinear3D15N",
    "C3D20": "KinematicLinear3D20N", "C3D20R": "Reduced3D20N",
}  # fmt: skip
"""Our element of each solid of CalculiX."""
FINITE = {
    name: f"TotalLagrangianElement3D{kind[3:].rstrip('R')}N"
    for kind, name in ELEMENT_TYPES.items()
    if kind != "C3D8I"
}
"""The element of each of these where displacements are large (NLGEOM)."""
FACES = {
    "tetrahedron": ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)),
    "wedge": ((0, 1, 2), (3, 4, 5), (0, 1, 3, 4), (1, 2, 4, 5), (0, 2, 3, 5)),
    "hexahedron": (
        (0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 4, 5), (1, 2, 5, 6), (2, 3, 6, 7), (0, 3, 4, 7),
    ),
}  # fmt: skip
"""Corners of the faces S1, S2, … of each cell."""


@dataclass
class Cells:
    """Elements of one *ELEMENT card."""

    kind: str
    ids: Ints
    nodes: Ints  # (m, k) ids
    place: str


class Geometry:
    """What the cards of a deck say of nodes, elements, sets and surfaces, and the mesh that they are."""

    # Names of sets are in capitals; the mesh is there once all cards are read.
    mesh: Mesh
    twin: Ints  # the row of the node of which each is a copy

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.node_cards: list[tuple[Ints, Array]] = []
        self.cells: list[Cells] = []
        self.others: list[Cells] = []  # springs, masses, …
        self.sets: dict[str, dict[str, list[Ints]]] = {"NSET": {}, "ELSET": {}}  # ids
        self._surfaces: dict[str, Card] = {}
        self.surfaces: dict[str, Ints] = {}  # rows of nodes, or faces (k, 2): rows of elements, face from 0
        # By the cards that name them, ids of a reference node and of the node that is its rotation.
        self.references: dict[str, tuple[int, int]] = {}
        self.rigid: set[int] = set()  # those of rigid bodies
        self.masses: list[tuple[Ints, Ints, float]] = []  # ids of elements, rows of nodes, kg
        self.bodies: list[
            tuple[str, str, tuple[float, ...]]
        ] = []  # GRAV or CENTRIF, ELSET, direction or axis

    def node(self, card: Card) -> None:
        """Read *NODE."""
        card.check_options(("NSET",))
        if plain := card.plain("irrr"):
            ids, points = plain[0].ravel(), plain[1]
        else:
            for row in card.rows():
                if len(row.fields) > 4:
                    row.wrong(f"a node has an id and three coordinates; got {len(row.fields)} values")
            rows = [[row.integer(0), *(row.number(i, 0.0) for i in (1, 2, 3))] for row in card.rows()]
            ids = np.array([row[0] for row in rows], dtype=np.int64)
            points = np.array([row[1:] for row in rows]).reshape(-1, 3)
        if (ids < 1).any():
            card.wrong(f"ids of nodes are whole numbers from 1; got {ids[ids < 1][0]}")
        self.node_cards.append((ids, points))
        if "NSET" in card.options:
            self._members(card, "NSET").append(ids)

    def element(self, card: Card) -> None:
        """Read *ELEMENT."""
        card.check_options(("TYPE", "ELSET"))
        kind = card.option("TYPE").upper()
        width = {"SPRINGA": 2, "SPRING2": 2, "SPRING1": 1, "MASS": 1, "DCOUP3D": 1}.get(kind)
        if width is None and kind not in ELEMENT_TYPES:
            solids = ", ".join(ELEMENT_TYPES)
            card.wrong(f"element {kind} is not supported.{nearest(kind, ELEMENT_TYPES)} There are {solids}")
        if width is None:
            width = len(ELEMENTS[ELEMENT_TYPES[kind]].shape.nodes)
        table = card.ids(1 + width, self.notes)
        cells = Cells(kind, table[:, 0], table[:, 1:], card.place)
        (self.cells if kind in ELEMENT_TYPES else self.others).append(cells)
        if "ELSET" in card.options:
            self._members(card, "ELSET").append(cells.ids)

    def named_set(self, card: Card) -> None:
        """Read *NSET or *ELSET."""
        kind = card.keyword
        card.check_options((kind, "GENERATE", "ELSET"))
        members = self._members(card, kind)
        if kind == "NSET" and "ELSET" in card.options:
            members.append(self.nodes_of_elements(self.elements_of(card.option("ELSET"), card)))
            return
        if "GENERATE" in card.options:
            for row in card.rows():
                first, last, step = row.integer(0), row.integer(1, row.integer(0)), row.integer(2, 1)
                if step < 1 or last < first:
                    row.wrong(f"{first} to {last} by {step} is no range; give first, last, step")
                members.append(np.arange(first, last + 1, step))
            return
        if not any(byte > 57 for byte in card.data):  # digits, commas and blanks alone
            members.append(card.ids(1).ravel())
            return
        for row in card.rows():
            for i, word in enumerate(row.fields):
                if word.isdigit():
                    members.append(np.array([row.integer(i)]))
                elif word:
                    members.append(self.ids_of(word, row, kind))

    def _members(self, card: Card, kind: str) -> list[Ints]:
        """Return the list of members of the set that a card names."""
        return self.sets[kind].setdefault(card.option(kind).upper(), [])

    def surface(self, card: Card) -> None:
        """Read *SURFACE."""
        card.check_options(("NAME", "TYPE"))
        self._surfaces[card.option("NAME").upper()] = card

    def ids_of(self, word: str, at: Row | Card | None, kind: str) -> Ints:
        """Return the ids that a number or the name of a set means; `at` may lack if it is known."""
        if word.isdigit():
            return np.array([int(word)])
        if (found := self.sets[kind].get(word.upper())) is None:
            assert at is not None
            at.wrong(f"there is no {kind} {word!r}.{nearest(word.upper(), self.sets[kind])}")
        return np.concatenate([NO_ROWS, *found])

    def elements_of(self, word: str, at: Row | Card | None = None) -> Ints:
        """Return the ids of elements of a number or the name of a set."""
        return self.ids_of(word, at, "ELSET")

    def nodes(self, word: str | Ints, at: Row | Card) -> Ints:
        """Return the rows of nodes of some ids, or that a number or the name of a set means."""
        ids = self.ids_of(word, at, "NSET") if isinstance(word, str) else word
        rows = self.mesh.node_rows(ids)
        if (rows < 0).any():
            at.wrong(f"there is no node {ids[rows < 0][0]}")
        return rows

    def rotations(self, rows: Ints, row: Row) -> Ints:
        """Return the nodes whose displacements are the rotations of reference nodes among some nodes."""
        rotation = dict(self.references.values())  # of several of a node the last, as in CalculiX
        known = np.array(list(rotation), dtype=np.int64)
        refs = known[np.isin(known, self.mesh.node_ids[rows])].tolist()
        if alone := set(refs) & self.rigid:
            row.wrong(
                f"rotations of the rigid body of node {min(alone)} are directions 1, 2, 3 of its ROT NODE"
            )
        return self.mesh.node_rows(np.array([rotation[ref] for ref in refs], dtype=np.int64))

    def _surface(self, card: Card) -> Ints:
        """Return the nodes or faces of a surface."""
        if card.option("TYPE", "ELEMENT").upper() == "NODE":
            return np.concatenate([NO_ROWS, *(self.nodes(row.text(0), row) for row in card.rows())])
        found = [
            self.faces(self.elements_of(row.text(0), row), face_number(row.text(1), row), row)
            for row in card.rows()
        ]
        return np.concatenate([NO_ROWS.reshape(0, 2), *found])

    def surface_faces(self, name: str, at: Row | Card) -> Ints:
        """Return the faces (k, 2) of a surface."""
        if (found := self.surfaces.get(name.upper())) is None or found.ndim == 1:
            at.wrong(f"there is no *SURFACE {name} of faces")
        return found

    def surface_blocks(self, name: str, at: Row | Card) -> list[Block]:
        """Return the faces of a surface with their nodes."""
        faces = self.surface_faces(name, at)
        return list(with_faces(self.mesh.replace(conditions=()), faces, "SurfaceCondition")[0].conditions)

    def surface_nodes(self, name: str, at: Row | Card) -> Ints:
        """Return the nodes of a surface."""
        found = self.surfaces.get(name.upper())
        if found is not None and found.ndim == 1:
            return np.unique(found)
        return np.unique(np.concatenate([block.nodes.ravel() for block in self.surface_blocks(name, at)]))

    def faces(self, ids: Ints, numbers: int | Ints, at: Row | Card) -> Ints:
        """Return the faces of some elements by their numbers from 0, (k, 2)."""
        known, order, sides = self._elements
        rows = rows_of_ids(known, ids, order)
        if (rows < 0).any():
            at.wrong(f"there is no solid element {ids[rows < 0][0]}")
        if ((found := sides[rows, numbers]) < 0).any():
            i = np.argmin(found)
            number = np.broadcast_to(numbers, rows.shape)[i] + 1
            at.wrong(f"element {ids[i]} has {(sides[rows[i]] >= 0).sum()} faces; got number {number}")
        return np.column_stack([rows, found])

    @cached_property
    def _elements(self) -> tuple[Ints, Ints, Ints]:
        """Ids of elements, their order, and their faces (m, 6) by Abaqus's numbers, or -1."""
        sides = np.full((self.mesh.n_elements, 6), -1)
        for block, at in with_rows(self.mesh.blocks):
            ours = face_rows(block.known_shape)
            sides[at, : len(ours)] = ours
        return self.mesh.element_ids, np.argsort(self.mesh.element_ids, kind="stable"), sides

    def nodes_of_elements(self, members: Ints) -> Ints:
        """Return the ids of the nodes of solids."""
        found = [c.nodes[np.isin(c.ids, members)].ravel() for c in self.cells]
        return np.unique(np.concatenate([NO_ROWS, *found]))

    def masses_of(self, elements: Ints | None = None) -> Array:
        """Return the masses (n,) in kg at nodes, of all elements or of some ids."""
        masses = np.zeros(len(self.twin))
        for ids, nodes, mass in self.masses:
            np.add.at(masses, nodes if elements is None else nodes[np.isin(ids, elements)], mass)
        return masses

    def reference(self, card: Card) -> None:
        """Note the reference node of *RIGID BODY or *COUPLING, and the node of its rotations, or 0."""
        words = card.option("REFNODE"), card.option("ROTNODE", "0")
        if not all(word.isdigit() for word in words):
            card.wrong(f"REF NODE and ROT NODE are numbers of nodes; got {', '.join(words)}")
        self.references[card.place] = int(words[0]), int(words[1])
        if card.keyword == "RIGIDBODY":
            self.rigid.add(int(words[0]))

    def _rotations(self, ids: Ints, points: Array) -> tuple[Ints, Array]:
        """Return ids and places of all nodes, with further ones where reference nodes have no ROT NODE."""
        new = [(place, ref) for place, (ref, rotation) in self.references.items() if not rotation]
        refs = np.array([ref for _, ref in new], dtype=np.int64)
        at, more = rows_of_ids(ids, refs), ids.max(initial=0) + 1 + np.arange(len(new))
        self.references |= {place: (ref, i) for (place, ref), i in zip(new, more.tolist(), strict=True)}
        return np.append(ids, more), np.vstack([points, points[at]])

    def build(self, source: str) -> None:
        """Make the mesh with a part for each set; solids alone are its elements."""
        if not self.node_cards or not self.cells:
            what = "*NODE" if not self.node_cards else "*ELEMENT with solids"
            raise InputError(f"{source}: there is no card {what}")
        ids = np.concatenate([c[0] for c in self.node_cards])
        points = np.concatenate([c[1] for c in self.node_cards])
        ids, last = _last(ids)
        ids, points = self._rotations(ids, points[last])
        for found in self.sets["NSET"].values():
            found[:] = [nodes[rows_of_ids(ids, nodes) >= 0] for nodes in found]  # a range may skip nodes
        blocks = []
        for cells in self.cells:
            name = ELEMENT_TYPES[cells.kind]
            shape = ELEMENTS[name].shape
            rows = rows_of_ids(ids, cells.nodes)
            if (rows < 0).any():
                i, j = np.argwhere(rows < 0)[0]
                text = f"element {cells.ids[i]} names node {cells.nodes[i, j]}, which is not there"
                raise InputError(f"{cells.place}: {text}")
            order = np.argsort(shape.to_vtk)
            blocks.append(Block(name, rows if (np.diff(order) == 1).all() else rows[:, order], cells.ids))
        self.mesh = Mesh(points, blocks, node_ids=ids, source=source, parts=self._parts(ids, blocks))
        self.twin = np.arange(len(ids))
        self.surfaces = {name: self._surface(card) for name, card in self._surfaces.items()}

    def _parts(self, ids: Ints, blocks: list[Block]) -> dict[str, Part]:
        """Return the sets as parts; one of nodes and one of elements of the same name are one part."""
        parts, of_elements = {}, ids_of(blocks)
        for name in dict.fromkeys([*self.sets["NSET"], *self.sets["ELSET"]]):
            nodes = np.concatenate([NO_ROWS, *self.sets["NSET"].get(name, [])])
            cells = np.concatenate([NO_ROWS, *self.sets["ELSET"].get(name, [])])
            rows, elements = distinct(rows_of_ids(ids, nodes)), distinct(rows_of_ids(of_elements, cells))
            elements = elements[elements >= 0]  # springs and masses are no elements of the mesh
            if len(elements) and not len(rows):
                found = [block.nodes.ravel() for block in select(blocks, elements)]
                rows = np.flatnonzero(mask_of(np.concatenate(found), len(ids)))
            if len(rows) or len(elements):
                parts[name] = Part(nodes=rows, elements=elements)
        return parts


def _last(ids: Ints) -> tuple[Ints, Ints | slice]:
    """Return the ids, each once, and where each stands last; a node may be defined again, as in CalculiX."""
    if (np.diff(ids) > 0).all():
        return ids, slice(None)
    found, first = np.unique(ids[::-1], return_index=True)
    return found, len(ids) - 1 - first


def face_number(word: str, row: Row, letters: str = "SP") -> int:
    """Return the number from 0 of a face such as S1 or P1."""
    if len(word) == 2 and word[0].upper() in letters and word[1] in "123456":
        return int(word[1]) - 1
    row.wrong(f"a face is {letters[0]}1, {letters[0]}2, … {letters[0]}6; got {word!r}")


def face_rows(shape: type[Shape]) -> list[int]:
    """Return which of our faces each face S1, S2, … of a cell is."""
    ours = [frozenset(n for n in face if n < shape.corners) for face in shape.faces]
    return [ours.index(frozenset(face)) for face in FACES[shape.cell]]


def with_faces(mesh: Mesh, faces: Ints, name: str) -> tuple[Mesh, Ints]:
    """Return the mesh with conditions on faces (k, 2), and the face of each."""
    conditions, found = list[Block](), [faces[:0]]
    for block, at in with_rows(mesh.blocks):
        of = np.unique(faces[(faces[:, 0] >= at.start) & (faces[:, 0] < at.stop)], axis=0)
        for number, places in enumerate(block.known_shape.faces):
            some = of[of[:, 1] == number]
            ids = 1 + sum(map(len, conditions)) + np.arange(len(some))
            nodes, shape = block.nodes[some[:, 0] - at.start][:, list(places)], FACE_SHAPES[len(places)]
            conditions += [Block(f"{name}3D{len(places)}N", nodes, ids, shape=shape)] * bool(len(some))
            found.append(some)
    return mesh.replace(conditions=conditions) if conditions else mesh, np.concatenate(found)
