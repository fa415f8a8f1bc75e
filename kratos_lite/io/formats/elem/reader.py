"""Reader of the five-file sets NAME.node, .elem, .cond, .prop and .init (Kratos data of 2008)."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable
from itertools import groupby
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.errors import InputError, Problems
from kratos_lite.io.formats.document import (
    Data,
    Document,
    Note,
    Properties,
    already,
    repeated,
    repeated_nodes,
    wrong_nodes,
)
from kratos_lite.io.formats.elem.grammar import FIX, FORMS, INIT, MATRIX, VECTOR, Form, Source, Statement
from kratos_lite.io.names import condition_shape, element_shape
from kratos_lite.mesh import Block, Mesh
from kratos_lite.shapes import Shape
from kratos_lite.typing import Ints

REQUIRED = (".node", ".elem")
VECTORS = ("DISPLACEMENT", "VELOCITY", "ACCELERATION", "ROTATION", "REACTION")
Values: TypeAlias = "dict[int, tuple[float, int]]"
"""Value and line by node id."""


def read_elem(path: str | Path) -> Document:
    """Return a five-file set, of which a path names any file or the stem; an error names all its problems.

    >>> stem = getfixture("tmp_path") / "bar"
    >>> _ = stem.with_suffix(".node").write_text("NODES = NodesList([[1, 0, 0, 0], [2, 1, 0, 0]])")
    >>> _ = stem.with_suffix(".elem").write_text("ELEMENTS[7] = Bar3D2N([1, 2], 0);")
    >>> document = read_elem(stem)
    >>> document.mesh.n_nodes, document.mesh.element_ids
    (2, array([7]))
    """
    files = _Files(path)
    mesh = _mesh(files)
    properties = _properties(files)
    _use_properties(files, mesh, properties)
    nodal_data = _nodal_data(files, mesh)
    files.problems.raise_if_any()
    return Document(mesh, properties, nodal_data, notes=files.notes)


def stem(path: str | Path) -> str:
    """Return the path without ``.node`` … ``.init`` and ``.gz``.

    >>> stem("a/beam.v2.elem.gz")
    'a/beam.v2'
    """
    text = os.fspath(path).removesuffix(".gz")
    return text[:-5] if text.endswith(tuple(FORMS)) else text


class _Files:
    """The five files, scanned; `problems` and `notes` of all of them."""

    def __init__(self, path: str | Path) -> None:
        self.problems = Problems()
        self.notes: list[Note] = []
        self.sources: dict[str, Source] = {}
        self.statements: dict[str, list[Statement]] = {ending: [] for ending in FORMS}
        self.stem = stem(path)
        self.nodes_known = True
        for ending, forms in FORMS.items():
            if file := self._find(ending):
                try:
                    self.sources[ending] = source = Source(file, self.problems, self.notes)
                    self.statements[ending] = source.scan(forms)
                except InputError as error:
                    self.problems.add(str(error))
            if ending == ".node":
                self.nodes_known = not self.problems

    def _find(self, ending: str) -> Path | None:
        plain, zipped = Path(self.stem + ending), Path(self.stem + ending + ".gz")
        if plain.exists() and zipped.exists():
            self.notes.append(Note(0, f"{zipped} is not read: {plain} is there too"))
        for file in (plain, zipped):
            if file.exists():
                return file
        if ending in REQUIRED:
            also = f"nor {zipped.name}; expected NAME.node and NAME.elem side by side"
            self.problems.add(f"{plain}: there is no such file, {also}")
        else:
            self.notes.append(Note(0, f"there is no file {plain}"))
        return None


def _mesh(files: _Files) -> Mesh:
    mesh = _nodes(files)
    blocks = _cells(files, mesh, "element", ".elem", element_shape)
    conditions = _cells(files, mesh, "condition", ".cond", condition_shape)
    if mesh.n_nodes:
        mesh = mesh.replace(blocks=blocks, conditions=conditions)
    if not blocks:
        files.notes.append(Note(0, f"{mesh.source}: there are no elements"))
    counts: Counter[str] = Counter()
    for block in conditions:
        counts[block.name] += len(block) if block.shape is None else 0
    for name, count in (+counts).items():
        text = f"{count} conditions {name} are kept without use"
        files.notes.append(Note(0, text, Path(files.stem).name + ".cond"))
    return mesh


def _nodes(files: _Files) -> Mesh:
    name = files.sources[".elem"].name if ".elem" in files.sources else files.stem
    source, found = files.sources.get(".node"), files.statements[".node"]
    if source is None or not found:
        if source is not None and files.nodes_known:
            source.problem("there are no nodes; expected NODES = NodesList([[id, x, y, z], …])", 0)
        files.nodes_known = False
        return Mesh(np.zeros((0, 3)), source=name)
    before = files.problems.count
    _, starts, tokens, *coordinates = zip(*found, strict=True)
    ids = source.integers(tokens, starts)
    points = np.column_stack([source.reals(column, starts) for column in coordinates])
    keep = np.ones(len(ids), dtype=bool)
    for row, text, is_same in repeated_nodes(ids, points, source.lines(starts)):
        keep[row] = False
        (source.note if is_same else source.problem)(text, starts[row])
    files.nodes_known &= files.problems.count == before
    finite = np.where(np.isfinite(points), points, 0.0)  # others are problems already
    return Mesh(finite[keep], node_ids=ids[keep], source=name)


def _cells(
    files: _Files, mesh: Mesh, word: str, ending: str, shape_of: Callable[[str], type[Shape] | None]
) -> list[Block]:
    """Return one block per run of equal names."""
    found = [statement for statement in files.statements[ending] if "<ids>" in statement[0].text]
    if not found:
        return []
    _, starts, tokens, names, nodes_of, properties_of = zip(*found, strict=True)
    source = files.sources[ending]
    lines = source.lines(starts)
    ids, properties = source.integers(tokens, starts), source.integers(properties_of, starts, least=0)
    for row, first in repeated(ids):
        source.problem(already(f"{word} {ids[row]}", lines[first]), starts[row])
    blocks, end = [], 0
    for token, group in groupby(names):
        rows = slice(end, end := end + len(list(group)))
        name = token.decode("ascii")
        shape = shape_of(name)
        nodes, wrong = _connected(files, mesh, shape, source, nodes_of[rows], starts[rows])
        for cell, message in wrong:
            source.problem(f"{word} {ids[rows][cell]} ({name}){message}", starts[rows][cell])
        blocks.append(Block(name, nodes, ids[rows], properties[rows], shape, lines[rows]))
    return blocks


def _connected(
    files: _Files,
    mesh: Mesh,
    shape: type[Shape] | None,
    source: Source,
    texts: tuple[bytes, ...],
    starts: tuple[int, ...],
) -> tuple[Ints, Iterable[tuple[int, str]]]:
    """Return the rows of the nodes that each text lists, 0 if unknown, and cells with what is wrong."""
    widths = np.array([text.count(b",") + 1 if text else 0 for text in texts])
    width = len(shape.nodes) if shape else max(int(widths[0]), 1)
    nothing = np.zeros((len(texts), width), dtype=np.int64)
    if (widths != width).any():
        cells = np.flatnonzero(widths != width).tolist()
        return nothing, [(cell, f" has {widths[cell]} nodes; expected {width}") for cell in cells]
    before = files.problems.count
    nodes = source.integers(texts, np.repeat(starts, width)).reshape(-1, width)
    if files.problems.count > before:
        return nothing, []
    rows = mesh.node_rows(nodes)
    return np.maximum(rows, 0), wrong_nodes(nodes, rows) if files.nodes_known else []


def _properties(files: _Files) -> dict[int, Properties]:
    """Return the properties by id; values are floats, vectors and matrices."""
    by_id: dict[int, Properties] = {}
    for form, start, token, name, text in files.statements[".prop"]:
        source, variable = files.sources[".prop"], name.decode("ascii")
        number, line = int(source.integers([token], [start], least=0)[0]), source.line(start)
        properties = by_id.setdefault(number, Properties(number, line=line, source=source.name))
        if variable in properties.values:
            source.problem(already(f"{variable} of properties {number}", properties.lines[variable]), start)
        properties.values[variable] = _value(source, form, text, start)
        properties.lines[variable] = line
    return by_id


def _value(source: Source, form: Form, text: bytes, start: int) -> Any:
    """Return the value of a property: a float, or a vector or matrix as an array."""
    rows = [row.strip(b"[, \t\n") for row in text.split(b"]")[:-1]] if form is MATRIX else [text]
    values = [source.reals([row], [start] * (row.count(b",") + 1)) for row in rows]
    if form is not MATRIX:
        return values[0] if form is VECTOR else float(values[0][0])
    counts = [len(row) for row in values]
    if len(set(counts)) > 1:
        source.problem(f"the rows of the matrix have {counts} numbers; expected equal rows", start)
        return None
    return np.array(values)


def _use_properties(files: _Files, mesh: Mesh, properties: dict[int, Properties]) -> None:
    """Check the property ids of the elements, and add those without values; conditions may name any."""
    declared = {0, *properties}
    have = ", ".join(map(str, sorted(properties.keys() - {0})))
    all_used = set()
    for block in mesh.blocks:
        used, cells = np.unique(block.properties, return_index=True)
        all_used.update(used.tolist())
        for number, cell in zip(used.tolist(), cells.tolist(), strict=True):
            if number not in declared and properties:
                message = f"properties {number} are not declared in {files.stem}.prop; expected one of {have}"
                files.problems.add(f"{mesh.place(block, cell)}: {message}")
    for number in sorted(all_used):
        properties.setdefault(number, Properties(number))


def _nodal_data(files: _Files, mesh: Mesh) -> list[Data]:
    """Return one Data per variable for its fixed degrees of freedom, then one for its free ones."""
    fixed, free = _by_variable(files, ".cond", FIX, mesh), _by_variable(files, ".init", INIT, mesh)
    data = []
    for variable, nodes in fixed.items():
        values = free.get(variable, {})
        prescribed = {n: (values.pop(n, at)[0], at[1]) for n, at in nodes.items()}
        data.append(_data(variable, prescribed, True, files.sources[".cond"].name))
    for variable, nodes in free.items():
        if nodes:
            data.append(_data(variable, nodes, False, files.sources[".init"].name))
    return data


def _by_variable(files: _Files, ending: str, form: Form, mesh: Mesh) -> dict[str, Values]:
    """Return the nodes that ``Fix`` or ``.init`` statements name, with their values."""
    found = [statement for statement in files.statements[ending] if statement[0] is form]
    if not found:
        return {}
    source = files.sources[ending]
    _, starts, tokens, names, *of_init = zip(*found, strict=True)
    ids, values = source.integers(tokens, starts), np.zeros(len(found))
    for i in np.flatnonzero(mesh.node_rows(ids) < 0) if files.nodes_known else ():
        source.problem(f"there is no node {ids[i]} in {files.sources['.node'].name}", starts[i])
    if of_init:
        steps, values = source.integers(of_init[0], starts, least=0), source.reals(of_init[1], starts)
        for i in np.flatnonzero(steps):
            source.problem(
                f"step {steps[i]} of the solution is not known at the start; expected 0", starts[i]
            )
    by_variable: dict[str, Values] = {}
    again = []
    columns = ids.tolist(), names, values.tolist(), source.lines(starts).tolist(), starts
    for node, token, value, line, start in zip(*columns, strict=True):
        name = token.decode("ascii")
        if name in VECTORS and name not in by_variable:
            source.problem(f"{name} is a vector; expected one of {name}_X, {name}_Y, {name}_Z", start)
        earlier, at = by_variable.setdefault(name, {}).setdefault(node, (value, line))
        if earlier != value:
            source.problem(already(f"{name} of node {node}", at, " with another value"), start)
        elif at != line:
            again.append(start)
    if again:
        source.note(f"{len(again)} statements repeat earlier ones, from here on", again[0])
    return by_variable


def _data(variable: str, nodes: Values, fixed: bool, source: str) -> Data:
    values, lines = zip(*nodes.values(), strict=True)
    ids = np.array(list(nodes), dtype=np.int64)
    return Data(variable, ids, np.full(len(ids), fixed), np.array(values), min(lines), source)
