"""Text of input files: bytes, comments, line numbers, and strict numbers."""

from __future__ import annotations

import re
import stat
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.errors import InputError, Problems, no_such_file
from kratos_lite.io.formats.document import Note
from kratos_lite.typing import Ints

MAX_LINE = 1_000_000
"""Longest line that is read, in bytes, but for JSON, which programs write in one."""
MAX_ID = 2**63 - 1
_REAL = re.compile(rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?", re.ASCII)
# An unclosed comment runs to the end, so that the search stays linear in time.
_COMMENT = re.compile(rb"//[^\n]*|/\*.*?(?:\*/|(\Z))", re.DOTALL)


def read_bytes(path: str | Path, long_lines: bool = False) -> bytes:
    """Return an input file with LF line ends, unzipped if it is gzipped; InputError where it is no text."""
    path = Path(path)
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
            # Reading a pipe or a device may never end.
            raise InputError(f"{path}: is no ordinary file but a pipe or device; name a file")
        data = path.read_bytes()
    except FileNotFoundError:
        raise no_such_file(path) from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder; name a file in it") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    if data[:2] == b"\x1f\x8b":
        data = _unzip(path, data)
    if data[:3] == b"\xef\xbb\xbf":
        data = data[3:]
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if (nul := data.find(b"\0")) >= 0:
        line, column = line_column(data, nul)
        raise InputError(f"{path}:{line}:{column}: NUL byte; is this a text file?")
    if not long_lines and len(data) > MAX_LINE and (long := _long_line(data)):
        raise InputError(f"{path}:{long}: a line of more than {MAX_LINE} bytes; break it up")
    return data


def _unzip(path: Path, data: bytes) -> bytes:
    """Return what a gzip file holds."""
    import gzip
    import zlib

    try:
        return gzip.decompress(data)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: broken gzip file: {error}") from None


def _long_line(data: bytes) -> int:
    """Return the number of the first line that is too long, or 0."""
    start = 0
    while len(data) - start > MAX_LINE:
        end = data.rfind(b"\n", start, start + MAX_LINE + 1)
        if end < 0:
            return data.count(b"\n", 0, start) + 1
        start = end + 1
    return 0


def line_column(data: bytes, offset: int) -> tuple[int, int]:
    r"""Return line and column, both from 1, of an offset.

    >>> line_column(b"ab\ncd", 4)
    (2, 2)
    """
    return data.count(b"\n", 0, offset) + 1, offset - data.rfind(b"\n", 0, offset)


def blank_comments(data: bytes, source: str = "") -> bytes:
    r"""Replace ``// …`` and ``/* … */`` by blanks, keeping length and line ends.

    >>> blank_comments(b"a// b\nc")
    b'a    \nc'
    """
    if b"/" not in data:
        return data

    def blank(match: re.Match[bytes]) -> bytes:
        if match.group(1) is not None:
            line, column = line_column(data, match.start())
            raise InputError(f"{source}:{line}:{column}: comment '/*' is never closed; add '*/'")
        return b"\n".join(b" " * len(piece) for piece in match.group().split(b"\n"))

    return _COMMENT.sub(blank, data)


class Source:
    """Text of an input file without its comments; collects what is wrong and what is odd in it."""

    def __init__(
        self, name: str, data: bytes, problems: Problems, notes: list[Note], origin: str = ""
    ) -> None:
        self.name, self.data, self.problems, self.notes, self.origin = name, data, problems, notes, origin

    @cached_property
    def _line_ends(self) -> Ints:
        return np.flatnonzero(np.frombuffer(self.data, dtype=np.uint8) == ord("\n"))

    def lines(self, offsets: ArrayLike) -> NDArray[np.int32]:
        """Return the lines, from 1, of offsets."""
        return (np.searchsorted(self._line_ends, offsets) + 1).astype(np.int32)

    def line(self, offset: int) -> int:
        """Return the line, from 1, of an offset."""
        return int(self.lines(offset))

    def problem(self, text: str, offset: int) -> None:
        """Note what is wrong at an offset."""
        column = offset - self.data.rfind(b"\n", 0, offset)
        self.problems.add(f"{self.name}:{self.line(offset)}:{column}: {text}")

    def problem_in_line(self, text: str, line: int) -> None:
        """Note what is wrong in a line."""
        self.problems.add(f"{self.name}:{line}: {text}")

    def note(self, text: str, offset: int) -> None:
        """Note what was kept without use, skipped or found odd at an offset."""
        self.note_in_line(text, self.line(offset))

    def note_in_line(self, text: str, line: int) -> None:
        """Note what was kept without use, skipped or found odd in a line."""
        self.notes.append(Note(line, text, self.origin))


def shown(token: bytes) -> str:
    """Return a token for a message, shortened and with all bytes visible."""
    text = token[:40].decode("utf-8", "backslashreplace")
    return repr(text + ("…" if len(token) > 40 else ""))


def real(token: bytes) -> float:
    """Return a finite number; raise ValueError with the reason and the cure.

    >>> real(b"1.5D+02")
    150.0
    """
    if not _REAL.fullmatch(token):
        hint = ""
        if re.fullmatch(rb"[+-]?\d+,\d+(?:[eE][+-]?\d+)?", token):
            hint = f"; decimal comma? write {token.replace(b',', b'.').decode()}"
            if re.fullmatch(rb"[+-]?\d{1,3},\d{3}", token):
                hint += f"; thousands? write {token.replace(b',', b'').decode()}"
        raise ValueError(f"{shown(token)} is not a number{hint}")
    value = float(token.translate(bytes.maketrans(b"dD", b"ee")))
    if value in (float("inf"), float("-inf")):
        raise ValueError(f"{shown(token)} is too large for a number")
    return value


def integer(token: bytes) -> int:
    """Return an id, 1 … 2^63 - 1; raise ValueError with the reason.

    >>> integer(b"42")
    42
    """
    digits = token.lstrip(b"0")
    # int() refuses very long rows of digits with another error, so their length is asked first.
    if not token.isdigit() or not digits or len(digits) > 19 or int(digits) > MAX_ID:
        raise ValueError(f"{shown(token)} is not an id; ids are 1 … 2^63-1")
    return int(digits)
