"""Nodes, elements and conditions of a five-file set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from kratos_lite.io.formats.cells import already, repeated, repeated_nodes, wrong_nodes
from kratos_lite.io.formats.document import Note
from kratos_lite.io.formats.elem.files import ElemFiles
from kratos_lite.io.formats.elem.grammar import Run, Source
from kratos_lite.io.names import condition_shape, element_shape
from kratos_lite.mesh import Block, Mesh
from kratos_lite.shapes import Shape
from kratos_lite.typing import Array, Ints

Numbers = TypeVar("Numbers", Ints, Array)


def read_mesh(files: ElemFiles) -> Mesh:
    """Return the mesh of the set; problems and notes go to `files`."""
    mesh = _nodes(files)
    blocks = _cells(files, mesh, "element", ".elem", element_shape)
    conditions = _cells(files, mesh, "condition", ".cond", condition_shape)
    if mesh.n_nodes:
        mesh = mesh.replace(blocks=blocks, conditions=conditions)
    _note_unused(files, mesh)
    return mesh


def _nodes(files: ElemFiles) -> Mesh:
    name = files.sources[".elem"].name if ".elem" in files.sources else files.stem
    source = files.sources.get(".node")
    runs = files.runs[".node"]
    starts = _starts(runs)
    before = files.problems.count
    if source is None or not starts:
        if source is not None and not before:
            source.problem("there are no nodes; expected NODES = NodesList([[id, x, y, z], …])", 0)
        files.nodes_known = False
        return Mesh(np.zeros((0, 3)), source=name)
    ids = _joined(runs, 0, source.integers)
    points = np.column_stack([_joined(runs, column, source.reals) for column in (1, 2, 3)])
    keep = np.ones(len(ids), dtype=bool)
    for row, text, is_same in repeated_nodes(ids, points, source.lines(starts)):
        keep[row] = False
        (source.note if is_same else source.problem)(text, starts[row])
    files.nodes_known &= files.problems.count == before
    finite = np.where(np.isfinite(points), points, 0.0)  # others are problems already
    return Mesh(finite[keep], node_ids=ids[keep], source=name)


def _cells(
    files: ElemFiles, mesh: Mesh, word: str, ending: str, shape_of: Callable[[str], type[Shape] | None]
) -> list[Block]:
    """Return one block per run of equal names."""
    runs = [run for run in files.runs[ending] if "<ids>" in run.form.text]
    if not runs:
        return []
    for run in runs:
        if run.head:
            run.columns.insert(1, run.head * len(run.starts))
    source = files.sources[ending]
    starts, names = _starts(runs), [name.decode("ascii") for run in runs for name in run.columns[1]]
    ids = _joined(runs, 0, source.integers)
    properties = _joined(runs, 3, lambda tokens, at: source.integers(tokens, at, least=0))
    bodies, lines = [body for run in runs for body in run.columns[2]], source.lines(starts)
    for row, first in repeated(ids):
        source.problem(already(f"{word} {ids[row]}", lines[first]), starts[row])
    blocks, end = [], 0
    for name, group in groupby(names):
        rows = slice(end, end := end + len(list(group)))
        shape = shape_of(name)
        nodes, wrong = _connect(files, mesh, shape, source, (bodies[rows], starts[rows]))
        for cell, message in wrong:
            source.problem(f"{word} {ids[rows][cell]} ({name}){message}", starts[rows.start + cell])
        blocks.append(Block(name, nodes, ids[rows], properties[rows], shape, lines[rows]))
    return blocks


def _connect(
    files: ElemFiles,
    mesh: Mesh,
    shape: type[Shape] | None,
    source: Source,
    texts: tuple[list[bytes], list[int]],
) -> tuple[Ints, Iterable[tuple[int, str]]]:
    """Return the rows of the nodes that each text lists, 0 if unknown, and cells with what is wrong."""
    bodies, starts = texts
    widths = np.array([body.count(b",") + 1 if body else 0 for body in bodies])
    width = len(shape.nodes) if shape else max(int(widths[0]), 1)
    nothing = np.zeros((len(bodies), width), dtype=np.int64)
    if (widths != width).any():
        cells = np.flatnonzero(widths != width).tolist()
        return nothing, [(cell, f" has {widths[cell]} nodes; expected {width}") for cell in cells]
    before = files.problems.count
    nodes = source.integers(bodies, np.repeat(starts, width)).reshape(-1, width)
    if files.problems.count > before:
        return nothing, []
    rows = mesh.node_rows(nodes)
    return np.maximum(rows, 0), wrong_nodes(nodes, rows) if files.nodes_known else []


def _note_unused(files: ElemFiles, mesh: Mesh) -> None:
    if not mesh.blocks:
        files.notes.append(Note(0, f"{mesh.source}: there are no elements"))
    counts: Counter[str] = Counter()
    for block in mesh.conditions:
        counts[block.name] += len(block) if block.shape is None else 0
    for name, count in (+counts).items():
        text = f"{count} conditions {name} are kept without use"
        files.notes.append(Note(0, text, Path(files.stem).name + ".cond"))


def _joined(runs: Sequence[Run], column: int, read: Callable[[Any, list[int]], Numbers]) -> Numbers:
    """Return the numbers of a column of several runs, one after the other."""
    return np.concatenate([read(run.columns[column], run.starts) for run in runs])


def _starts(runs: Sequence[Run]) -> list[int]:
    return [start for run in runs for start in run.starts]
