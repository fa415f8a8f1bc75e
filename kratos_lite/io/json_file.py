"""JSON files: read by the standard library, strict, with comments and without what it accepts beyond JSON."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

from kratos_lite.errors import InputError
from kratos_lite.io.text import line_column, read_bytes

MAX_DIGITS = 19
"""Longest integer; more digits do not fit into 64 bits."""
MAX_DEPTH = 64
"""Deepest nesting of objects and lists."""
TOO_DEEP = f"nesting deeper than {MAX_DEPTH}; flatten the file"
_COMMENT = re.compile(r'"(?:[^"\\\n]|\\.)*"|//[^\n]*|/\*.*?(?:\*/|(\Z))', re.DOTALL)


def read_json(path: str | Path) -> Any:
    """Return what a JSON file says; comments ``// …`` and ``/* … */`` are skipped, as Kratos does.

    InputError for anything that is not strict JSON in UTF-8, with line and column of wrong syntax: also for a
    key that is given twice, NaN or Infinity, an integer of more than 19 digits, a number that overflows.
    """
    data = read_bytes(path, long_lines=True)
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
    try:
        text = _COMMENT.sub(_blank, text)
        value = json.loads(
            text, object_pairs_hook=_object, parse_int=_integer, parse_float=_real, parse_constant=_constant
        )
        _check_depth(value)
        return value
    except json.JSONDecodeError as error:
        found = (
            repr(error.doc[error.pos : error.pos + 20].split("\n")[0]) if error.pos < len(error.doc) else ""
        )
        place = f"{source}:{error.lineno}:{error.colno}"
        raise InputError(f"{place}: {error.msg}; found {found or 'the end of the file'}") from None
    except RecursionError:
        raise InputError(f"{source}: {TOO_DEEP}") from None
    except _NoJsonError as error:
        raise InputError(f"{source}: {error}") from None


class _NoJsonError(Exception):
    """Something that the standard library accepts, and JSON does not."""


def _blank(match: re.Match[str]) -> str:
    """Blank a comment, keeping its length and line ends; keep a string as it is."""
    word = match.group()
    if match.group(1) is not None:
        raise json.JSONDecodeError("Comment '/*' without '*/'", match.string, match.start())
    return word if word[0] == '"' else re.sub(r"[^\n]", " ", word)


def _check_depth(value: Any) -> None:
    """Raise _NoJsonError for a value that is nested too deep."""
    level = [value]
    for _ in range(MAX_DEPTH + 1):
        inner = [v.values() if isinstance(v, dict) else v for v in level if isinstance(v, (dict, list))]
        level = [v for values in inner for v in values]
        if not inner:
            return
    raise _NoJsonError(TOO_DEEP)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in values if keys.count(key) > 1)
        raise _NoJsonError(f"duplicate key {twice!r}; keep one")
    return values


def _integer(word: str) -> int:
    if len(word.lstrip("-")) > MAX_DIGITS:
        raise _NoJsonError(f"integer {word[:20]}… of {len(word)} digits is too long; at most {MAX_DIGITS}")
    return int(word)


def _real(word: str) -> float:
    if math.isinf(float(word)):
        raise _NoJsonError(f"{word[:20]} is too large for a number; at most 1.79e308")
    return float(word)


def _constant(word: str) -> float:
    raise _NoJsonError(f"{word} is not a number in JSON; write a finite number, or leave the key out")
