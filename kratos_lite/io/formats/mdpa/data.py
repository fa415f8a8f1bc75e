"""Data on nodes, elements and conditions of an `.mdpa` file, and its multi-point constraints."""

from __future__ import annotations

import re
from functools import partial
from itertools import islice

import numpy as np

from kratos_lite.io.formats.document import Constraint, Data
from kratos_lite.io.formats.mdpa.rows import TRUTH, Layout, first_line, read_rows
from kratos_lite.io.formats.mdpa.scan import WORD, Frame, Source
from kratos_lite.io.formats.mdpa.values import kind_of, note_unknown, value_at
from kratos_lite.io.text import integer, real
from kratos_lite.mesh import rows_of_ids, without_repeats
from kratos_lite.typing import Array, Ints

WORDS = {"NodalData": "node", "ElementalData": "element", "ConditionalData": "condition"}
IS_FIXED = re.compile(rb"\s*([^\s\[(]+)")
CONSTRAINT = re.compile(rb"\s*([^\s\[\]]+)\s+([^\s\[\]]+)\s*\[([^\[\]]*)\]")


def read_data(source: Source, frame: Frame, known: Ints) -> Data:
    """Return one block of nodal, elemental or conditional data; its ids should be among the known ones."""
    variable, word = frame.arguments[0], WORDS[frame.name]
    kind, span = kind_of(variable), frame.spans[0]
    if kind is None:
        note_unknown(source, variable, frame.offset)
    line = first_line(source, span)
    if kind in ("vector", "matrix") or (kind is None and b"(" in line):
        data = _read_arrays(source, frame, word == "node", kind)
    else:
        is_flag = kind == "flag" or (kind is None and len(line.split()) == 1)
        columns = "" if is_flag else ("b" if word == "node" else "") + ("b" if kind == "truth" else "r")
        needs = f"expected {word} id, {'is_fixed, ' if word == 'node' else ''}value"
        needs = f"{variable} is a flag: write ids only" if is_flag else needs
        rows = read_rows(source, span, Layout(word, "i" + columns, needs=needs))
        fixed = rows.ints[:, 1] == 1 if word == "node" and not is_flag else np.zeros(len(rows.ints), bool)
        values = rows.ints[:, -1].astype(float) if kind == "truth" else rows.reals.ravel()
        data = Data(variable, rows.ints[:, 0], fixed, values, source.line(frame.offset))
    _note_missing(source, data, word, known)
    return data


def _read_arrays(source: Source, frame: Frame, is_nodal: bool, kind: str | None) -> Data:
    """Return rows of an id, for nodes a 0, and a vector or matrix."""
    shapes: list[tuple[int, ...]] = []

    def read(at: int, end: int) -> tuple[tuple[int, Array], int]:
        word = next(source.words((at, end)))
        number, at = integer(word.group()), word.end()
        if is_nodal:
            match = IS_FIXED.match(source.data, at, end)
            if match is None or match.group(1) not in TRUTH:
                raise ValueError("expected is_fixed, 0, before the vector")
            if TRUTH[match.group(1)]:
                raise ValueError("a vector cannot be fixed; fix its components _X, _Y, _Z in separate blocks")
            at = match.end()
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
    values = np.array([value for _, value in rows], dtype=float)
    free = np.zeros(len(ids), dtype=bool)
    return Data(frame.arguments[0], ids, free, values, source.line(frame.offset))


def _note_missing(source: Source, data: Data, word: str, known: Ints) -> None:
    """Refuse fixed values on missing nodes; note other values that have no place or stand twice."""
    missing = rows_of_ids(known, data.ids) < 0
    is_fixed = (missing & data.fixed).any()
    ids = data.ids[missing & data.fixed] if is_fixed else data.ids[missing]
    more = f" (and {len(ids) - 1} more)" if len(ids) > 1 else ""
    if is_fixed:
        text = f"{data.variable} is fixed on {word} {ids[0]}{more}, which the file does not have"
        source.problem_in_line(text, data.line)
    elif len(ids):
        text = f"{data.variable} on {word} {ids[0]}{more} is ignored: the file does not have it"
        source.note_in_line(text, data.line)
    if len(without_repeats(data.ids)) < len(data.ids):
        source.note_in_line(f"{data.variable} is given twice for a {word}; the last value counts", data.line)


def read_constraints(source: Source, frames: list[Frame], nodes: Ints) -> list[Constraint]:
    """Return the rows ``id constant [w1, w2] dependent independent …`` of some blocks.

    The variables in the header are those of the dependent and of each independent node, or one for all.
    The nodes must be among `nodes`.
    """
    constraints: list[Constraint] = []
    node_ids = set(nodes.tolist()) if frames else set()
    for frame in frames:
        if len(frame.arguments) < 2:
            source.problem("expected 'Begin Constraints NAME VARIABLE [VARIABLE …]'", frame.offset)
            continue
        read = partial(_constraint, source, frame, node_ids)
        block = list(source.each(frame.spans[0], "constraint", read))
        if len({len(c.independents) for c in block}) > 1:
            text = (
                "Kratos misreads a block of Constraints with different numbers of independent nodes; "
                "kratos_lite reads it as written; give each number a block of its own"
            )
            source.note(text, frame.offset)
        constraints += block
    ids = np.array([c.id for c in constraints], dtype=np.int64)
    source.refuse_repeated("constraint", ids, [c.line for c in constraints])
    return constraints


def _constraint(
    source: Source, frame: Frame, node_ids: set[int], at: int, end: int
) -> tuple[Constraint, int]:
    match = CONSTRAINT.match(source.data, at, end)
    if match is None:
        raise ValueError("expected 'id constant [w1, w2, …] dependent independent …'")
    number, constant = integer(match.group(1)), real(match.group(2))
    weights = tuple(real(part.strip()) for part in match.group(3).split(b","))
    words = [*islice(source.words((match.end(), end)), len(weights) + 1)]
    ids = [integer(word.group()) for word in words]
    if len(ids) <= len(weights):
        raise ValueError(f"has {len(weights)} weights, but {len(ids)} nodes; expected {len(weights) + 1}")
    name, dependent, *independents = frame.arguments
    if len(independents) != len(weights):
        if len(independents) > 1:
            raise ValueError(
                f"has {len(weights)} independent nodes, but the header names {len(independents)} variables"
            )
        independents = (independents or [dependent]) * len(weights)
    if missing := [node for node in ids if node not in node_ids]:
        raise ValueError(f"there is no node {missing[0]}")
    pairs = tuple(zip(ids[1:], independents, strict=True))
    line = source.line(at)
    return Constraint(number, (ids[0], dependent), pairs, weights, constant, line, name), words[-1].end()
