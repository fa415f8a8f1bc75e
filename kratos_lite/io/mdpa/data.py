"""Data on nodes, elements and conditions, and multi-point constraints of an `.mdpa` file."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from kratos_lite.io.document import Constraint, Data, Note
from kratos_lite.io.mdpa.rows import TRUTH, Layout, Rows, read_rows, width_of_first_line
from kratos_lite.io.mdpa.scan import WORD, Frame, Source
from kratos_lite.io.mdpa.values import kind_of, note_unknown, value_at
from kratos_lite.io.text import integer, real, shown

Ints = NDArray[np.int64]
WORDS = {"NodalData": "node", "ElementalData": "element", "ConditionalData": "condition"}
IS_FIXED = re.compile(rb"\s*([^\s\[(]+)")
CONSTRAINT = re.compile(rb"\s*([^\s\[\]]+)\s+([^\s\[\]]+)\s*\[([^\[\]]*)\]")


def read_data(source: Source, frame: Frame, known: Ints) -> Data:
    """Return one block of nodal, elemental or conditional data; `known` are the ids in the mesh."""
    variable, word = frame.arguments[0], WORDS[frame.name]
    kind, span = kind_of(variable), frame.spans[0]
    if kind is None:
        note_unknown(source, variable, frame.offset)
    width = width_of_first_line(source, span)
    first = next(source.words(span), None)
    line_end = source.data.find(b"\n", first.start(), span[1]) if first else span[0]
    has_bracket = b"(" in source.data[first.start() if first else 0 : line_end if line_end >= 0 else span[1]]
    if kind in ("vector", "matrix") or (kind is None and has_bracket):
        data = _read_arrays(source, frame, word == "node", kind)
    elif kind == "flag" or (kind is None and width == 1):
        rows = read_rows(source, span, Layout(word, "i", needs=f"{variable} is a flag: write ids only"))
        data = _data(source, frame, rows, rows.reals[:, :0].ravel())
    else:
        kinds = ("ib" if word == "node" else "i") + ("b" if kind == "truth" else "r")
        needs = f"expected {word} id, {'is_fixed, ' if word == 'node' else ''}value"
        rows = read_rows(source, span, Layout(word, kinds, needs=needs))
        values = rows.reals[:, 0] if kind != "truth" else rows.ints[:, -1].astype(float)
        data = _data(source, frame, rows, values)
        if word == "node":
            data.fixed = rows.ints[:, 1] == 1
    _note_missing(source, data, word, known)
    return data


def _data(source: Source, frame: Frame, rows: Rows, values: NDArray[np.float64]) -> Data:
    free = np.zeros(len(rows.ints), dtype=bool)
    return Data(frame.arguments[0], rows.ints[:, 0], free, values, source.line(frame.offset))


def _read_arrays(source: Source, frame: Frame, is_nodal: bool, kind: str | None) -> Data:
    """Return rows of an id, for nodes a 0, and a vector or matrix."""
    at, end = frame.spans[0]
    ids: list[int] = []
    values: list[NDArray[np.float64]] = []
    while word := WORD.search(source.data, at, end):
        here = word.start()
        try:
            number = integer(word.group())
            at = word.end()
            if is_nodal:
                at = _free(source, at, end)
            start = WORD.search(source.data, at, end)
            value, at = value_at(source, start.start() if start else end, end, kind)
            if not isinstance(value, np.ndarray):
                raise ValueError(f"{value!r} is not a vector like the first row; write [3] (x, y, z)")
            if values and value.shape != values[0].shape:
                raise ValueError(f"has size {list(value.shape)}, but the first row {list(values[0].shape)}")
            ids.append(number)
            values.append(value)
        except ValueError as error:
            source.problem(f"{frame.arguments[0]} {shown(word.group())}: {error}", here)
            at = source.data.find(b"\n", here, end)
            if at < 0:
                break
    array = np.array(values) if values else np.zeros(0)
    free = np.zeros(len(ids), dtype=bool)
    return Data(frame.arguments[0], np.array(ids, dtype=np.int64), free, array, source.line(frame.offset))


def _free(source: Source, at: int, end: int) -> int:
    """Return the end of the is_fixed word, which must say that the value is free."""
    match = IS_FIXED.match(source.data, at, end)
    if match is None or match.group(1) not in TRUTH:
        raise ValueError("expected is_fixed, 0, before the vector")
    if TRUTH[match.group(1)]:
        raise ValueError("a vector cannot be fixed; fix its components _X, _Y, _Z in blocks of their own")
    return match.end()


def _note_missing(source: Source, data: Data, word: str, known: Ints) -> None:
    """Refuse fixed values on missing nodes; note other values that have no place or stand twice."""
    missing = ~np.isin(data.ids, known)
    if (missing & data.fixed).any():
        ids = data.ids[missing & data.fixed]
        source.problems.add(
            f"{data.variable} is fixed on {word} {_first(ids)}, which the file does not have", data.line
        )
    elif missing.any():
        text = f"{data.variable} on {word} {_first(data.ids[missing])} is ignored: the file does not have it"
        source.notes.append(Note(data.line, text))
    if len(np.unique(data.ids)) < len(data.ids):
        source.notes.append(
            Note(data.line, f"{data.variable} stands twice for a {word}; the last value counts")
        )


def _first(ids: Ints) -> str:
    return f"{ids[0]} (and {len(ids) - 1} more)" if len(ids) > 1 else str(ids[0])


def read_constraints(source: Source, frame: Frame, nodes: Ints) -> list[Constraint]:
    """Return the rows ``id constant [w1, w2] slave master1 master2`` of a block.

    The variables in the header are the slave's and then one for each master, or one for all.
    """
    if len(frame.arguments) < 2:
        source.problem("expected 'Begin Constraints NAME SLAVE_VARIABLE [MASTER_VARIABLE …]'", frame.offset)
        return []
    at, end = frame.spans[0]
    found: list[Constraint] = []
    known = set(nodes.tolist())
    while word := WORD.search(source.data, at, end):
        here = word.start()
        try:
            constraint, at = _constraint(source, frame, (here, end))
            missing = [n for n, _ in (constraint.slave, *constraint.masters) if n not in known]
            if missing:
                raise ValueError(f"there is no node {missing[0]}")
            found.append(constraint)
        except ValueError as error:
            source.problem(f"constraint {shown(word.group())}: {error}", here)
            at = source.data.find(b"\n", here, end)
            if at < 0:
                break
    if len({len(c.masters) for c in found}) > 1:
        text = "Kratos misreads a block of Constraints with different numbers of masters; "
        source.note(
            text + "kratos_lite reads it as written; give each number a block of its own", frame.offset
        )
    return found


def _constraint(source: Source, frame: Frame, span: tuple[int, int]) -> tuple[Constraint, int]:
    match = CONSTRAINT.match(source.data, *span)
    if match is None:
        raise ValueError("expected 'id constant [w1, w2, …] slave master1 master2 …'")
    number, constant = integer(match.group(1)), real(match.group(2))
    weights = tuple(real(part.strip()) for part in match.group(3).split(b","))
    at = match.end()
    ids: list[int] = []
    for _ in range(len(weights) + 1):
        word = WORD.search(source.data, at, span[1])
        if word is None:
            raise ValueError(f"has {len(weights)} weights, but {len(ids)} nodes; expected slave and masters")
        ids.append(integer(word.group()))
        at = word.end()
    name, slave, *masters = frame.arguments
    if len(masters) != len(weights):
        if len(masters) > 1:
            raise ValueError(f"has {len(weights)} masters, but the header names {len(masters)} variables")
        masters = (masters or [slave]) * len(weights)
    pairs = tuple(zip(ids[1:], masters, strict=True))
    line = source.line(span[0])
    return Constraint(number, (ids[0], slave), pairs, weights, constant, line, name), at
