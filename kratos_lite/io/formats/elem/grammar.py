"""Grammar of the five-file `.elem` set: statements as patterns, with exact places for errors.

Each statement is written down once, as words between blanks.  From that text come the regular expression
that reads whole runs of statements, and the walk, word by word, that finds out what is wrong where.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from kratos_lite.errors import Problems, nearest
from kratos_lite.io.formats.document import Note
from kratos_lite.io.text import Source as TextSource
from kratos_lite.io.text import blank_comments, integer, read_bytes, real
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
KEYWORDS = ("NODES", "ELEMENTS", "CONDITIONS", "PROPERTIES", "ElementsGroup")
HOME = {"NODES": ".node, .cond or .init", "ELEMENTS": ".elem", "CONDITIONS": ".cond", "PROPERTIES": ".prop"}

_KEY = "|".join(KEYWORDS).encode()
_NEXT_STATEMENT = re.compile(rb"(?<=[\s;])(?:%b)\b" % _KEY)
_BLANKS = re.compile(rb"[\s;]*")
_EXPONENTS = bytes.maketrans(b"dD", b"ee")
_FOUND = re.compile(rb"[\w.+-]+|[^\s]")


@dataclass(frozen=True)
class Form:
    """One kind of statement, or of row in a list."""

    text: str  # the words between blanks; ``<…>`` are the values.
    row: Form | None = None  # form of the rows, if this statement opens a list that ``] )`` closes.

    @cached_property
    def words(self) -> list[tuple[re.Pattern[bytes], str]]:
        """The pattern of each word, and what to call it when it is missing."""
        return [(re.compile(pattern), name) for pattern, name in map(_word, self.text.split())]

    @property
    def ends(self) -> bool:
        """Whether this is a whole statement, which may end with semicolons."""
        return not (self.text.startswith(("[", "]")) or self.row)

    @cached_property
    def match(self) -> Callable[[bytes, int], re.Match[bytes] | None]:
        """Match one statement, with the ``;`` after it."""
        ending = rb"[\s;]*" if self.ends else rb""
        return re.compile(b"".join(_word(word)[0] for word in self.text.split()) + ending).match

    @cached_property
    def resume(self) -> re.Pattern[bytes]:
        """Where to go on after a broken row: at the next row, the end of the list, or another statement."""
        # An inner list must not pass for the next row: "[1, [2, …" is one row, "[2, …" is none.
        count = 4 if "<ids>" in self.text else 3
        row = b"".join(_word(word)[0] for word in self.text.split()[:count])
        return re.compile(rb"%b|\]\s*\)|%b" % (row, _NEXT_STATEMENT.pattern))

    def __str__(self) -> str:
        return self.text.replace(" ", "").replace("=", " = ").replace(",", ", ") + (
            " … ])" if self.row else ""
        )


def _word(word: str) -> tuple[bytes, str]:
    if word in WORDS:
        return WORDS[word]
    return re.escape(word.encode()) + (rb"\b\s*" if word.isalpha() else rb"\s*"), repr(word)


@dataclass
class Run:
    """Statements or rows of one form that follow each other: their values by column, and their offsets."""

    form: Form
    head: tuple[bytes, ...] = ()
    columns: list[Sequence[bytes]] = field(default_factory=list)
    starts: list[int] = field(default_factory=list)


CLOSE = Form("] )")


class Source(TextSource):
    """One file of the set, plain or gzipped: its bytes without comments, and places in it for messages."""

    def __init__(self, path: Path, problems: Problems, notes: list[Note]) -> None:
        data = blank_comments(read_bytes(path), str(path))
        super().__init__(str(path), data, problems, notes, path.name)

    def integers(self, tokens: Iterable[bytes], starts: Sequence[int] | Ints, least: int = 1) -> Ints:
        """Convert tokens, or commas between them; ids below `least` or beyond 2^63-1 are problems.

        `starts` are the offsets of the statements that hold the integers.
        """
        text = b" ".join(tokens).replace(b",", b" ")
        values = np.fromstring(text, dtype=np.int64, sep=" ")
        self._check(text, starts, (values < least) | (values == np.iinfo(np.int64).max), integer)
        return values

    def reals(self, tokens: Iterable[bytes], starts: Sequence[int] | Ints) -> Array:
        """Convert tokens, or commas between them; a number too large for a float is a problem."""
        text = b" ".join(tokens).replace(b",", b" ").translate(_EXPONENTS)
        values = np.fromstring(text, sep=" ")
        self._check(text, starts, ~np.isfinite(values), real)
        return values

    def _check(
        self,
        text: bytes,
        starts: Sequence[int] | Ints,
        doubtful: Mask,
        read: Callable[[bytes], float],
    ) -> None:
        """Ask the exact reader of single tokens about the doubtful ones."""
        tokens = text.split() if doubtful.any() else []
        for i in np.flatnonzero(doubtful).tolist():
            try:
                read(tokens[i])
            except ValueError as reason:
                self.problem(str(reason), int(starts[i]))

    def scan(self, forms: Sequence[Form]) -> list[Run]:
        """Read the whole file as statements of these forms; what fits none of them is a problem."""
        runs: list[Run] = []
        opened: Run | None = None
        position = self._skip(0)
        while position < len(self.data) or opened:
            inside = opened.form.row if opened else None
            for form in (inside,) if inside else forms:
                run, after = self._take(form, position)
                if run.starts:
                    break
            if run.starts and form.row:
                opened = Run(form, tuple(column[0] for column in run.columns), [], run.starts)
            elif run.starts:
                run.head = opened.head if opened else ()
                runs.append(run)
            elif close := CLOSE.match(self.data, position):
                if not opened:  # GiD templates wrote the end of a list even where they left out its beginning
                    self.note("'])' closes no list; ignored", position)
                opened, after = None, self._skip(close.end())
            else:
                after, stay = self._explain(position, forms, opened)
                opened = opened if stay else None
            position = after
        return runs

    def _skip(self, position: int) -> int:
        found = _BLANKS.match(self.data, position)
        return found.end() if found else position

    def _take(self, form: Form, position: int) -> tuple[Run, int]:
        """Take as many statements of one form as follow each other here."""
        data, match = self.data, form.match
        rows: list[tuple[bytes, ...]] = []
        starts: list[int] = []
        while found := match(data, position):
            rows.append(found.groups(b""))
            starts.append(position)
            position = found.end()
        return Run(form, (), list(zip(*rows, strict=True)), starts), position

    def _explain(self, start: int, forms: Sequence[Form], opened: Run | None) -> tuple[int, bool]:
        """Note what is wrong at `start`; return where to go on, and whether still inside the list."""
        choices = (opened.form.row or CLOSE, CLOSE) if opened else forms
        ends = [self._walk(form, start) for form in choices]
        place = max(end for end, _ in ends)
        wanted = list(dict.fromkeys(name for end, names in ends if end == place for name in names))
        found = _FOUND.match(self.data, place)
        word = found.group()[:60] if found else b""
        if place == start and not opened:
            self.problem(_unknown(word, forms), place)
        else:
            self.problem(_unexpected(word, wanted) + self._opened_at(opened), place)
        resume = (choices[0].resume if opened else _NEXT_STATEMENT).search(self.data, start + 1)
        after = resume.start() if resume else len(self.data)
        return after, bool(opened and resume) and self.data[after : after + 1] in (b"[", b"]")

    def _walk(self, form: Form, place: int) -> tuple[int, list[str]]:
        """Go along a form as far as it fits; return where it ends and what could stand there."""
        many = ""
        for pattern, name in form.words:
            found = pattern.match(self.data, place)
            if not found:
                return place, [many] if many else [name]
            place = found.end()
            # After "[" and "[1, 2," a value is the likelier wish than the "]" that would also do.
            many = name if pattern.pattern in _MANY and found.group().rstrip()[-1:] in b"," else ""
        return place, ["the end of the statement"]

    def _opened_at(self, opened: Run | None) -> str:
        return f" (in the list opened at line {self.line(opened.starts[0])})" if opened else ""


_MANY = tuple(WORDS[word][0] for word in ("<ids>", "<reals>", "<rows>"))


def _unknown(word: bytes, forms: Sequence[Form]) -> str:
    text = word.decode("ascii", "replace")
    if text in HOME:
        hint = f" {text} statements of other kinds belong in {HOME[text]}."
    elif text == ",":
        hint = " A decimal comma? Write 1.0."
    else:
        hint = nearest(text, KEYWORDS)
    return f"unknown statement {_quoted(word)}; expected {' or '.join(map(str, forms))}.{hint}"


def _unexpected(word: bytes, wanted: Sequence[str]) -> str:
    if not word:
        return f"the file ends inside a statement; expected {' or '.join(wanted)}"
    for kind, read in (("an id", integer), ("a number", real)):
        if kind in wanted and re.match(rb"[\w.+-]", word):
            try:
                read(word)
            except ValueError as reason:
                return str(reason)
    hint = "; a decimal comma? write 1.0" if word == b"," else ""
    return f"found {_quoted(word)}; expected {' or '.join(wanted)}{hint}"


def _quoted(word: bytes) -> str:
    """Return the word in quotes, with escapes for what is not printable ASCII."""
    return repr(word)[1:]
