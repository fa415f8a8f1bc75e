"""The blocks of an `.mdpa` file, a tree of ``Begin … End`` frames, and what is wrong or odd in it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NoReturn, TypeVar

from kratos_lite.errors import Problems
from kratos_lite.io.formats.document import already, repeated
from kratos_lite.io.names import nearest_variable
from kratos_lite.io.text import Source as TextSource
from kratos_lite.io.text import shown
from kratos_lite.native import kernels
from kratos_lite.typing import Ints

Span = tuple[int, int]
T = TypeVar("T")
SMALL = 2_000
"""Bytes below which the compiled kernels are not worth loading."""
MAX_DEPTH = 64
"""Deepest nesting of blocks."""
WORD = re.compile(rb"\S+")
STATEMENT = re.compile(rb"(?:Begin(?<!\SBegin)|End(?<!\SEnd))(?!\S)")
NAME = re.compile(rb"[A-Za-z_][A-Za-z0-9_:.\-]*")

LISTS = tuple(f"SubModelPart{kind}" for kind in (
    "Nodes", "Elements", "Conditions", "Geometries", "Constraints", "Properties", "Tables",
))  # fmt: skip
"""Blocks of ids inside a SubModelPart."""
MESH_BLOCKS = ("MeshData", "MeshNodes", "MeshElements", "MeshConditions")
ARGUMENTS = {
    "Properties": 1, "Table": 3, "Elements": 1, "Conditions": 1, "Geometries": 1, "Constraints": 1,
    "NodalData": 1, "ElementalData": 1, "ConditionalData": 1, "SubModelPart": 1, "Mesh": 1,
}  # fmt: skip
"""Words that follow the name of a block."""
TOP = (*ARGUMENTS, "ModelPartData", "Nodes")
"""Blocks that are read at the top level."""
READ = {*TOP, *LISTS, "SubModelPartData"} - {"Mesh"}
"""Blocks that are read; others are skipped as a whole."""
INSIDE = {"Properties": ("Table",), "SubModelPart": ("SubModelPart", "SubModelPartData", *LISTS)}
"""Blocks that may stand inside another one."""


@dataclass(eq=False)
class Frame:
    """One block: its words after ``Begin``, the spans of text between the blocks inside it, and these."""

    name: str
    offset: int
    arguments: list[str] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    children: list[Frame] = field(default_factory=list)

    @property
    def title(self) -> str:
        """The block as its first line says it."""
        return " ".join(["Begin", self.name, *self.arguments])


class Source(TextSource):
    """The text of an `.mdpa` file; `strict` wants every row on a line of its own."""

    def __init__(self, name: str, data: bytes, strict: bool = True) -> None:
        super().__init__(name, data, Problems(), [])
        self.strict = strict

    def fail(self, text: str, offset: int) -> NoReturn:
        """Raise all problems up to this one, after which reading makes no sense."""
        self.problem(text, offset)
        self.problems.raise_if_any()
        raise AssertionError

    def refuse_repeated(self, word: str, ids: Ints, lines: Ints | Sequence[int]) -> None:
        """Note every element, condition, … whose id stands in an earlier line, too."""
        for row, first in repeated(ids):
            text = already(f"{word} {ids[row]}", lines[first], f"; give each {word} its own id")
            self.problem_in_line(text, int(lines[row]))

    def line_end(self, at: int, end: int) -> int:
        """Return the end of the line at an offset, or of the span that ends before it."""
        line_end = self.data.find(b"\n", at, end)
        return line_end if line_end >= 0 else end

    def each(self, span: Span, what: str, read: Callable[[int, int], tuple[T, int]]) -> Iterator[T]:
        """Yield what `read` makes of a span, row by row; after a mistake go on with the next line.

        `read` takes where to begin and the end of the span; it returns a value and where that ends.
        """
        at, end = span
        while word := WORD.search(self.data, at, end):
            try:
                value, at = read(word.start(), end)
            except ValueError as error:
                self.problem(f"{what} {shown(word.group())}: {error}", word.start())
                at = self.line_end(word.start(), end)
            else:
                yield value

    def words(self, span: Span) -> Iterator[re.Match[bytes]]:
        """Return the words of a span."""
        return WORD.finditer(self.data, *span)


def scan(source: Source) -> Frame:
    """Return the root of the tree of blocks."""
    root = Frame("", 0)
    stack, cursor = [root], 0
    for offset in statements(source.data):
        stack[-1].spans.append((cursor, offset))
        if source.data.startswith(b"B", offset):
            frame, cursor = _open(source, offset, stack)
            stack[-1].children.append(frame)
            stack.append(frame)
        else:
            cursor = _close(source, offset, stack)
    top = stack[-1]
    top.spans.append((cursor, len(source.data)))
    if top is not root:
        where = f"the file ends inside {top.title!r} of line {source.line(top.offset)}"
        source.fail(f"{where}; 'End {top.name}' is missing", len(source.data.rstrip()))
    _refuse_stray_words(source, root)
    source.problems.raise_if_any()
    return root


def statements(data: bytes) -> list[int]:
    """Return the offsets of the words Begin and End."""
    if len(data) > SMALL and (text := kernels("text")):
        return sorted(text.find_word(data, b"Begin") + text.find_word(data, b"End"))
    return [match.start() for match in STATEMENT.finditer(data)]


def _open(source: Source, offset: int, stack: list[Frame]) -> tuple[Frame, int]:
    """Return the block that begins at an offset, and the end of its header."""
    if len(stack) > MAX_DEPTH:
        source.fail(f"blocks are nested more than {MAX_DEPTH} deep; is an 'End' missing?", offset)
    name, cursor = _word(source, offset + 5, "Begin")
    frame = Frame(name, offset)
    _check_place(source, frame, stack)
    if _is_skipped([*stack[1:], frame]):
        return frame, cursor
    for _ in range(ARGUMENTS.get(name, 0) - (name == "Table" and stack[-1].name == "Properties")):
        word, cursor = _word(source, cursor, frame.title)
        frame.arguments.append(word)
    while name == "Constraints" and (match := WORD.search(source.data, cursor)):
        if not NAME.fullmatch(match.group()) or match.group() in (b"Begin", b"End"):
            break
        frame.arguments.append(match.group().decode())
        cursor = match.end()
    return frame, cursor


def _is_skipped(frames: list[Frame]) -> bool:
    """Return whether the innermost of nested blocks stands in one that is not read."""
    return any(frame.name not in READ for frame in frames)


def _check_place(source: Source, frame: Frame, stack: list[Frame]) -> None:
    """Refuse a block that may not stand inside the block that is open."""
    outer, name, offset = stack[-1], frame.name, frame.offset
    is_top = len(stack) == 1
    if is_top and name in (*LISTS, "SubModelPartData", *MESH_BLOCKS):
        source.fail(f"'Begin {name}' stands outside the block that it belongs to", offset)
    proper = {known.lower(): known for known in TOP}.get(name.lower(), name)
    if is_top and name != proper:
        source.fail(f"unknown block {name!r}; capitals matter: write 'Begin {proper}'", offset)
    is_unknown = outer.name == "SubModelPart" and name not in TOP
    if not (is_top or is_unknown or name in INSIDE.get(outer.name, ()) or _is_skipped(stack[1:])):
        where = f"'Begin {name}' inside {outer.title!r} of line {source.line(outer.offset)}"
        source.fail(f"{where}; is 'End {outer.name}' missing before it?", offset)


def _close(source: Source, offset: int, stack: list[Frame]) -> int:
    """Take the closed block from the stack and return the end of the statement."""
    name, cursor = _word(source, offset + 3, "End")
    if len(stack) == 1:
        source.fail(f"'End {name}' closes nothing; is 'Begin {name}' missing?", offset)
    frame = stack.pop()
    if frame.name != name:
        if frame.name not in READ and (hint := nearest_variable(frame.name, READ)):
            source.fail(f"unknown block {frame.name!r}.{hint}", frame.offset)
        where = f"'End {name}' closes {frame.title!r} of line {source.line(frame.offset)}"
        source.fail(f"{where}; expected 'End {frame.name}'", offset)
    return cursor


def _word(source: Source, at: int, after: str) -> tuple[str, int]:
    """Return the next word, which must be a name or a number, and its end."""
    match = WORD.search(source.data, at)
    if match is None or match.group() in (b"Begin", b"End"):
        there = f"found {shown(match.group())}" if match else "the file ends"
        source.fail(f"a word is missing after {after!r}; {there}", match.start() if match else at - 1)
    if not match.group().isascii():
        source.fail(f"{shown(match.group())} after {after!r} is no name; use plain letters", match.start())
    return match.group().decode(), match.end()


def _refuse_stray_words(source: Source, frame: Frame) -> None:
    """Note words that stand between the blocks of the file or of a SubModelPart."""
    for span in frame.spans:
        if match := next(source.words(span), None):
            word = match.group()
            hint = "; capitals matter" if word.lower() in (b"begin", b"end") else ""
            text = f"{shown(word)} stands outside any block; expected 'Begin <block>'{hint}"
            source.problem(text, match.start())
    for child in frame.children:
        if child.name == "SubModelPart":
            _refuse_stray_words(source, child)
