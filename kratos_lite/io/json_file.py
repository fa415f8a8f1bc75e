"""Strict JSON: every mistake is an error with its line and column, and every key knows its place."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path
from typing import Any

from kratos_lite.errors import InputError
from kratos_lite.io.text import line_column, read_bytes

MAX_DEPTH = 64
"""Deepest nesting of objects and lists."""
MAX_DIGITS = 19
"""Longest integer; more digits do not fit into 64 bits."""
_SPACE = re.compile(r"(?:[ \t\n\r]+|//[^\n]*|/\*.*?\*/)*", re.DOTALL)
_STRING = re.compile(r'"(?:[^"\\\x00-\x1f]|\\.)*"')
_NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?")
_WORD = re.compile(r"[-+\w.]+")
_CONSTANTS = {"true": True, "false": False, "null": None}


class Object(dict[str, Any]):
    """A JSON object that knows the line and column of each of its keys.

    Attributes
    ----------
    places : key → (line, column), both from 1.
    """

    def __init__(self) -> None:
        super().__init__()
        self.places: dict[str, tuple[int, int]] = {}


def read_json(path: str | Path) -> Any:
    """Return what a JSON file says; objects come as `Object`.

    Comments ``// …`` and ``/* … */`` are skipped, as Kratos does.

    Raises
    ------
    InputError
        ``file:line:column: …`` for anything that is not strict JSON in UTF-8: a key that is given
        twice, NaN or Infinity, a trailing comma, nesting deeper than 64, an integer of more than
        19 digits, a number that overflows.
    """
    data = read_bytes(path)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        line, column = line_column(data, error.start)
        raise InputError(
            f"{path}:{line}:{column}: byte 0x{data[error.start]:02x} is not UTF-8; save the file as UTF-8"
        ) from None
    return parse_json(text, str(path))


def parse_json(text: str, source: str = "") -> Any:
    """Return the value of a JSON text; see `read_json`.

    >>> parse_json('{"E": 2.1e11, "free": [null, 1]}  // steel')
    {'E': 210000000000.0, 'free': [None, 1]}
    """
    reader = _Reader(text, source)
    value = reader.value(1)
    if reader.skip():
        raise reader.error(f"{reader.shown()} after the end of the JSON value; remove it")
    return value


class _Reader:
    """Recursive descent; the limit on nesting keeps the recursion short."""

    def __init__(self, text: str, source: str) -> None:
        self.text, self.source, self.at = text, source, 0
        self.starts = [0, *(m.end() for m in re.finditer("\n", text))]

    def place(self, at: int) -> tuple[int, int]:
        line = bisect_right(self.starts, at)
        return line, at - self.starts[line - 1] + 1

    def error(self, message: str, at: int | None = None) -> InputError:
        line, column = self.place(self.at if at is None else at)
        return InputError(f"{self.source}:{line}:{column}: {message}")

    def shown(self) -> str:
        """Return what stands here for a message, shortened."""
        if self.at >= len(self.text):
            return "end of file"
        word = _WORD.match(self.text, self.at)
        return repr(word.group()[:20] if word else self.text[self.at])

    def skip(self) -> str:
        """Skip blanks and comments; return the next character, or an empty string at the end."""
        match = _SPACE.match(self.text, self.at)
        self.at = match.end() if match else self.at
        if self.text.startswith("/*", self.at):
            raise self.error("comment '/*' is never closed; add '*/'")
        return self.text[self.at : self.at + 1]

    def value(self, depth: int) -> Any:
        first = self.skip()
        if depth > MAX_DEPTH and first in ("{", "["):
            raise self.error(f"nesting deeper than {MAX_DEPTH}; flatten the file")
        if first == "{":
            found = Object()
            self._items("}", lambda: self._member(found, depth))
            return found
        if first == "[":
            entries: list[Any] = []
            self._items("]", lambda: entries.append(self.value(depth + 1)))
            return entries
        if first == '"':
            return self._string()
        if first == "-" or "0" <= first <= "9":
            return self._number()
        return self._constant()

    def _items(self, close: str, read: Callable[[], None]) -> None:
        """Read comma-separated items up to the closing bracket."""
        opened = self.at
        self.at += 1
        after_comma = False
        while True:
            mark = self.skip()
            if mark == close:
                if after_comma:
                    raise self.error(f"trailing comma before {close!r}; remove the comma")
                break
            read()
            mark = self.skip()
            after_comma = mark == ","
            if after_comma:
                self.at += 1
            elif mark != close:
                line, _ = self.place(opened)
                raise self.error(f"{self.shown()} where ',' or {close!r} is expected (opened in line {line})")
        self.at += 1

    def _member(self, found: Object, depth: int) -> None:
        start = self.at
        if self.text[start : start + 1] != '"':
            raise self.error(f'{self.shown()} where a key in double quotes is expected, as in "model": …')
        key = self._string()
        if key in found:
            line, _ = found.places[key]
            raise self.error(f"duplicate key {key!r}, first given in line {line}; keep one", start)
        if self.skip() != ":":
            raise self.error(f"{self.shown()} where ':' after the key {key!r} is expected")
        self.at += 1
        found.places[key] = self.place(start)
        found[key] = self.value(depth + 1)

    def _string(self) -> str:
        match = _STRING.match(self.text, self.at)
        if match is None:
            raise self.error("string without its closing quote on the same line; add '\"'")
        token = match.group()
        text = token[1:-1]
        if "\\" in token:
            import json

            try:
                text = str(json.loads(token))
                text.encode("utf-8")
            except (ValueError, UnicodeEncodeError):
                raise self.error(
                    f"string {token[:40]} has an invalid escape; write \\\\ for a backslash"
                ) from None
        self.at = match.end()
        return text

    def _number(self) -> int | float:
        match = _NUMBER.match(self.text, self.at)
        word = _WORD.match(self.text, self.at)
        if match is None or word is None or word.end() != match.end():
            raise self.error(f"{self.shown()} is not a number in JSON; write it like -1.5e-3")
        token = match.group()
        if match.group(1) is None and match.group(2) is None:
            digits = len(token.lstrip("-"))
            if digits > MAX_DIGITS:
                raise self.error(f"integer of {digits} digits is too long; at most {MAX_DIGITS} digits")
            value: int | float = int(token)
        else:
            value = float(token)
            if value in (float("inf"), float("-inf")):
                raise self.error(f"{token[:20]} is too large for a number; at most 1.79e308")
        self.at = match.end()
        return value

    def _constant(self) -> bool | None:
        word = _WORD.match(self.text, self.at)
        token = word.group() if word else ""
        if word and token in _CONSTANTS:
            self.at = word.end()
            return _CONSTANTS[token]
        if token.lower().lstrip("+-") in ("nan", "inf", "infinity"):
            raise self.error(f"{token} is not a number in JSON; write a finite number, or leave the key out")
        raise self.error(f"{self.shown()} where a value is expected; strings need double quotes")
