"""Data on nodes, elements and conditions of an `.mdpa` file."""

from __future__ import annotations

import re

import numpy as np

from kratos_lite.io.formats.document import Data
from kratos_lite.io.formats.mdpa.rows import TRUTH, Layout, Rows, first_line, read_rows
from kratos_lite.io.formats.mdpa.scan import WORD, Frame, Source
from kratos_lite.io.formats.mdpa.values import kind_of, note_unknown, value_at
from kratos_lite.io.text import integer
from kratos_lite.mesh import rows_of_ids, without_repeats
from kratos_lite.typing import Array, Ints

WORDS = {"NodalData": "node", "ElementalData": "element", "ConditionalData": "condition"}
IS_FIXED = rb"\s*([^\s\[(]+)"


def read_data(source: Source, frame: Frame, known: Ints) -> Data:
    """Return one block of nodal, elemental or conditional data; its ids should be among the known ones."""
    variable, word = frame.arguments[0], WORDS[frame.name]
    kind, span = kind_of(variable), frame.spans[0]
    if kind is None:
        note_unknown(source, variable, frame.offset)
    line = first_line(source, span)
    if kind in ("vector", "matrix") or (kind is None and b"(" in line):
        data = _read_arrays(source, frame, word == "node", kind)
    elif kind == "flag" or (kind is None and len(line.split()) == 1):
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


def _data(source: Source, frame: Frame, rows: Rows, values: Array) -> Data:
    free = np.zeros(len(rows.ints), dtype=bool)
    return Data(frame.arguments[0], rows.ints[:, 0], free, values, source.line(frame.offset))


def _read_arrays(source: Source, frame: Frame, is_nodal: bool, kind: str | None) -> Data:
    """Return rows of an id, for nodes a 0, and a vector or matrix."""
    shapes: list[tuple[int, ...]] = []

    def read(at: int, end: int) -> tuple[tuple[int, Array], int]:
        word = next(source.words((at, end)))
        number = integer(word.group())
        at = _free(source, word.end(), end) if is_nodal else word.end()
        start = WORD.search(source.data, at, end)
        value, at = value_at(source, start.start() if start else end, end, kind)
        if not isinstance(value, np.ndarray):
            raise ValueError(f"{value!r} is not a vector like the first row; write [3] (x, y, z)")
        shapes[:] = shapes or [value.shape]
        if value.shape != shapes[0]:
            raise ValueError(f"has size {list(value.shape)}, but the first row {list(shapes[0])}")
        return (number, value), at

    rows = list(source.each(frame.spans[0], frame.arguments[0], read))
    ids = np.array([number for number, _ in rows], dtype=np.int64)
    values = np.array([value for _, value in rows]) if rows else np.zeros(0)
    free = np.zeros(len(ids), dtype=bool)
    return Data(frame.arguments[0], ids, free, values, source.line(frame.offset))


def _free(source: Source, at: int, end: int) -> int:
    """Return the end of the is_fixed word, which must say that the value is free."""
    match = re.compile(IS_FIXED).match(source.data, at, end)
    if match is None or match.group(1) not in TRUTH:
        raise ValueError("expected is_fixed, 0, before the vector")
    if TRUTH[match.group(1)]:
        raise ValueError("a vector cannot be fixed; fix its components _X, _Y, _Z in blocks of their own")
    return match.end()


def _note_missing(source: Source, data: Data, word: str, known: Ints) -> None:
    """Refuse fixed values on missing nodes; note other values that have no place or stand twice."""
    missing = rows_of_ids(known, data.ids) < 0
    if (missing & data.fixed).any():
        ids = data.ids[missing & data.fixed]
        text = f"{data.variable} is fixed on {word} {_first(ids)}, which the file does not have"
        source.problem_in_line(text, data.line)
    elif missing.any():
        text = f"{data.variable} on {word} {_first(data.ids[missing])} is ignored: the file does not have it"
        source.note_in_line(text, data.line)
    if len(without_repeats(data.ids)) < len(data.ids):
        source.note_in_line(f"{data.variable} is given twice for a {word}; the last value counts", data.line)


def _first(ids: Ints) -> str:
    return f"{ids[0]} (and {len(ids) - 1} more)" if len(ids) > 1 else str(ids[0])
