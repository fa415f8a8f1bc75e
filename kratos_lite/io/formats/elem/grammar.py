"""Grammar of the five-file `.elem` set: statements as patterns, with exact places for errors.

Each statement is written down once, as words between blanks. From that text come the regular expression
that reads it, and the walk, word by word, that finds out what is wrong where.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.errors import Problems, nearest
from kratos_lite.io.formats.document import Note
from kratos_lite.io.text import MAX_ID, blank_comments, integer, read_bytes, real
from kratos_lite.io.text import Source as TextSource
from kratos_lite.typing import Array, Ints, Mask

INT = rb"\d+(?![\w.+-])"
REAL = rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?(?![\w.+-])"
REALS = rb"%b(?:\s*,\s*%b)*" % (REAL, REAL)
ROW = rb"\[\s*%b\s*(?:,\s*)?\]" % REALS
# Every pattern takes the blanks after it and never starts with blanks: matching stays linear in time.
WORDS = {
    "<id>": (rb"(%b)\s*" % INT, "an id"),
    "<number>": (rb"(%b)\s*" % INT, "an integer"),
    "<real>": (rb"(%b)\s*" % REAL, "a number"),
    "<Name>": (rb"([A-Za-z_]\w*)\s*", "a name"),
    "<ids>": (rb"(?:(%b(?:\s*,\s*%b)*)\s*(?:,\s*)?)?" % (INT, INT), "an id"),
    "<reals>": (rb"(%b)\s*(?:,\s*)?" % REALS, "a number"),
    "<rows>": (rb"(%b(?:\s*,\s*%b)*)\s*(?:,\s*)?" % (ROW, ROW), "a row [number, …]"),
    "<next>": (rb"(?:,\s*|(?=\]))", "',' or ']'"),
}
HOME = {
    **{"NODES": ".node, .cond or .init", "ELEMENTS": ".elem", "CONDITIONS": ".cond", "PROPERTIES": ".prop"},
    "ElementsGroup": ".elem",
}
"""Files in which statements that begin with a word belong."""
NEXT_STATEMENT = rb"(?<=[\s;])(?:%b)\b" % "|".join(HOME).encode()
_BLANKS = re.compile(rb"[\s;]*")
_FOUND = re.compile(rb"[\w.+-]+|\S")
_PLAIN = bytes.maketrans(b",dD", b" ee")


class Form:
    """One kind of statement, or of row in a list: words between blanks, of which ``<…>`` are the values.

    `row` is the form of the rows, if this statement opens a list, which ``] )`` closes.
    """

    def __init__(self, text: str, row: Form | None = None) -> None:
        self.text, self.row = text, row
        self.words = [_word(word) for word in text.split()]

    @cached_property
    def match(self) -> Callable[[bytes, int], re.Match[bytes] | None]:
        """Match one statement, with the ``;`` after it."""
        is_whole = not self.row and self.text[0] not in "[]"
        pattern = b"".join(pattern for pattern, _ in self.words)
        return re.compile(pattern + (rb"[\s;]*" if is_whole else b"")).match

    def walk(self, data: bytes, place: int) -> tuple[int, str]:
        """Go along this form as far as it fits; return where it ends and what could stand there."""
        many = ""
        for pattern, name in self.words:
            found = re.compile(pattern).match(data, place)
            if not found:
                return place, many or name
            place = found.end()
            # After "[" and "[1, 2," a value is the likelier wish than the "]" that would also do.
            many = name if pattern in _MANY and found.group().rstrip()[-1:] in b"," else ""
        return place, "the end of the statement"

    def next_row(self, data: bytes, start: int) -> re.Match[bytes] | None:
        """Find where to go on after a broken row: the next row, the end of the list, or a statement."""
        # An inner list must not pass for the next row: "[1, [2, …" is one row, "[2, …" is none.
        words = self.words[: 4 if "<ids>" in self.text else 3]
        row = b"".join(pattern for pattern, _ in words)
        return re.compile(rb"%b|\]\s*\)|%b" % (row, NEXT_STATEMENT)).search(data, start)

    def __str__(self) -> str:
        text = self.text.replace(" ", "").replace("=", " = ").replace(",", ", ")
        return text + (" … ])" if self.row else "")


def _word(word: str) -> tuple[bytes, str]:
    """Return the pattern of a word, and what to call it when it is missing."""
    if word in WORDS:
        return WORDS[word]
    return re.escape(word.encode()) + (rb"\b\s*" if word.isalpha() else rb"\s*"), repr(word)


_MANY = tuple(WORDS[word][0] for word in ("<ids>", "<reals>", "<rows>"))
CLOSE = Form("] )")
_CELL = Form("[ <id> , [ <ids> ] , <number> ] <next>")
FIX = Form("NODES [ <id> ] . Fix ( <Name> )")
INIT = Form("NODES [ <id> ] ( <Name> , <number> ) = <real>")
VECTOR = Form("PROPERTIES [ <number> ] [ <Name> ] = [ <reals> ]")
MATRIX = Form("PROPERTIES [ <number> ] [ <Name> ] = [ <rows> ]")
FORMS = {
    ".node": (
        Form("NODES = NodesList ( [", Form("[ <id> , <real> , <real> , <real> ] <next>")),
        Form("NODES [ <id> ] = Node ( <real> , <real> , <real> )"),
    ),
    ".elem": (
        Form("ELEMENTS [ <id> ] = <Name> ( [ <ids> ] , <number> )"),
        Form("ELEMENTS = ElementsList ( <Name> , [", _CELL),
        Form("ElementsGroup = <Name>"),
    ),
    ".cond": (
        FIX,
        Form("CONDITIONS [ <id> ] = <Name> ( [ <ids> ] , <number> )"),
        Form("CONDITIONS = ConditionsList ( <Name> , [", _CELL),
    ),
    ".prop": (Form("PROPERTIES [ <number> ] [ <Name> ] = <real>"), VECTOR, MATRIX),
    ".init": (INIT,),
}
"""Statements of each file."""


Statement: TypeAlias = "tuple[Any, ...]"
"""Form, offset and values of a statement or of a row of a list; there the list's name comes behind the id."""
Opened: TypeAlias = "tuple[Form, int, tuple[bytes, ...]] | None"
"""Form of the rows, offset and values of a statement that has opened a list."""


class Source(TextSource):
    """One file of the set, plain or gzipped: its bytes without comments, and places in it for messages."""

    def __init__(self, path: Path, problems: Problems, notes: list[Note]) -> None:
        data = blank_comments(read_bytes(path), str(path))
        super().__init__(str(path), data, problems, notes, path.name)

    def integers(self, tokens: Iterable[bytes], starts: Sequence[int] | Ints, least: int = 1) -> Ints:
        """Convert tokens, or commas between them; ids below `least` or beyond 2^63-1 are problems.

        `starts` are the offsets of the statements that hold the integers.
        """
        text = b" ".join(tokens).translate(_PLAIN)
        values = np.fromstring(text, dtype=np.int64, sep=" ")
        self._check(text, starts, (values < least) | (values == MAX_ID), integer)
        return values

    def reals(self, tokens: Iterable[bytes], starts: Sequence[int] | Ints) -> Array:
        """Convert tokens, or commas between them; a number too large for a float is a problem."""
        text = b" ".join(tokens).translate(_PLAIN)
        values = np.fromstring(text, sep=" ")
        self._check(text, starts, ~np.isfinite(values), real)
        return values

    def _check(
        self, text: bytes, starts: Sequence[int] | Ints, doubtful: Mask, read: Callable[[bytes], Any]
    ) -> None:
        """Ask the exact reader of single tokens about the doubtful ones."""
        tokens = text.split() if doubtful.any() else []
        for i in np.flatnonzero(doubtful).tolist():
            try:
                read(tokens[i])
            except ValueError as reason:
                self.problem(str(reason), int(starts[i]))

    def scan(self, forms: Sequence[Form]) -> list[Statement]:
        """Read the whole file as statements of these forms; what fits none of them is a problem."""
        statements: list[Statement] = []
        opened: Opened = None
        place = self._skip(0)
        while place < len(self.data) or opened:
            start = place
            name = opened[2] if opened else ()
            for form in opened[:1] if opened else forms:
                while found := form.match(self.data, place):
                    values = found.groups(b"")
                    if form.row:
                        opened, place = (form.row, place, values), found.end()
                        break
                    statements.append(
                        (form, place, *values[:1], *name, *values[1:]) if name else (form, place, *values)
                    )
                    place = found.end()
                if place > start:
                    break
            else:
                place, opened = self._close(place, opened) or self._explain(place, forms, opened)
        return statements

    def _skip(self, place: int) -> int:
        found = _BLANKS.match(self.data, place)
        return found.end() if found else place

    def _close(self, place: int, opened: Opened) -> tuple[int, None] | None:
        """Return the place behind the end of a list, if there is one here."""
        close = CLOSE.match(self.data, place)
        if close and not opened:  # GiD templates wrote the end of a list even where its beginning is missing
            self.note("'])' closes no list; ignored", place)
        return (self._skip(close.end()), None) if close else None

    def _explain(self, start: int, forms: Sequence[Form], opened: Opened) -> tuple[int, Opened]:
        """Note what is wrong at `start`; return where to go on, and the list that is still open there."""
        ends = [form.walk(self.data, start) for form in ((opened[0], CLOSE) if opened else forms)]
        place = max(end for end, _ in ends)
        wanted = " or ".join(dict.fromkeys(name for end, name in ends if end == place))
        found = _FOUND.match(self.data, place)
        word = found.group()[:60] if found else b""
        if opened:
            within = f" (in the list opened at line {self.line(opened[1])})"
            self.problem(_unexpected(word, wanted) + within, place)
            resume = opened[0].next_row(self.data, start + 1)
        else:
            self.problem(_unexpected(word, wanted) if place > start else _unknown(word, forms), place)
            resume = re.compile(NEXT_STATEMENT).search(self.data, start + 1)
        after = resume.start() if resume else len(self.data)
        return after, opened if resume and self.data[after : after + 1] in (b"[", b"]") else None


def _unknown(word: bytes, forms: Sequence[Form]) -> str:
    text = word.decode("ascii", "replace")
    hint = f" {text} statements of other kinds belong in {HOME[text]}." if text in HOME else ""
    hint = hint or (" A decimal comma? Write 1.0." if text == "," else nearest(text, HOME))
    return f"unknown statement {_quoted(word)}; expected {' or '.join(map(str, forms))}.{hint}"


def _unexpected(word: bytes, wanted: str) -> str:
    if not word:
        return f"the file ends inside a statement; expected {wanted}"
    for kind, read in (("an id", integer), ("a number", real)):
        if kind in wanted.split(" or ") and re.match(rb"[\w.+-]", word):
            try:
                read(word)
            except ValueError as reason:
                return str(reason)
    hint = "; a decimal comma? write 1.0" if word == b"," else ""
    return f"found {_quoted(word)}; expected {wanted}{hint}"


def _quoted(word: bytes) -> str:
    """Return the word in quotes, with escapes for what is not printable ASCII."""
    return repr(word)[1:]
