"""Cards of a deck: a keyword with its options, and the data lines that follow it."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from kratos_lite.errors import InputError, nearest
from kratos_lite.io.settings import inside
from kratos_lite.io.text import read_bytes, real, shown
from kratos_lite.typing import Array, Ints

_STARRED = re.compile(rb"^[ \t]*\*.*$", re.MULTILINE)
_OPTION = re.compile(r'\s*([^=,"]+?)\s*(?:=\s*("[^"]*"|[^,]*?))?\s*(?:,|$)')
_BLANKS = bytes.maketrans(b",dD", b" ee")
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

    def every(self) -> Array:
        """Return all numbers of the data in order, whatever the lines; InputError at the first wrong one."""
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            try:
                values = np.fromstring(self.data.translate(_BLANKS), sep=" ")
                if np.isfinite(values).all():
                    return values
            except (DeprecationWarning, ValueError):
                pass
        found = [[row.number(i) for i in range(len(row.fields)) if row.fields[i]] for row in self.rows()]
        return np.array([value for row in found for value in row])

    def ids(self, width: int) -> Ints:
        """Return all numbers as rows of `width` ids."""
        values = self.every()
        if values.size % width:
            self.wrong(f"{values.size} numbers are no rows of {width}")
        whole = values.astype(np.int64)
        if ((whole != values) | (whole < 1)).any():
            self.wrong(f"ids are whole numbers from 1; got {values[(whole != values) | (whole < 1)][0]:g}")
        return whole.reshape(-1, width)


def read_cards(path: Path, *, depth: int = 0) -> Iterator[Card]:
    """Yield the cards of a deck and of the files that it includes."""
    data = read_bytes(path)
    stars = [match for match in _STARRED.finditer(data)]
    starts = [m for m in stars if not m.group().lstrip().startswith(b"**")]
    head = data[: starts[0].start()] if starts else data
    stray = [line for line in head.split(b"\n") if line.strip() and not line.lstrip().startswith(b"**")]
    if stray or not starts:
        found = shown(stray[0]) if stray else "nothing"
        raise InputError(f"{path}: a deck begins with a card such as *NODE; got {found}")
    line, at = 1, 0
    has_comments = len(stars) > len(starts)
    for match, after in zip(starts, [*(m.start() for m in starts[1:]), len(data)], strict=True):
        line += data.count(b"\n", at, match.start())
        at = match.start()
        header, end = match.group().strip(), match.end()
        while header.endswith(b",") and end < after:  # the options go on in the next line
            stop = data.find(b"\n", end + 1, after)
            stop = after if stop < 0 else stop
            header, end = header + data[end + 1 : stop].strip(), stop
        body = data[end:after]
        if has_comments and b"**" in body:
            body = re.sub(rb"(?m)^[ \t]*\*\*.*$", b"", body)
        card = _card(header, body, str(path), line + data.count(b"\n", at, end))
        if card.keyword != "INCLUDE":
            yield card
        elif depth == DEEPEST:
            card.wrong("files include each other; remove one of the cards")
        else:
            name = card.option("INPUT").strip('"')
            try:
                yield from read_cards(inside(path.parent, name), depth=depth + 1)
            except ValueError as error:
                card.wrong(str(error)) if not isinstance(error, InputError) else None
                raise


def _card(header: bytes, data: bytes, file: str, line: int) -> Card:
    """Return a card from its first line."""
    keyword, _, rest = header.decode("utf-8", "replace")[1:].partition(",")
    options = {}
    for match in _OPTION.finditer(rest):
        if name := match.group(1).upper().replace(" ", ""):
            options[name] = (match.group(2) or "").strip('"')
    return Card("".join(keyword.upper().split()), options, file, line, data)
