"""Rows of numbers in an `.mdpa` block: a vectorized reader, and an exact one that finds what is wrong.

The fast readers, compiled and with NumPy, give up on anything unusual; only the exact reader decides
what is an error.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite.io.formats.mdpa.scan import SMALL, Source, Span
from kratos_lite.io.text import MAX_ID, integer, real, shown
from kratos_lite.native import kernels

BLANKS = b" \t\n\v\f"
DIGITS = b"0123456789"
FORTRAN = bytes.maketrans(b"dD", b"ee")
TRUTH = {b"1": 1, b"true": 1, b"True": 1, b"0": 0, b"false": 0, b"False": 0}
"""Words for true and false."""
Words = list[re.Match[bytes]]


@dataclass(frozen=True)
class Layout:
    """What a row holds.

    Attributes
    ----------
    word : what a row describes, e.g. ``element``.
    kinds : one letter a column: i id, p property id (may be 0), b true or false, r real.
    counted : what stands after the first `head` columns, e.g. ``nodes``.
    head : number of leading columns that are not counted in messages.
    needs : who asks for the width, e.g. ``KinematicLinear3D8N needs 8``.
    alone : each row stands on its own line, also where strict reading allows several.
    """

    word: str
    kinds: str
    counted: str = "values"
    head: int = 1
    needs: str = ""
    alone: bool = False


@dataclass(eq=False)
class Rows:
    """Columns of a block: ints (m, a), reals (m, b) and the line (m,) of each row."""

    ints: NDArray[np.int64]
    reals: NDArray[np.float64]
    lines: NDArray[np.int32]


def read_rows(source: Source, span: Span, layout: Layout) -> Rows:
    """Return the rows in a piece of the text; what is wrong goes to the problems of the source."""
    is_small = span[1] - span[0] < SMALL
    rows = None if is_small else _compiled(source, span, layout)
    return rows or _fast(source, span, layout) or _exact(source, span, layout)


def width_of_first_line(source: Source, span: Span) -> int:
    """Return the number of words on the first line that has any, or 0."""
    first = next(source.words(span), None)
    if first is None:
        return 0
    end = source.data.find(b"\n", first.start(), span[1])
    return len(source.data[first.start() : end if end >= 0 else span[1]].split())


def _compiled(source: Source, span: Span, layout: Layout) -> Rows | None:
    """Return the rows if each stands plain on a line of its own, else None."""
    text = kernels("text")
    found = text.rows(source.data, *span, layout.kinds, source.line(span[0])) if text else None
    return Rows(*found) if found else None


def _fast(source: Source, span: Span, layout: Layout) -> Rows | None:
    """Return the rows if every token is plain and every line is whole, else None."""
    text, kinds = source.data[span[0] : span[1]], layout.kinds
    k, is_plain = len(kinds), not set(kinds) - set("ip")
    if text.translate(None, BLANKS + DIGITS + (b"" if is_plain else b"+-.eEdD")):
        return None
    codes = np.frombuffer(text, dtype=np.uint8)
    inside = np.zeros(len(codes) + 2, dtype=np.int8)
    np.greater(codes, 32, out=inside[1:-1], casting="unsafe")
    step = np.diff(inside)
    starts = np.flatnonzero(step == 1)
    if not len(starts):
        return _rows(np.zeros((0, k), dtype=np.int64), np.zeros((0, k)), np.zeros(0, dtype=np.int32), kinds)
    if len(starts) % k or not _lines_are_whole(source, codes, starts, span, layout):
        return None
    values = _values(text, is_plain)
    if values is None or len(values) != len(starts):
        return None
    table, lines = values.reshape(-1, k), source.lines(starts[::k] + span[0])
    ints = table if is_plain else _integer_columns(codes, starts, np.flatnonzero(step == -1), kinds)
    if ints is None or _is_odd(ints, kinds):
        return None
    rows = _rows(ints, table, lines, kinds)
    return rows if np.isfinite(rows.reals).all() else None


def _integer_columns(
    codes: NDArray[np.uint8], starts: NDArray[np.int64], ends: NDArray[np.int64], kinds: str
) -> NDArray[np.int64] | None:
    """Return a table (m, k) with the columns of integers filled, or None where one holds other text."""
    k = len(kinds)
    ints = np.zeros((len(starts) // k, k), dtype=np.int64)
    for column, kind in enumerate(kinds):
        if kind != "r":
            plain = _digits(codes, starts[column::k], ends[column::k])
            if plain is None:
                return None
            ints[:, column] = plain
    return ints


def _is_odd(ints: NDArray[np.int64], kinds: str) -> bool:
    """Return whether an id is 0 or too large (then the largest), or a truth neither 0 nor 1."""
    low, high = ints.min(axis=0), ints.max(axis=0)
    limits = {"i": (1, MAX_ID - 1), "p": (0, MAX_ID - 1), "b": (0, 1), "r": (0, 0)}
    return any(low[c] < limits[kind][0] or high[c] > limits[kind][1] for c, kind in enumerate(kinds))


def _rows(ints: NDArray[np.int64], reals: NDArray[np.float64], lines: NDArray[np.int32], kinds: str) -> Rows:
    """Return the integer and the real columns of tables (m, k) that hold each kind in its place."""
    is_real = np.array([kind == "r" for kind in kinds], dtype=bool)
    return Rows(ints[:, ~is_real], np.ascontiguousarray(reals[:, is_real], dtype=float), lines)


def _lines_are_whole(
    source: Source, codes: NDArray[np.uint8], starts: NDArray[np.int64], span: Span, layout: Layout
) -> bool:
    """Return whether each line holds whole rows; note where it holds several."""
    if not source.strict:
        return True
    k = len(layout.kinds)
    bounds = np.concatenate([[0], np.searchsorted(starts, np.flatnonzero(codes == 10)), [len(starts)]])
    counts = np.diff(bounds)
    if (counts > k).any():
        if layout.alone or (counts % k).any():
            return False
        if k > 1:
            first = int(starts[bounds[np.argmax(counts > k)]])
            source.note(f"several rows on one line: {layout.word}s", span[0] + first)
        return True
    return bool(((counts == 0) | (counts == k)).all())


def _values(text: bytes, is_plain: bool) -> NDArray[Any] | None:
    """Return the integers or the reals of a text; None where one is malformed."""
    with warnings.catch_warnings():
        # numpy warns, where it should fail, about text that is not a number.
        warnings.simplefilter("error")
        try:
            if is_plain:
                return np.fromstring(text, dtype=np.int64, sep=" ")
            return np.fromstring(text.translate(FORTRAN), dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            return None


def _digits(
    codes: NDArray[np.uint8], starts: NDArray[np.int64], ends: NDArray[np.int64]
) -> NDArray[np.int64] | None:
    """Return tokens as integers, or None if one has other characters than digits or more than 18."""
    longest = int((ends - starts).max())
    if longest > 18:
        return None
    values = np.zeros(len(starts), dtype=np.int64)
    for place in range(longest):
        at = starts + place
        more = at < ends
        digit = codes[np.minimum(at, len(codes) - 1)].astype(np.int64) - 48
        if ((digit < 0) | (digit > 9))[more].any():
            return None
        values = np.where(more, 10 * values + digit, values)
    return values


def _exact(source: Source, span: Span, layout: Layout) -> Rows:
    """Return the rows token by token, and note each that is wrong."""
    kinds = layout.kinds
    k = len(kinds)
    ints: list[list[int]] = []
    reals: list[list[float]] = []
    offsets: list[int] = []
    noted = False
    for words in _groups(source, span, k):
        if len(words) % k or (layout.alone and source.strict and len(words) > k):
            _refuse_width(source, words, layout)
            continue
        if len(words) > k > 1 and not noted:
            noted = True
            source.note(f"several rows on one line: {layout.word}s", words[0].start())
        for first in range(0, len(words), k):
            row = _row(source, words[first : first + k], layout)
            if row is not None:
                ints.append([int(v) for v, kind in zip(row, kinds, strict=True) if kind != "r"])
                reals.append([v for v, kind in zip(row, kinds, strict=True) if kind == "r"])
                offsets.append(words[first].start())
    m, r = len(offsets), kinds.count("r")
    lines = source.lines(np.array(offsets, dtype=np.int64))
    return Rows(np.array(ints, dtype=np.int64).reshape(m, k - r), np.array(reals).reshape(m, r), lines)


def _groups(source: Source, span: Span, k: int) -> Iterator[Words]:
    """Return the words line by line, or k by k where line ends carry no meaning."""
    group: Words = []
    end = 0
    for word in source.words(span):
        is_new = b"\n" in source.data[end : word.start()] if source.strict else len(group) == k
        if group and is_new:
            yield group
            group = []
        group.append(word)
        end = word.end()
    if group:
        yield group


def _row(source: Source, words: Words, layout: Layout) -> list[float] | None:
    values: list[float] = []
    for word, kind in zip(words, layout.kinds, strict=True):
        try:
            values.append(_number(word.group(), kind))
        except ValueError as error:
            owner = f"{layout.word} {_text(words[0])}: " if word is not words[0] else ""
            source.problem(f"{owner}{error}", word.start())
            return None
    return values


def _number(token: bytes, kind: str) -> float:
    if kind == "r":
        return real(token)
    if kind == "b":
        word = (token.lstrip(b"0") or b"0") if token.isdigit() else token
        if word not in TRUTH:
            raise ValueError(f"{shown(token)} is neither true nor false; write 1 or 0")
        return TRUTH[word]
    return 0 if kind == "p" and not token.strip(b"0") else integer(token)


def _text(word: re.Match[bytes]) -> str:
    return word.group()[:20].decode("ascii", "replace")


def _refuse_width(source: Source, words: Words, layout: Layout) -> None:
    k = len(layout.kinds)
    found = f"{layout.word} {_text(words[0])} has {len(words) - layout.head} {layout.counted}"
    hint = "; a row must stand whole on one line, unless strict=False" if source.strict else ""
    if len(words) % k == 0:
        hint = f"; {len(words) // k} rows on one line? Write one a line, or read with strict=False"
        if layout.word == "node" and len(words) == 2 * k:
            hint = "; two nodes on one line? Write one a line, or read with strict=False"
    source.problem(f"{found}; {layout.needs or f'expected {k - layout.head}'}{hint}", words[0].start())
