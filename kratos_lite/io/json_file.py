"""JSON files: strict, with comments, and with the line and column of every key and every mistake.

Python's own reader gives the values.  A walk over the words adds what it does not tell: where the keys
stand, and what it accepts beyond the standard.
"""

from __future__ import annotations

import json
import math
import re
from bisect import bisect_right
from pathlib import Path
from typing import Any

from kratos_lite.errors import InputError
from kratos_lite.io.text import line_column, read_bytes

MAX_DEPTH = 64
"""Deepest nesting of objects and lists."""
MAX_DIGITS = 19
"""Longest integer; more digits do not fit into 64 bits."""
_COMMENT = re.compile(r'"(?:[^"\\\n]|\\.)*"|//[^\n]*|/\*.*?(?:\*/|(\Z))', re.DOTALL)
_TOKEN = re.compile(r'(?P<string>"(?:[^"\\\x00-\x1f]|\\.)*")(?P<colon>\s*:)?|["{}\[\],]|[-+\w.]+')
_NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?")


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
    return _Text(text, source).value()


class _Text:
    """A JSON text without its comments."""

    def __init__(self, text: str, source: str) -> None:
        self.source = source
        self.starts = [0, *(m.end() for m in re.finditer("\n", text))]
        self.text = _COMMENT.sub(self._blank, text)

    def place(self, at: int) -> tuple[int, int]:
        line = bisect_right(self.starts, at)
        return line, at - self.starts[line - 1] + 1

    def error(self, at: int, message: str) -> InputError:
        line, column = self.place(at)
        return InputError(f"{self.source}:{line}:{column}: {message}")

    def _blank(self, match: re.Match[str]) -> str:
        """Blank a comment, keeping its length and line ends; keep a string as it is."""
        if match.group(1) is not None:
            raise self.error(match.start(), "comment '/*' is never closed; add '*/'")
        word = match.group()
        return word if word[0] == '"' else re.sub(r"[^\n]", " ", word)

    def value(self) -> Any:
        objects = iter(self._walk(len(self.text))[0])

        def make(pairs: list[tuple[str, Any]]) -> Object:
            found = Object()
            for (key, value), at in zip(pairs, next(objects), strict=True):
                if key in found:
                    line, _ = found.places[key]
                    raise self.error(at, f"duplicate key {key!r}, first given in line {line}; keep one")
                found[key], found.places[key] = value, self.place(at)
            return found

        try:
            return json.loads(self.text, object_pairs_hook=make)
        except json.JSONDecodeError as error:
            raise self.error(error.pos, self._explained(error.msg, error.pos)) from None

    def _refuse(self, at: int, message: str) -> InputError:
        """Return the error of the walk, or of what Python's reader finds wrong before it."""
        try:
            json.loads(self.text[:at])
        except json.JSONDecodeError as error:
            if self.text[error.pos : at].strip():
                return self.error(error.pos, self._explained(error.msg, error.pos))
        return self.error(at, message)

    def _walk(self, end: int) -> tuple[list[list[int]], list[int], str]:
        """Return where the keys of each object stand, in the order in which the objects close.

        Also what is open at the end, and the last word before it.  Refuse what Python's reader accepts.
        """
        closed: list[list[int]] = []
        opened: list[tuple[int, list[int]]] = []
        before = word = ""
        for match in _TOKEN.finditer(self.text, 0, end):
            before, word, at = word, match.group(), match.start()
            if word in ("{", "["):
                opened.append((at, []))
                if len(opened) > MAX_DEPTH:
                    raise self._refuse(at, f"nesting deeper than {MAX_DEPTH}; flatten the file")
            elif word in ("}", "]"):
                if before == ",":
                    raise self._refuse(at, f"trailing comma before {word!r}; remove the comma")
                keys = opened.pop()[1] if opened else []
                closed += [keys] if word == "}" else []
            elif problem := _problem(match):
                raise self._refuse(at, problem)
            elif match.group("colon") and opened:
                opened[-1][1].append(at)
        return closed, [at for at, _ in opened], word

    def _explained(self, message: str, at: int) -> str:
        """Return what Python's reader found wrong in words of our own."""
        _, opened, last = self._walk(at)
        found = _TOKEN.match(self.text, at)
        shown = repr(found.group()[:20] if found else self.text[at]) if at < len(self.text) else "end of file"
        if message == "Extra data":
            return f"{shown} after the end of the JSON value; remove it"
        if message.startswith("Expecting property name"):
            return f'{shown} where a key in double quotes is expected, as in "model": …'
        if message.startswith("Expecting ':'"):
            return f"{shown} where ':' after the key {last[1:-1]!r} is expected"
        if message.startswith("Expecting ','"):
            close = "]" if self.text[opened[-1]] == "[" else "}"
            line, _ = self.place(opened[-1])
            return f"{shown} where ',' or {close!r} is expected (opened in line {line})"
        return f"{shown} where a value is expected; strings need double quotes"


def _problem(match: re.Match[str]) -> str:
    """Return what is wrong with a string or a number that Python's reader takes, or would cut short."""
    word = match.group()
    if word[0] == '"':
        return _string_problem(match.group("string"))
    if word.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        return f"{word[:20]} is not a number in JSON; write a finite number, or leave the key out"
    return _number_problem(word) if word[0] == "-" or word[0].isdigit() else ""


def _string_problem(word: str | None) -> str:
    if word is None:
        return "string without its closing quote on the same line; add '\"'"
    try:
        if "\\" in word:
            json.loads(word).encode("utf-8")
    except ValueError:
        return f"string {word[:40]} has an invalid escape; write \\\\ for a backslash"
    return ""


def _number_problem(word: str) -> str:
    number, digits = _NUMBER.fullmatch(word), len(word.lstrip("-"))
    if number is None:
        return f"{word[:20]!r} is not a number in JSON; write it like -1.5e-3"
    if not number[1] and not number[2] and digits > MAX_DIGITS:
        return f"integer of {digits} digits is too long; at most {MAX_DIGITS} digits"
    return f"{word[:20]} is too large for a number; at most 1.79e308" if math.isinf(float(word)) else ""
