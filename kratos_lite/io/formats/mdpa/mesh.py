"""Nodes, elements, conditions, geometries and parts of an `.mdpa` file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import InputError
from kratos_lite.io.formats.document import MOST, Document, already, repeated_nodes, wrong_nodes
from kratos_lite.io.formats.mdpa.rows import Layout, first_line, read_rows
from kratos_lite.io.formats.mdpa.scan import LISTS, Frame, Source
from kratos_lite.io.formats.mdpa.values import read_values
from kratos_lite.io.names import LINES, SOLIDS, condition_shape, count, element_shape
from kratos_lite.mesh import Block, Mesh, Part, distinct, ids_of, rows_of_ids, without_repeats
from kratos_lite.shapes.faces import FACE_SHAPES
from kratos_lite.typing import Ints

NODES = Layout("node", "irrr", "coordinates", needs="expected id x y z", alone=True)
NO_NODES = "there are no nodes; a 'Begin Nodes' block with rows 'id x y z' is needed"
CELLS = {"Elements": "element", "Conditions": "condition", "Geometries": "geometry"}
PART_NAME = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")
"""Names that may be part of a file name without harm."""
NUMBERS = ("properties", "tables")
"""Kinds of members of which a part keeps the ids, not the rows."""
WORDS = {
    "tables": "table", "properties": "Properties", "nodes": "node", "elements": "element",
    "conditions": "condition", "geometries": "geometry", "constraints": "constraint",
}  # fmt: skip
"""Kinds of members, and one of each."""


def read_mesh(source: Source, frames: dict[str, list[Frame]], properties: Sequence[int]) -> Mesh:
    """Return the mesh of the file, without its parts; elements must use the given properties."""
    before = source.problems.count
    mesh = _read_nodes(source, frames)
    if source.problems.count > before:
        # Every element at a broken node would be one more problem without a cause of its own.
        source.problems.raise_if_any()
    blocks = read_blocks(source, frames["Elements"], mesh)
    conditions = read_blocks(source, frames["Conditions"], mesh)
    _check_properties(source, blocks, "element", properties)
    _check_properties(source, conditions, "condition", properties)
    return mesh.replace(blocks=blocks, conditions=conditions)


def _read_nodes(source: Source, frames: dict[str, list[Frame]]) -> Mesh:
    tables = [read_rows(source, frame.spans[0], NODES) for frame in frames["Nodes"]]
    ids = np.concatenate([np.zeros(0, dtype=np.int64), *(t.ints[:, 0] for t in tables)])
    points = np.concatenate([np.zeros((0, 3)), *(t.reals for t in tables)])
    lines = np.concatenate([np.zeros(0, dtype=np.int32), *(t.lines for t in tables)])
    if not len(ids) and not source.problems:
        cells = [span for kind in CELLS for frame in frames[kind] for span in frame.spans]
        if not any(frames.values()) or any(next(source.words(span), None) for span in cells):
            raise InputError(f"{source.name}: {NO_NODES}")
    keep = np.ones(len(ids), dtype=bool)
    for row, text, is_same in repeated_nodes(ids, points, lines):
        keep[row] = False
        (source.note_in_line if is_same else source.problem_in_line)(text, int(lines[row]))
    if not keep.all():
        points, ids = points[keep], ids[keep]
    return Mesh(points, node_ids=ids, source=source.name)


def read_blocks(source: Source, frames: list[Frame], mesh: Mesh) -> list[Block]:
    """Return the blocks of elements, conditions or geometries; their nodes must be in the mesh."""
    # Empty blocks, of which some programs write one for each kind they know, say nothing and are left out.
    blocks = [block for frame in frames if len(block := _read_block(source, frame, mesh))]
    if blocks:
        lines = np.concatenate([block.lines for block in blocks if block.lines is not None])
        source.refuse_repeated(CELLS[frames[0].name], ids_of(blocks), lines)
    return blocks


def _read_block(source: Source, frame: Frame, mesh: Mesh) -> Block:
    name, word = frame.arguments[0], CELLS[frame.name]
    head = 1 if word == "geometry" else 2
    width = _width_of(frame.name, name)
    needs, is_known = f"{name} needs {width}", width is not None
    if width is None:
        width = max(len(first_line(source, frame.spans[0]).split()) - head, 0)
        needs = f"the first {word} of the block has {width}"
    layout = Layout(word, "ip"[:head] + "i" * width, "nodes", head, needs, alone=not is_known)
    rows = read_rows(source, frame.spans[0], layout)
    ids, properties = rows.ints[:, 0], rows.ints[:, 1] if head == 2 else 0
    nodes = mesh.node_rows(rows.ints[:, head:])
    shape = {"element": element_shape, "condition": condition_shape}.get(word, lambda _: None)(name)
    wrong = list(wrong_nodes(rows.ints[:, head:], nodes))
    is_solved = name in ELEMENTS if word == "element" else shape is not None
    if wrong and nodes.min() >= 0 and not is_solved:  # it may name a node twice, as in Kratos
        more = f" (and {len(wrong) - 1} more {word}s)" if len(wrong) > 1 else ""
        text = f"{word} {ids[wrong[0][0]]}{more} of {name} names a node twice; it is kept, but not used"
        source.note_in_line(text, int(rows.lines[wrong[0][0]]))
        wrong = []
    for row, text in wrong:
        source.problem_in_line(f"{word} {ids[row]} ({name}){text}", int(rows.lines[row]))
    return Block(name, np.maximum(nodes, 0), ids, properties, shape, rows.lines)


def _width_of(kind: str, name: str) -> int | None:
    """Return the number of nodes that a name promises, or None if only the rows can tell."""
    if kind == "Geometries":
        match = re.search(r"\dD(\d{1,3})N?$", name)
        return int(match.group(1)) if match else None
    width = count(name)
    return width if width in (SOLIDS if kind == "Elements" else (*FACE_SHAPES, *LINES)) else None


def _check_properties(source: Source, blocks: list[Block], word: str, declared: Sequence[int]) -> None:
    for block in blocks:
        for number in distinct(block.properties):
            if number not in declared:
                users = block.take(block.properties == number)
                more = f" (and {len(users) - 1} more {word}s)" if len(users) > 1 else ""
                text = f"{word} {users.ids[0]}{more} uses Properties {number}, which the file does not have"
                cure = f"add 'Begin Properties {number}' … 'End Properties'"
                assert users.lines is not None
                source.problem_in_line(f"{text}; {cure}", int(users.lines[0]))


def member_ids(document: Document) -> dict[str, Ints]:
    """Return the ids of all nodes, elements, … that parts list, in the order of their rows."""
    mesh, numbers = document.mesh, (document.properties, document.tables)
    lists = [[c.id for c in document.constraints], *map(list, numbers)]
    return {
        "nodes": mesh.node_ids,
        "elements": mesh.element_ids,
        "conditions": ids_of(mesh.conditions),
        "geometries": ids_of(document.geometries),
        **{kind: np.array(ids, np.int64) for kind, ids in zip(("constraints", *NUMBERS), lists, strict=True)},
    }


class PartReader:
    """Read the parts of a file; `ids` are those of all members that it has."""

    def __init__(self, source: Source, ids: dict[str, Ints]) -> None:
        self.source = source
        self.ids = ids
        self.order = {kind: np.argsort(values, kind="stable") for kind, values in ids.items()}
        self.lines: dict[str, int] = {}
        self.data: dict[str, dict[str, Any]] = {}
        self.members: dict[str, dict[str, list[Ints]]] = {}  # of each part, by kind

    def read(self, frames: list[Frame]) -> dict[str, Part]:
        """Return all parts by their full names, parents before their children."""
        for frame in frames:
            self._read(frame, "")
        parts = {}
        for name, members in self.members.items():
            fields: dict[str, Any] = {
                kind: without_repeats(np.concatenate(lists)) for kind, lists in members.items()
            }
            fields |= {kind: tuple(fields[kind].tolist()) for kind in NUMBERS if kind in fields}
            parts[name] = Part(**fields, data=self.data.get(name, {}))
        return parts

    def _read(self, frame: Frame, parent: str) -> None:
        name = frame.arguments[0]
        if not PART_NAME.fullmatch(name):
            text = f"SubModelPart {name!r} is no name; use letters, digits, '_', '-' and single dots inside"
            self.source.problem(text, frame.offset)
            return
        full = f"{parent}.{name}" if parent else name
        if full in self.lines:
            text = already(f"SubModelPart {full}", self.lines[full], "; give each part its own name")
            self.source.problem(text, frame.offset)
            return
        self.lines[full] = self.source.line(frame.offset)
        for ancestor in chain_of(full):
            self.members.setdefault(ancestor, {})
        for child in frame.children:
            if child.name == "SubModelPart":
                self._read(child, full)
            elif child.name == "SubModelPartData":
                self.data.setdefault(full, {}).update(read_values(self.source, child.spans)[0])
            elif child.name in LISTS:
                self._add(child, child.name.removeprefix("SubModelPart").lower(), full)
            else:
                text = f"unknown block {child.name} in SubModelPart {full} is skipped"
                self.source.note(text, child.offset)

    def _add(self, child: Frame, kind: str, full: str) -> None:
        """Add the members in a list of ids to a part and to all its ancestors."""
        read = read_rows(self.source, child.spans[0], Layout("id", "p" if kind in NUMBERS else "i"))
        ids = read.ints[:, 0]
        rows = rows_of_ids(self.ids[kind], ids, self.order[kind])
        exists = rows >= 0
        report = self.source.note_in_line if kind in NUMBERS else self.source.problem_in_line
        for i in np.flatnonzero(~exists)[:MOST]:
            text = f"SubModelPart {full} lists {WORDS[kind]} {ids[i]}, which the file does not have"
            report(text, int(read.lines[i]))
        for ancestor in chain_of(full) if len(ids) else ():
            self.members[ancestor].setdefault(kind, []).append((ids if kind in NUMBERS else rows)[exists])


def chain_of(full: str) -> list[str]:
    """Return the full names of a part and of its ancestors, the outermost first."""
    words = full.split(".")
    return [".".join(words[:i]) for i in range(1, len(words) + 1)]
