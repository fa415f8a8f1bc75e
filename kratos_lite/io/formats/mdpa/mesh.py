"""Nodes, elements, conditions and geometries of an `.mdpa` file."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.io.formats.cells import already, repeated, repeated_nodes, wrong_nodes
from kratos_lite.io.formats.mdpa.rows import Layout, first_line, read_rows
from kratos_lite.io.formats.mdpa.scan import Frame, Source
from kratos_lite.io.names import LINES, SOLIDS, condition_shape, count, element_shape
from kratos_lite.mesh import Block, Mesh, distinct, ids_of
from kratos_lite.shapes.faces import FACE_SHAPES

NODES = Layout("node", "irrr", "coordinates", needs="expected id x y z", alone=True)
WORDS = {"Elements": "element", "Conditions": "condition", "Geometries": "geometry"}


def read_mesh(source: Source, frames: dict[str, list[Frame]], properties: Sequence[int]) -> Mesh:
    """Return the mesh of the file, without its parts; elements must use the given properties."""
    before = source.problems.count
    mesh = _read_nodes(source, frames["Nodes"])
    if source.problems.count > before:
        # Every element at a broken node would be one more problem without a cause of its own.
        source.problems.raise_if_any()
    blocks = read_blocks(source, frames["Elements"], mesh)
    conditions = read_blocks(source, frames["Conditions"], mesh)
    for word, checked in (("element", blocks), ("condition", conditions)):
        _check_properties(source, checked, word, properties)
    return mesh.replace(blocks=blocks, conditions=conditions)


def _read_nodes(source: Source, frames: list[Frame]) -> Mesh:
    tables = [read_rows(source, frame.spans[0], NODES) for frame in frames]
    ids = np.concatenate([np.zeros(0, dtype=np.int64), *(t.ints[:, 0] for t in tables)])
    points = np.concatenate([np.zeros((0, 3)), *(t.reals for t in tables)])
    lines = np.concatenate([np.zeros(0, dtype=np.int32), *(t.lines for t in tables)])
    if not len(ids) and not source.problems:
        raise InputError(
            f"{source.name}: there are no nodes; a 'Begin Nodes' block with rows 'id x y z' is needed"
        )
    keep = np.ones(len(ids), dtype=bool)
    for row, text, is_same in repeated_nodes(ids, points, lines):
        keep[row] = False
        (source.note_in_line if is_same else source.problem_in_line)(text, int(lines[row]))
    if not keep.all():
        points, ids = points[keep], ids[keep]
    return Mesh(points, node_ids=ids, source=source.name)


def read_blocks(source: Source, frames: list[Frame], mesh: Mesh) -> list[Block]:
    """Return the blocks of elements, conditions or geometries; their nodes must be in the mesh.

    Empty blocks, of which some programs write one for each kind they know, say nothing and are left out.
    """
    blocks = [block for frame in frames if len(block := _read_block(source, frame, mesh))]
    if blocks:
        _refuse_repeated(source, blocks, WORDS[frames[0].name])
    return blocks


def _read_block(source: Source, frame: Frame, mesh: Mesh) -> Block:
    name, word = frame.arguments[0], WORDS[frame.name]
    head = 1 if word == "geometry" else 2
    width = _width_of(frame.name, name)
    known = width is not None
    if width is None:
        width = max(len(first_line(source, frame.spans[0]).split()) - head, 0)
    needs = f"{name} needs {width}" if known else f"the first {word} of the block has {width}"
    layout = Layout(word, "ip"[:head] + "i" * width, "nodes", head, needs, alone=not known)
    rows = read_rows(source, frame.spans[0], layout)
    ids = rows.ints[:, 0] if len(rows.ints) else np.zeros(0, dtype=np.int64)
    nodes = mesh.node_rows(rows.ints[:, head:]).reshape(len(ids), width)
    for row, text in wrong_nodes(rows.ints[:, head:], nodes):
        source.problem_in_line(f"{word} {ids[row]} ({name}){text}", int(rows.lines[row]))
    properties = rows.ints[:, 1] if head == 2 and len(ids) else np.zeros(len(ids), dtype=np.int64)
    shape = {"element": element_shape, "condition": condition_shape}.get(word, lambda _: None)(name)
    return Block(name, np.maximum(nodes, 0), ids, properties, shape, rows.lines)


def _width_of(kind: str, name: str) -> int | None:
    """Return the number of nodes that a name promises, or None if only the rows can tell."""
    if kind == "Geometries":
        match = re.search(r"\dD(\d{1,3})N?$", name)
        return int(match.group(1)) if match else None
    width = count(name)
    return width if width in (SOLIDS if kind == "Elements" else (*FACE_SHAPES, *LINES)) else None


def _refuse_repeated(source: Source, blocks: list[Block], word: str) -> None:
    ids = ids_of(blocks)
    lines = np.concatenate([block.lines for block in blocks if block.lines is not None])
    for row, first in repeated(ids):
        text = already(f"{word} {ids[row]}", lines[first], f"; give each {word} its own id")
        source.problem_in_line(text, int(lines[row]))


def _check_properties(source: Source, blocks: list[Block], word: str, declared: Sequence[int]) -> None:
    for block in blocks:
        for number in distinct(block.properties):
            if number in declared:
                continue
            rows = np.flatnonzero(block.properties == number)
            more = f" (and {len(rows) - 1} more {word}s)" if len(rows) > 1 else ""
            assert block.lines is not None
            source.problem_in_line(
                f"{word} {block.ids[rows[0]]}{more} uses Properties {number}, which the file does not have; "
                f"add 'Begin Properties {number}' … 'End Properties'",
                int(block.lines[rows[0]]),
            )
