"""Rows of numbers in an `.mdpa` block: a compiled reader, and an exact one that finds what is wrong.

The compiled reader gives up on anything unusual; only the exact reader decides what is an error.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kratos_lite.io.formats.mdpa.scan import SMALL, Source, Span
from kratos_lite.io.text import integer, real, shown
from kratos_lite.native import kernels
from kratos_lite.typing import Array, Ints

TRUTH = {b"1": 1, b"true": 1, b"True": 1, b"0": 0, b"false": 0, b"False": 0}
"""Words for true and false."""
LINE = re.compile(rb"[^\n]+")
Words = list[re.Match[bytes]]


@dataclass(frozen=True)
class Layout:
    """What a row holds."""

    word: str  # what a row describes, e.g. ``element``.
    kinds: str  # one letter a column: i id, p property id (may be 0), b true or false, r real.
    counted: str = "values"  # what stands after the first `head` columns, e.g. ``nodes``.
    head: int = 1  # number of leading columns that are not counted in messages.
    needs: str = ""  # who asks for the width, e.g. ``KinematicLinear3D8N needs 8``.
    alone: bool = False  # each row stands on its own line, also where strict reading allows several.


@dataclass(eq=False)
class Rows:
    """Columns of a block: ints (m, a), reals (m, b) and the line (m,) of each row."""

    ints: Ints
    reals: Array
    lines: NDArray[np.int32]


def read_rows(source: Source, span: Span, layout: Layout) -> Rows:
    """Return the rows in a span; what is wrong goes to the problems of the source."""
    is_large = span[1] - span[0] >= SMALL
    return (_compiled(source, span, layout) if is_large else None) or _exact(source, span, layout)


def first_line(source: Source, span: Span) -> bytes:
    """Return the first line that has words; nothing where there is none."""
    first = next(source.words(span), None)
    return source.data[first.start() : source.line_end(first.start(), span[1])] if first else b""


def _compiled(source: Source, span: Span, layout: Layout) -> Rows | None:
    """Return the rows if each stands plain on a line of its own, else None."""
    text = kernels("text")
    columns = text.rows(source.data, *span, layout.kinds, source.line(span[0])) if text else None
    return Rows(*columns) if columns else None


def _exact(source: Source, span: Span, layout: Layout) -> Rows:
    """Return the rows token by token, and note each that is wrong."""
    kinds, k = layout.kinds, len(layout.kinds)
    rows: list[list[float]] = []
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
                rows.append(row)
                offsets.append(words[first].start())
    m, r = len(rows), kinds.count("r")
    ints = [int(v) for row in rows for v, kind in zip(row, kinds, strict=True) if kind != "r"]
    reals = [v for row in rows for v, kind in zip(row, kinds, strict=True) if kind == "r"]
    lines = source.lines(np.array(offsets, dtype=np.int64))
    return Rows(np.array(ints, dtype=np.int64).reshape(m, k - r), np.array(reals).reshape(m, r), lines)


def _groups(source: Source, span: Span, k: int) -> list[Words]:
    """Return the words line by line, or k by k where line ends carry no meaning."""
    if source.strict:
        lines = ([*source.words(line.span())] for line in LINE.finditer(source.data, *span))
        return [words for words in lines if words]
    words = [*source.words(span)]
    return [words[i : i + k] for i in range(0, len(words), k)]


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
    text = f"{layout.word} {_text(words[0])} has {len(words) - layout.head} {layout.counted}"
    hint = "; a row must stand whole on one line, unless strict=False" if source.strict else ""
    if len(words) % k == 0:
        hint = f"; {len(words) // k} rows on one line? Write one a line, or read with strict=False"
    source.problem(f"{text}; {layout.needs or f'expected {k - layout.head}'}{hint}", words[0].start())
