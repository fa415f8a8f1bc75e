"""Nodes, elements and conditions of a five-file set."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from kratos_lite.io.document import Note
from kratos_lite.io.elem.files import ElemFiles
from kratos_lite.io.elem.grammar import Run
from kratos_lite.io.names import condition_shape, element_shape
from kratos_lite.mesh import Block, Ints, Mesh
from kratos_lite.shapes import Shape

NO_NODES = np.zeros((0, 0), dtype=np.int32)


@dataclass(frozen=True)
class Kind:
    """Elements or conditions: what to call one, its file, and how to know its shape."""

    word: str
    ending: str
    shape_of: Callable[[str], type[Shape] | None]


def read_mesh(files: ElemFiles) -> Mesh:
    """Return the mesh of the set; problems and notes go to `files`."""
    mesh = _nodes(files)
    mesh.blocks = _cells(files, mesh, Kind("element", ".elem", element_shape))
    mesh.conditions = _cells(files, mesh, Kind("condition", ".cond", condition_shape))
    _note_unused(files, mesh)
    return mesh


def _nodes(files: ElemFiles) -> Mesh:
    name = files.sources[".elem"].name if ".elem" in files.sources else files.stem
    source = files.sources.get(".node")
    columns, starts = _joined(files.runs[".node"], 4)
    before = files.problems.count
    if source is None or not starts:
        if source is not None and not before:
            source.add(0, "there are no nodes; expected NODES = NodesList([[id, x, y, z], …])")
        files.nodes_known = False
        return Mesh(np.zeros((0, 3)), source=name)
    ids = source.integers(columns[0], starts)
    points = np.column_stack([source.reals(column, starts) for column in columns[1:]])
    keep = np.ones(len(ids), dtype=bool)
    for first, again in _duplicates(ids):
        keep[again] = False
        line = source.lines([starts[first]])[0]
        if np.array_equal(points[first], points[again]):
            source.note(starts[again], f"node {ids[again]} is repeated from line {line}")
        else:
            source.add(starts[again], twice(f"node {ids[again]}", line, " with other coordinates"))
    files.nodes_known &= files.problems.count == before
    return Mesh(points[keep], node_ids=ids[keep], source=name)


def _cells(files: ElemFiles, mesh: Mesh, kind: Kind) -> list[Block]:
    """Return one block per run of equal names."""
    runs = [run for run in files.runs[kind.ending] if "<ids>" in run.form.text]
    if not runs:
        return []
    for run in runs:
        if run.head:
            run.columns.insert(1, run.head * len(run.starts))
    source = files.sources[kind.ending]
    (tokens, names, bodies, numbers), starts = _joined(runs, 4)
    ids = source.integers(tokens, starts)
    properties = source.integers(numbers, starts, least=0)
    lines = source.lines(starts)
    for first, again in _duplicates(ids):
        source.add(starts[again], twice(f"{kind.word} {ids[again]}", lines[first]))
    blocks, end = [], 0
    for name, group in groupby(names):
        rows = slice(end, end := end + len(list(group)))
        text = name.decode("ascii")
        block = Block(text, NO_NODES, ids[rows], properties[rows], kind.shape_of(text), lines[rows])
        _connect(block, bodies[rows], starts[rows], (files, mesh, kind))
        blocks.append(block)
    return blocks


def _connect(
    block: Block, bodies: Sequence[bytes], starts: Sequence[int], at: tuple[ElemFiles, Mesh, Kind]
) -> None:
    """Fill ``block.nodes`` with the node rows that the texts `bodies` name."""
    files, mesh, kind = at
    source = files.sources[kind.ending]

    def add(cell: int, message: str) -> None:
        source.add(starts[cell], f"{kind.word} {block.ids[cell]} ({block.name}){message}")

    widths = np.array([body.count(b",") + 1 if body else 0 for body in bodies])
    width = len(block.shape.nodes) if block.shape else max(int(widths[0]), 1)
    for i in np.flatnonzero(widths != width).tolist():
        add(i, f" has {widths[i]} nodes; expected {width}")
    if (widths != width).any():
        return
    before = files.problems.count
    nodes = source.integers(bodies, np.repeat(starts, width)).reshape(-1, width)
    if files.problems.count > before:
        return
    block.nodes = mesh.node_rows(nodes).astype(np.int32)
    ordered = np.sort(nodes, axis=1)
    for i, k in np.argwhere(ordered[:, 1:] == ordered[:, :-1]).tolist():
        add(i, f" names node {ordered[i, k]} twice; its nodes must differ")
    for i, k in np.argwhere(block.nodes < 0).tolist() if files.nodes_known else ():
        add(i, f": {files.no_node(nodes[i, k])}")


def _note_unused(files: ElemFiles, mesh: Mesh) -> None:
    if not mesh.blocks:
        files.notes.append(Note(0, f"{mesh.source}: there are no elements"))
    counts: dict[str, int] = {}
    for block in mesh.conditions:
        if block.shape is None:
            counts[block.name] = counts.get(block.name, 0) + len(block)
    for name, count in counts.items():
        files.notes.append(
            Note(0, f"{count} conditions {name} are kept without use", Path(files.stem).name + ".cond")
        )


def _joined(runs: Sequence[Run], count: int) -> tuple[list[list[bytes]], list[int]]:
    """Return the columns of several runs, and the starts of their statements, one after the other."""
    columns: list[list[bytes]] = [[] for _ in range(count)]
    starts: list[int] = []
    for run in runs:
        starts += run.starts
        for column, part in zip(columns, run.columns, strict=True):
            column.extend(part)
    return columns, starts


def _duplicates(ids: Ints) -> Iterator[tuple[int, int]]:
    """Yield pairs of rows, the first and a later one, that carry the same id."""
    if (np.diff(ids) > 0).all():
        return
    order = np.argsort(ids, kind="stable")
    ordered = ids[order]
    for i in np.flatnonzero(ordered[1:] == ordered[:-1]):
        yield int(order[np.searchsorted(ordered, ordered[i])]), int(order[i + 1])


def twice(what: str, line: int, how: str = "") -> str:
    """Return the message for what stands in a file for the second time."""
    return f"{what} is defined twice{how}, first at line {line}; expected once"
