"""From the ranges of one large `.mdpa` file that ranks have read to what each holds of the model."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.distributed.directory import Directory
from kratos_lite.distributed.partition import partitioned
from kratos_lite.distributed.pieces import Kind, Piece, cell_ids
from kratos_lite.io.formats.document import Data, Document
from kratos_lite.io.formats.mdpa.constraints import read_constraints
from kratos_lite.io.formats.mdpa.data import read_data
from kratos_lite.io.formats.mdpa.mesh import NODES, width_of
from kratos_lite.io.formats.mdpa.parts import PartReader
from kratos_lite.io.formats.mdpa.ranges import LongBlock, Ranges, Unusual, read_ranges
from kratos_lite.io.formats.mdpa.reader import read_properties, read_tables, sorted_notes
from kratos_lite.io.formats.mdpa.rows import Layout, Rows, read_rows
from kratos_lite.io.formats.mdpa.scan import TOP, Frame
from kratos_lite.io.formats.mdpa.values import read_values
from kratos_lite.io.formats.pieces import joined, shape_of
from kratos_lite.io.names import condition_shape, element_shape
from kratos_lite.mesh import NO_ROWS, Mesh, Part, distinct
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.records import replace
from kratos_lite.typing import Array, Ints

LISTED = {
    "SubModelPartNodes": "nodes",
    "SubModelPartElements": "elements",
    "SubModelPartConditions": "conditions",
}


def read_mdpa_by_ranks(path: Path, ranks: Alone, strict: bool) -> Document:
    """Return what this rank holds of a model file, of which each rank reads a range.

    Raises
    ------
    Unusual
        On all ranks: the file is better read whole, as something is rare or wrong in it.
    MeshError
        As for `subdomain_mesh`.
    """
    read = read_ranges(path, ranks, strict)
    with ranks.together():
        document, constraint_nodes = _small_blocks(read)
        node_ids, points = _nodes(read)
        elements = _cells(read, "Elements", "element", set(document.properties))
        conditions = _cells(read, "Conditions", "condition", set(document.properties))
        parts = _parts(read, document)
        document.nodal_data = [_data(read, block) for block in read.long("NodalData")]
        document.element_data = [_data(read, block) for block in read.long("ElementalData")]
        document.condition_data = [_data(read, block) for block in read.long("ConditionalData")]
        if (
            not ranks.sum(len(node_ids))
            or read.source.notes
            or read.source.problems.count
            or any(read.long("Geometries"))
        ):
            raise Unusual("notes or problems")
    nodes = _Known(ranks, node_ids)
    data = {
        "nodes": document.nodal_data,
        "elements": document.element_data,
        "conditions": document.condition_data,
    }
    known = {"nodes": nodes, "elements": _Known(ranks, cell_ids(elements))}
    known["conditions"] = _Known(ranks, cell_ids(conditions))
    nodes.require(np.concatenate([cell.nodes.ravel() for cell in (*elements, *conditions)] or [NO_ROWS]))
    nodes.require(constraint_nodes)
    for what, of in known.items():
        of.require(np.concatenate([NO_ROWS, *(getattr(part, what) for part in parts.values())]))
        for one in data[what]:
            of.require(one.ids, once=True)
            if len({shape for shape in ranks.gather(shape_of(one)) if shape is not None}) > 1:
                raise Unusual("values of different sizes")
    piece = partitioned(ranks, Piece(elements, conditions, node_ids, points, parts=parts))
    return joined(ranks, document, piece, str(path))


class _Known:
    """The ids of nodes, elements or conditions of all ranks, each of which stands once."""

    def __init__(self, ranks: Alone, ids: Ints) -> None:
        self.ranks, self.directory = ranks, Directory(ranks, ids)
        if ranks.sum(len(ids)) != ranks.sum(len(self.directory.ids)):
            raise Unusual("an id stands twice")

    def require(self, ids: Ints, once: bool = False) -> None:
        """Raise `Unusual` on all ranks unless some ids are known, and given only `once` if asked for."""
        asked = self.directory.ask(ids if once else distinct(ids))
        twice = once and len(asked.rows) > len(distinct(asked.rows))
        if self.ranks.any(bool(twice or (asked.rows < 0).any())):
            raise Unusual("an id that nobody has, or two values of one")


def _small_blocks(read: Ranges) -> tuple[Document, Ints]:
    """Return what stands in short blocks, which all ranks have, and the ids of nodes of constraints."""
    source, frames = read.skeleton, {name: list[Frame]() for name in TOP}
    for frame in read.root.children:
        if frame.name not in frames or frame.name == "Mesh":
            raise Unusual("a block that is skipped")
        frames[frame.name].append(frame)
    document = Document(Mesh(np.zeros((0, 3))), read_properties(source, frames["Properties"]))
    document.tables = read_tables(source, frames["Table"])
    document.model_data, _ = read_values(source, [span for f in frames["ModelPartData"] for span in f.spans])
    for frame in frames["Constraints"]:
        document.constraints += read_constraints(source, frame, None)
    ids = [one.id for one in document.constraints]
    if source.problems.count or len(set(ids)) < len(ids):
        raise Unusual("problems")
    document.notes = sorted_notes(source)
    nodes = [node for one in document.constraints for node, _ in (one.slave, *one.masters)]
    return document, np.array(nodes, dtype=np.int64)


def _rows(read: Ranges, block: LongBlock, layout: Layout) -> Rows:
    return read_rows(read.source, block.span, layout)


def _nodes(read: Ranges) -> tuple[Ints, Array]:
    """Return ids and places of the nodes that this rank reads."""
    rows = [_rows(read, block, NODES) for block in read.long("Nodes")]
    ids = np.concatenate([NO_ROWS, *(each.ints[:, 0] for each in rows)])
    return ids, np.concatenate([np.zeros((0, 3)), *(each.reals for each in rows)])


def _cells(read: Ranges, kind: str, word: str, properties: set[int]) -> tuple[Kind, ...]:
    """Return the elements or conditions that this rank reads."""
    found = []
    for block in read.long(kind):
        name = block.frame.arguments[0]
        width = width_of(kind, name)
        if width is None:
            raise Unusual("cells whose rows alone tell how many nodes they have")
        rows = _rows(read, block, Layout(word, "ip" + "i" * width, "nodes", 2, f"{name} needs {width}"))
        ids, nodes = rows.ints[:, 0], rows.ints[:, 2:].reshape(-1, width)
        ordered = np.sort(nodes, axis=1)
        used = distinct(np.sort(rows.ints[:, 1])) if len(ids) else NO_ROWS
        if (ordered[:, 1:] == ordered[:, :-1]).any() or not set(used.tolist()) <= properties:
            raise Unusual("cells that name a node twice, or properties that are not there")
        shape = element_shape(name) if word == "element" else condition_shape(name)
        found.append(Kind(name, nodes, ids, rows.ints[:, 1], shape, rows.lines, block.line))
    return tuple(found)


def _parts(read: Ranges, document: Document) -> dict[str, Part]:
    """Return the parts with the ids that this rank reads."""
    ids: dict[str, Any] = {
        "nodes": NO_ROWS, "elements": NO_ROWS, "conditions": NO_ROWS, "geometries": NO_ROWS,
        "constraints": np.array([one.id for one in document.constraints], dtype=np.int64),
        "properties": np.array(list(document.properties), dtype=np.int64),
        "tables": np.array(list(document.tables), dtype=np.int64),
    }  # fmt: skip
    frames = [frame for frame in read.root.children if frame.name == "SubModelPart"]
    parts = PartReader(read.skeleton, ids).read(frames)
    if read.skeleton.problems.count:
        raise Unusual("problems")
    document.notes = sorted_notes(read.skeleton)
    members: dict[tuple[str, str], list[Ints]] = {}
    for full, frame in _lists(frames, ""):
        rows = _rows(read, read.blocks[frame.offset], Layout("id", "i")).ints[:, 0]
        words = full.split(".")
        for end in range(1, len(words) + 1):
            members.setdefault((".".join(words[:end]), LISTED[frame.name]), []).append(rows)
    for (name, what), some in members.items():
        parts[name] = replace(parts[name], **{what: np.concatenate(some)})
    return parts


def _lists(frames: list[Frame], parent: str) -> Iterator[tuple[str, Frame]]:
    """Yield the full name of the part and the block of each long list of members."""
    for frame in frames:
        full = f"{parent}.{frame.arguments[0]}" if parent else frame.arguments[0]
        for child in frame.children:
            if child.name == "SubModelPart":
                yield from _lists([child], full)
            elif child.name in LISTED:
                yield full, child


def _data(read: Ranges, block: LongBlock) -> Data:
    """Return the values that this rank reads of a block."""
    frame = replace(block.frame, spans=[block.span], offset=0)
    data = read_data(read.source, frame, None)
    return replace(data, line=block.line)
