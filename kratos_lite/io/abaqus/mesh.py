"""Nodes, elements, sets and surfaces of a deck, and the mesh that they are."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import InputError, nearest
from kratos_lite.io.abaqus.cards import Card, Row
from kratos_lite.mesh import NO_ROWS, Block, Mesh, Part, distinct, ids_of, mask_of, rows_of_ids, select
from kratos_lite.shapes import Shape
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


@dataclass
class Surface:
    """A surface: faces of elements, or nodes."""

    elements: Ints = field(default_factory=NO_ROWS.copy)  # ids
    faces: Ints = field(default_factory=NO_ROWS.copy)  # from 0
    nodes: Ints | None = None  # ids


class MeshCards:
    """What the cards of a deck say about its mesh; names of sets are in capitals."""

    def __init__(self) -> None:
        self.node_cards: list[tuple[Ints, Array]] = []
        self.cells: list[Cells] = []
        self.others: list[Cells] = []  # springs, masses, …
        self.node_sets: dict[str, list[Ints]] = {}
        self.element_sets: dict[str, list[Ints]] = {}
        self.surfaces: dict[str, Surface] = {}
        self.rotation: dict[int, int] = {}  # ids of reference nodes, and of those that are their rotations
        self.rigid: set[int] = set()  # those of rigid bodies
        self.masses: list[tuple[Ints, Ints, float]] = []  # ids of elements, rows of nodes, kg
        self.twin: Ints  # the row of the node of which each is a copy

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
            self.node_sets.setdefault(card.option("NSET").upper(), []).append(ids)

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
        table = card.ids(1 + width)
        cells = Cells(kind, table[:, 0], table[:, 1:], card.place)
        (self.cells if kind in ELEMENT_TYPES else self.others).append(cells)
        if "ELSET" in card.options:
            self.element_sets.setdefault(card.option("ELSET").upper(), []).append(cells.ids)

    def nset(self, card: Card) -> None:
        """Read *NSET."""
        card.check_options(("NSET", "GENERATE", "ELSET"))
        if "ELSET" in card.options:
            found = self.nodes_of_elements(self.elements_of(card.option("ELSET"), card))
            self.node_sets.setdefault(card.option("NSET").upper(), []).append(found)
        else:
            self._add(card, self.node_sets, "NSET")

    def elset(self, card: Card) -> None:
        """Read *ELSET."""
        card.check_options(("ELSET", "GENERATE"))
        self._add(card, self.element_sets, "ELSET")

    def _add(self, card: Card, sets: dict[str, list[Ints]], kind: str) -> None:
        members = sets.setdefault(card.option(kind).upper(), [])
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
                    members.append(self.members(word, sets, row, kind))

    def surface(self, card: Card) -> None:
        """Read *SURFACE."""
        card.check_options(("NAME", "TYPE"))
        new = Surface()
        of_nodes = card.option("TYPE", "ELEMENT").upper() == "NODE"
        for row in card.rows():
            if of_nodes:
                found = self.nodes_of(row.text(0), row)
                new.nodes = found if new.nodes is None else np.concatenate([new.nodes, found])
                continue
            ids = self.elements_of(row.text(0), row)
            new.elements = np.concatenate([new.elements, ids])
            new.faces = np.concatenate([new.faces, np.full(len(ids), face_number(row.text(1), row))])
        self.surfaces[card.option("NAME").upper()] = new

    def members(self, name: str, sets: dict[str, list[Ints]], at: Row | Card | None, kind: str) -> Ints:
        """Return the ids in a set."""
        if (found := sets.get(name.upper())) is None:
            assert at is not None
            at.wrong(f"there is no {kind} {name!r}.{nearest(name.upper(), sets)}")
        return np.concatenate([NO_ROWS, *found])

    def nodes_of(self, word: str, at: Row | Card) -> Ints:
        """Return the ids of nodes that a number or the name of a set means."""
        return np.array([int(word)]) if word.isdigit() else self.members(word, self.node_sets, at, "NSET")

    def elements_of(self, word: str, at: Row | Card | None = None) -> Ints:
        """Return the ids of elements of a number or the name of a set; `at` may lack if it is known."""
        return np.array([int(word)]) if word.isdigit() else self.members(word, self.element_sets, at, "ELSET")

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
        ref, rotation = map(int, words)
        self.rotation[ref] = rotation or self.rotation.get(ref, 0)
        if card.keyword == "RIGIDBODY":
            self.rigid.add(ref)

    def _rotations(self, ids: Ints, points: Array) -> tuple[Ints, Array]:
        """Return ids and places of all nodes, with further ones where reference nodes have no ROT NODE."""
        new = np.array([ref for ref, rotation in self.rotation.items() if not rotation], dtype=np.int64)
        at = rows_of_ids(ids, new)
        more = ids.max() + 1 + np.arange(len(new))
        self.rotation |= dict(zip(new.tolist(), more.tolist(), strict=True))
        return np.append(ids, more), np.vstack([points, points[at]])

    def mesh(self, source: str) -> Mesh:
        """Return the mesh with a part for each set; solids alone are its elements."""
        if not self.node_cards or not self.cells:
            what = "*NODE" if not self.node_cards else "*ELEMENT with solids"
            raise InputError(f"{source}: there is no card {what}")
        ids = np.concatenate([c[0] for c in self.node_cards])
        points = np.concatenate([c[1] for c in self.node_cards])
        ids, last = _last(ids)
        ids, points = self._rotations(ids, points[last])
        for found in self.node_sets.values():
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
            blocks.append(Block(name, rows[:, order], cells.ids))
        return Mesh(points, blocks, node_ids=ids, source=source, parts=self._parts(ids, blocks))

    def _parts(self, ids: Ints, blocks: list[Block]) -> dict[str, Part]:
        """Return the sets as parts; one of nodes and one of elements of the same name are one part."""
        parts, of_elements = {}, ids_of(blocks)
        for name in dict.fromkeys([*self.node_sets, *self.element_sets]):
            nodes = np.concatenate([NO_ROWS, *self.node_sets.get(name, [])])
            cells = np.concatenate([NO_ROWS, *self.element_sets.get(name, [])])
            rows = rows_of_ids(ids, distinct(nodes))
            elements = rows_of_ids(of_elements, distinct(cells))
            elements = elements[elements >= 0]  # springs and masses are no elements of the mesh
            if len(elements) and not len(rows):
                found = [block.nodes.ravel() for block in select(blocks, elements)]
                rows = np.flatnonzero(mask_of(np.concatenate(found), len(ids)))
            if len(rows) or len(elements):
                parts[name] = Part(nodes=rows, elements=elements)
        return parts


def _last(ids: Ints) -> tuple[Ints, Ints]:
    """Return the ids, each once, and where each stands last; a node may be defined again, as in CalculiX."""
    if (np.diff(ids) > 0).all():
        return ids, np.arange(len(ids))
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
