"""Read Kratos model files, `.mdpa`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.errors import nearest
from kratos_lite.io.formats.cells import already, repeated
from kratos_lite.io.formats.document import Document, Properties
from kratos_lite.io.formats.mdpa.data import read_data
from kratos_lite.io.formats.mdpa.mesh import read_blocks, read_mesh
from kratos_lite.io.formats.mdpa.parts import PartReader
from kratos_lite.io.formats.mdpa.scan import TOP, Frame, Source, scan
from kratos_lite.io.formats.mdpa.values import Table, read_table, read_values
from kratos_lite.io.text import blank_comments, integer, read_bytes
from kratos_lite.mesh import ids_of
from kratos_lite.typing import Ints


def read_mdpa(path: str | Path, *, strict: bool = True) -> Document:
    r"""Return all that an `.mdpa` file says; `strict` wants rows on lines of their own, unlike Kratos.

    >>> path = getfixture("tmp_path") / "one.mdpa"
    >>> _ = path.write_text("Begin Nodes\n 7 0.0 0.5 1.0D+00 // top\nEnd Nodes\n")
    >>> document = read_mdpa(path)
    >>> document.mesh.node_ids, document.mesh.points
    (array([7]), array([[0. , 0.5, 1. ]]))
    """
    source = Source(str(path), blank_comments(read_bytes(path), str(path)), strict)
    frames: dict[str, list[Frame]] = {name: [] for name in TOP}
    for frame in scan(source).children:
        if frame.name in frames and frame.name != "Mesh":
            frames[frame.name].append(frame)
        else:
            hint = "" if frame.name in TOP else nearest(frame.name, TOP)
            source.note(f"block {frame.name} is skipped.{hint}", frame.offset)
    document = _read(source, frames)
    source.problems.raise_if_any()
    document.notes = sorted(dict.fromkeys(source.notes), key=lambda note: note.line)
    return document


def _read(source: Source, frames: dict[str, list[Frame]]) -> Document:
    """Return the document; first what others refer to, whatever the order in the file."""
    properties = _properties(source, frames["Properties"])
    tables = _tables(source, frames["Table"])
    mesh = read_mesh(source, frames, list(properties))
    # References to what is broken already would only be reported as missing.
    source.problems.raise_if_any()
    document = Document(mesh, properties, tables=tables)
    document.geometries = read_blocks(source, frames["Geometries"], mesh)
    document.model_data, _ = read_values(source, [span for f in frames["ModelPartData"] for span in f.spans])
    if frames["Constraints"]:
        from kratos_lite.io.formats.mdpa.constraints import read_constraints

        for frame in frames["Constraints"]:
            document.constraints += read_constraints(source, frame, mesh.node_ids)
    _refuse_repeated_constraints(source, document)
    ids = {
        "nodes": mesh.node_ids,
        "elements": mesh.element_ids,
        "conditions": ids_of(mesh.conditions),
        "geometries": ids_of(document.geometries),
        "constraints": _numbers(c.id for c in document.constraints),
        "properties": _numbers(properties),
        "tables": _numbers(tables),
    }
    document.nodal_data = [read_data(source, f, ids["nodes"]) for f in frames["NodalData"]]
    document.element_data = [read_data(source, f, ids["elements"]) for f in frames["ElementalData"]]
    document.condition_data = [read_data(source, f, ids["conditions"]) for f in frames["ConditionalData"]]
    document.mesh = mesh.replace(parts=PartReader(source, ids).read(frames["SubModelPart"]))
    return document


def _numbers(numbers: Iterable[int]) -> Ints:
    return np.array(list(numbers), dtype=np.int64)


def _properties(source: Source, frames: list[Frame]) -> dict[int, Properties]:
    """Return the Properties of some frames by their ids."""
    properties: dict[int, Properties] = {}
    for frame in frames:
        number = _number(source, frame, properties, zero=True)
        values, lines = read_values(source, frame.spans)
        for child in frame.children:
            key = " ".join(["Table", *child.arguments])
            values[key], lines[key] = read_table(source, child, child.arguments), source.line(child.offset)
            source.note(f"{key} of {frame.title[6:]} is kept, but not used", child.offset)
        if number is not None:
            properties[number] = Properties(number, values, lines, source.line(frame.offset))
    return properties


def _tables(source: Source, frames: list[Frame]) -> dict[int, Any]:
    """Return the tables of some frames by their ids."""
    tables: dict[int, Table] = {}
    for frame in frames:
        number = _number(source, frame, tables)
        table = read_table(source, frame, frame.arguments[1:])
        source.note(f"{frame.title[6:]} is kept, but not used", frame.offset)
        if number is not None:
            tables[number] = table
    return tables


def _number(source: Source, frame: Frame, taken: dict[int, Any], zero: bool = False) -> int | None:
    """Return the id in the header of a block, or None where it is wrong or taken."""
    word = frame.arguments[0]
    try:
        number = 0 if zero and word == "0" else integer(word.encode())
    except ValueError as error:
        source.problem(f"{frame.name}: {error}", frame.offset)
        return None
    if number in taken:
        text = already(f"{frame.name} {number}", taken[number].line, "; give each its own id")
        source.problem(text, frame.offset)
        return None
    return number


def _refuse_repeated_constraints(source: Source, document: Document) -> None:
    all_ = document.constraints
    for row, first in repeated(_numbers(c.id for c in all_)):
        text = already(f"constraint {all_[row].id}", all_[first].line, "; give each its own id")
        source.problem_in_line(text, all_[row].line)
