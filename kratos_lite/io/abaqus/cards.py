"""Cards of a deck: a keyword with its options, and the data lines that follow it."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from kratos_lite.errors import InputError, nearest
from kratos_lite.io.settings import inside
from kratos_lite.io.text import read_bytes, real, shown
from kratos_lite.native import kernels
from kratos_lite.typing import Array, Ints

_BROKEN = re.compile(rb",[ \t]*\n")
"""Where a row goes on in the next line."""
_OPTION = re.compile(r'\s*([^=,"]+?)\s*(?:=\s*("[^"]*"|[^,]*?))?\s*(?:,|$)')
_BLANKS, _LINES = bytes.maketrans(b",", b" "), bytes.maketrans(b", \t", b"\n\n\n")
LISTS = frozenset(
    "NODE ELEMENT NSET ELSET BOUNDARY CLOAD DLOAD DSLOAD TEMPERATURE EQUATION INITIALCONDITIONS".split()
)
"""Cards whose lines each stand for themselves, so that they may be several cards."""
DEEPEST = 20
"""Files that are included in each other."""


@dataclass(frozen=True)
class Row:
    """The fields of a data line, and its place."""

    place: str
    fields: tuple[str, ...]

    def wrong(self, text: str) -> NoReturn:
        """Raise InputError at this line."""
        raise InputError(f"{self.place}: {text}")

    def text(self, i: int, default: str | None = None) -> str:
        """Return a field, or the default where it is empty."""
        if i < len(self.fields) and self.fields[i]:
            return self.fields[i]
        if default is None:
            self.wrong(f"value {i + 1} of the line is missing; got {', '.join(self.fields)!r}")
        return default

    def number(self, i: int, default: float | None = None) -> float:
        """Return a number, or the default where the field is empty."""
        field = self.text(i, None if default is None else "")
        try:
            return real(field.encode()) if field else float(default or 0.0)
        except ValueError as error:
            self.wrong(str(error))

    def integer(self, i: int, default: int | None = None) -> int:
        """Return a whole number, or the default where the field is empty."""
        value = self.number(i, default)
        return int(value) if value == int(value) else self.wrong(f"{self.fields[i]!r} is no whole number")

    def numbers(self, count: int, first: int = 0) -> list[float]:
        """Return `count` numbers."""
        return [self.number(first + i) for i in range(count)]


@dataclass(frozen=True)
class Card:
    """A keyword in capitals without blanks, its options, its place, and the text of its data lines."""

    keyword: str
    options: dict[str, str]
    file: str
    line: int
    data: bytes

    @property
    def place(self) -> str:
        """File and line."""
        return f"{self.file}:{self.line}"

    def wrong(self, text: str) -> NoReturn:
        """Raise InputError at the card."""
        raise InputError(f"{self.place}: *{self.keyword}: {text}")

    def option(self, name: str, default: str | None = None) -> str:
        """Return an option; InputError where it is missing and has no default."""
        if name not in self.options and default is None:
            self.wrong(f"{name}= is missing")
        return self.options.get(name) or default or ""

    def check_options(self, known: tuple[str, ...]) -> None:
        """Raise InputError for an option that is not known."""
        for name in self.options:
            if name not in known:
                hint = nearest(name, known)
                self.wrong(f"option {name} is not supported.{hint} There are {', '.join(known) or 'none'}")

    def rows(self) -> Iterator[Row]:
        """Yield the data lines that are not empty."""
        for i, line in enumerate(self.data.split(b"\n"), self.line):
            if line.strip():
                fields = line.decode("utf-8", "replace").strip().rstrip(",").split(",")
                yield Row(f"{self.file}:{i}", tuple(field.strip() for field in fields))

    def plain(self, kinds: str) -> tuple[Ints, Array, Ints] | None:
        """Return integers (m, a), reals (m, b) and lines of plain rows, or None; `kinds` are i and r."""
        if (text := kernels("text")) is None:
            return None
        data = self.data.translate(_LINES if len(kinds) == 1 else _BLANKS)
        found = text.rows(data, 0, len(data), kinds, self.line)
        if found is None and len(kinds) > 1 and len(data := _BROKEN.sub(b" ", self.data)):
            data = data.translate(_BLANKS)
            found = text.rows(data, 0, len(data), kinds, self.line)
        return found

    def every(self, width: int = 0) -> Array:
        """Return all numbers in order, by lines or so that each line ends a row of `width` or goes on in it.

        InputError at the first wrong one.
        """
        found = list[float]()
        for row in self.rows():
            numbers = [row.number(i) for i in range(len(row.fields)) if row.fields[i]]
            found += numbers[: width - len(found) % width] if width else numbers
        return np.array(found)

    def ids(self, width: int, notes: list[str] | None = None) -> Ints:
        """Return all numbers as rows of `width` ids; with notes a line ends a row, and may hold more."""
        if plain := self.plain("i" * width):
            return plain[0]
        values = self.every(width if notes is not None else 0)
        if notes is not None and len(values) < len(self.every()):
            notes.append(f"{self.place}: *{self.keyword}: what stands behind {width} numbers is ignored")
        if values.size % width:
            self.wrong(f"{values.size} numbers are no rows of {width}")
        whole = values.astype(np.int64)
        if ((whole != values) | (whole < 1)).any():
            self.wrong(f"ids are whole numbers from 1; got {values[(whole != values) | (whole < 1)][0]:g}")
        return whole.reshape(-1, width)


def read_cards(path: Path, *, before: Card | None = None, depth: int = 0) -> Iterator[Card]:
    """Yield the cards of a deck and of the files that it includes, which may go on with a card before."""
    data = read_bytes(path)
    stars = list(_starred(data))
    comments = [at for at in stars if data.startswith(b"**", at)]
    starts = [at for at in stars if not data.startswith(b"**", at)]
    lead = _uncommented(data, 0, starts[0] if starts else len(data), comments)
    if lead.strip() and before:
        before = _continued(before, str(path), 1, lead)
        yield before
    elif lead.strip() or not starts:
        found = shown(lead.strip().split(b"\n")[0]) if lead.strip() else "nothing"
        raise InputError(f"{path}: a deck begins with a card such as *NODE; got {found}")
    line, last = 1, 0
    for at, after in zip(starts, [*starts[1:], len(data)], strict=False):
        line += data.count(b"\n", last, at)
        last, end = at, _line_end(data, at)
        header = data[at:end].strip()
        while header.endswith(b",") and end < after:  # the options may go on in the next line
            stop = _line_end(data, end + 1)
            if b"=" not in data[end + 1 : stop]:
                break
            header, end = header + data[end + 1 : stop].strip(), stop
        body = _uncommented(data, end, after, comments)
        card = _card(header, body, str(path), line + data.count(b"\n", at, end))
        if card.keyword != "INCLUDE":
            before = card
            yield card
            continue
        if depth == DEEPEST:
            card.wrong("files include each other; remove one of the cards")
        for each in read_cards(_included(path, card), before=before, depth=depth + 1):
            before = each
            yield each
        if card.data.strip() and before:
            yield _continued(before, card.file, card.line, card.data)


def _continued(card: Card, file: str, line: int, data: bytes) -> Card:
    """Return a card whose data are in another file, or go on there."""
    if card.data.strip() and card.keyword not in LISTS:
        text = f"the data of *{card.keyword} of {card.place} go on here; put them in one file"
        raise InputError(f"{file}:{line}: {text}")
    return replace(card, file=file, line=line, data=data)


def _starred(data: bytes) -> Iterator[int]:
    """Yield where a star is the first in its line."""
    at = data.find(b"*")
    while at >= 0:
        if not data[data.rfind(b"\n", 0, at) + 1 : at].strip():
            yield at
        at = data.find(b"\n", at)
        at = data.find(b"*", at) if at >= 0 else at


def _uncommented(data: bytes, first: int, last: int, comments: list[int]) -> bytes:
    """Return data[first:last] without the comments that begin at some places, but with their lines."""
    parts = []
    for at in comments[bisect_left(comments, first) : bisect_left(comments, last)]:
        parts.append(data[first:at])
        first = _line_end(data, at)
    return b"".join([*parts, data[first:last]])


def _line_end(data: bytes, at: int) -> int:
    end = data.find(b"\n", at)
    return end if end >= 0 else len(data)


def _included(path: Path, card: Card) -> Path:
    try:
        return inside(path.parent, card.option("INPUT"))
    except InputError:
        raise
    except ValueError as error:
        card.wrong(str(error))


def _card(header: bytes, data: bytes, file: str, line: int) -> Card:
    """Return a card from its first line."""
    keyword, _, rest = header.decode("utf-8", "replace")[1:].partition(",")
    options = {}
    for match in _OPTION.finditer(rest):
        if name := match.group(1).upper().replace(" ", ""):
            options[name] = (match.group(2) or "").strip('"')
    return Card("".join(keyword.upper().split()), options, file, line, data)
