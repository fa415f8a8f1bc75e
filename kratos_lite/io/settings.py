"""Settings: a JSON object whose values are read by type; errors name the keys that lead to a wrong value."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from os.path import isdir
from pathlib import Path
from typing import Any, TypeVar

from kratos_lite.errors import InputError, KratosLiteError, nearest, no_such_file
from kratos_lite.io.text import line_column, read_bytes

T = TypeVar("T")
LONGEST = 255
"""Bytes of the longest name of a file that systems take."""
REQUIRED: Any = object()
"""Default of a key that must be given."""


def is_number(value: Any) -> bool:
    """Return whether a JSON value is a number; true and false are none."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


class Settings:
    """A JSON object with the file and the keys that lead to it.

    `path` are these keys, such as ``solver_settings``; `files` those that the whole tree has named so far and
    that are there: `find_file` adds to them.

    >>> Settings({"type": "amg"}, "run.json").text("type")
    'amg'
    """

    def __init__(
        self, values: dict[str, Any], source: str, path: str = "", files: list[Path] | None = None
    ) -> None:
        self.values, self.source, self.path = values, source, path
        self.files = [] if files is None else files

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def name(self, key: str) -> str:
        """Return a key with the keys that lead to it."""
        return f"{self.path}.{key}" if self.path else key

    def expect(self, fits: object, key: str, message: str) -> None:
        """Raise the error of a key unless its value fits."""
        if not fits:
            raise self.error(key, message)

    def error(self, key: str, message: str) -> InputError:
        """Return an error about a key, or about the whole object; it may say what the value "must be"."""
        name = self.name(key) if key else self.path
        joined = f"{name} {message}" if message.startswith("must ") else f"{name}: {message}"
        return InputError(f"{self.source}: {joined if name else message}")

    def placed(self, key: str, action: Callable[..., T], *arguments: Any, **named: Any) -> T:
        """Return what an action returns; an error of the library gets the place of a key."""
        try:
            return action(*arguments, **named)
        except KratosLiteError as error:
            raise self.error(key, str(error)) from None

    def get(self, key: str, default: Any = REQUIRED) -> Any:
        """Return a value of any type."""
        if key in self.values:
            return self.values[key]
        if default is REQUIRED:
            slip = "".join(f"; is it {word!r}?" for word in get_close_matches(key, self.values, 1, 0.75))
            raise InputError(f"{self.source}: key {self.name(key)!r} is missing{slip}")
        return default

    def _typed(self, key: str, default: Any, fits: bool, kind: str) -> Any:
        if key in self.values and not fits:
            raise self.error(key, f"must be {kind}; got {shown(self.values[key])}")
        return self.get(key, default)

    def text(self, key: str, default: Any = REQUIRED) -> str:
        """Return a string."""
        value = self._typed(key, default, isinstance(self.values.get(key), str), "a string")
        return str(value)

    def number(self, key: str, default: Any = REQUIRED) -> float:
        """Return a number."""
        return float(self._typed(key, default, is_number(self.values.get(key)), "a number"))

    def integer(self, key: str, default: Any = REQUIRED) -> int:
        """Return an integer."""
        value = self.values.get(key)
        return int(self._typed(key, default, is_number(value) and isinstance(value, int), "an integer"))

    def flag(self, key: str, default: Any = REQUIRED) -> bool:
        """Return true or false."""
        return bool(self._typed(key, default, isinstance(self.values.get(key), bool), "true or false"))

    def vector(self, key: str) -> list[float]:
        """Return three numbers."""
        value = self.values.get(key)
        fits = isinstance(value, list) and len(value) == 3 and all(map(is_number, value))
        return [float(v) for v in self._typed(key, REQUIRED, fits, "a list of three numbers")]

    def _list(self, key: str, default: Any, fits: Callable[[Any], bool], kind: str) -> list[Any]:
        value = self.values.get(key)
        every = isinstance(value, list) and all(map(fits, value))
        return list(self._typed(key, default, every, f"a list of {kind}"))

    def numbers(self, key: str) -> list[float]:
        """Return a list of numbers."""
        return [float(v) for v in self._list(key, REQUIRED, is_number, "numbers")]

    def texts(self, key: str) -> list[str]:
        """Return a list of strings; an empty one where the key is missing."""
        return self._list(key, [], lambda v: isinstance(v, str), "strings")

    def section(self, key: str, required: bool = False) -> Settings:
        """Return an inner object; an empty one where the key is missing, unless it is required."""
        default = REQUIRED if required else {}
        value = self._typed(key, default, isinstance(self.values.get(key), dict), "an object {…}")
        return Settings(value, self.source, self.name(key), self.files)

    def sections(self, key: str) -> list[Settings]:
        """Return a list of inner objects."""
        entries = self._list(key, [], lambda v: isinstance(v, dict), "objects [{…}, …]")
        return [
            Settings(entry, self.source, f"{self.name(key)}[{i}]", self.files)
            for i, entry in enumerate(entries)
        ]

    def unknown(self, known: Iterable[str]) -> list[str]:
        """Return the keys that are not among the known ones."""
        return [key for key in self.values if key not in set(known)]

    def check_keys(self, known: Iterable[str]) -> None:
        """Raise InputError at the first key that is not known; where examples are, also for another kind."""
        examples = known if isinstance(known, Mapping) else dict.fromkeys(known)
        for key in self.unknown(examples):
            hint = nearest(key, examples)
            hint += f" The keys are {', '.join(examples)}" if len(examples) < 25 or not hint else ""
            raise InputError(f"{self.source}: unknown key {self.name(key)!r}.{hint}")
        for key, value in self.values.items():
            if examples[key] is not None and kind_of(value) != kind_of(examples[key]):
                raise self.error(key, f"must be {kind_of(examples[key])}; got {shown(value)}")


def kind_of(value: Any) -> str:
    """Return what a JSON value is, in words.

    >>> kind_of(1), kind_of(True), kind_of({})
    ('a number', 'true or false', 'an object {…}')
    """
    kinds = {bool: "true or false", str: "a string", list: "a list […]", dict: "an object {…}"}
    return "a number" if is_number(value) else kinds.get(type(value), "null")


def shown(value: Any) -> str:
    """Return a JSON value for a message, shortened."""
    text = "null" if value is None else repr(value)
    return text if len(text) <= 60 else text[:57] + "…"


def read_settings(path: str | Path) -> Settings:
    """Return the object that a JSON file holds; see `read_json` for the errors."""
    value = read_json(path)
    if not isinstance(value, dict):
        raise InputError(f"{path}: an object {{…}} is expected; got {type(value).__name__}")
    return Settings(value, str(path), files=[Path(path)])


def inside(folder: Path, name: str, allow_outside: bool = False) -> Path:
    """Return the path of a file named in a run file; raise InputError if it leaves the folder.

    >>> inside(Path("case"), "mesh/beam.mdpa").as_posix()
    'case/mesh/beam.mdpa'
    """
    relative = Path(name.replace("\\", "/"))
    leaves = relative.is_absolute() or ".." in relative.parts or (len(name) > 1 and name[1] == ":")
    if leaves and not allow_outside:
        raise InputError(
            f"path {name!r} leaves the folder of the run file; give a path inside it, without '..'"
        )
    if any(len(part.encode()) > LONGEST for part in relative.parts):
        raise InputError(f"a name in the path {shown(name)} is longer than {LONGEST} bytes; shorten it")
    return folder / relative


def find_file(
    settings: Settings, key: str, folder: Path, *, outside: bool = False, ending: str = ""
) -> tuple[Path, str]:
    """Return the path of the file that a key names, and a note if it stands somewhere else."""
    # The path counts from the folder of the run file.  Kratos counts from where it is started, such as a
    # folder above, through which the path leads, or the present one; so the file is looked for there, and
    # beside the run file.
    name = settings.text(key) + ending
    if isdir(name) or isdir(folder / name):  # where the methods of Path refuse names that are too long
        raise settings.error(key, f"{name} is a folder; name a file in it")
    path = settings.placed(key, inside, folder, name, outside)
    if path.is_file():
        settings.files.append(path)
        return path, ""
    whole, first = folder.resolve(), Path(name).parts[0]
    above = (up / name for up in whole.parents if whole.is_relative_to(up / first) or up == Path.cwd())
    for other in (folder / path.name, *above):
        if other.is_file():
            settings.files.append(other)
            where = f"{path.name} beside the run file" if other.parent == folder else str(other)
            return other, f"{name} is not there; {where} is read"
    raise settings.error(key, str(no_such_file(folder / name)))


# ---- JSON: read by the standard library, strict, with comments --------------------------------------------

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
