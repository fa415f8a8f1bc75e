"""One large `.mdpa` file read by several ranks, each of which reads a range of it; nobody reads all.

The ranks share where blocks begin and end, and the text of small ones.  Of long blocks - nodes, elements,
conditions, values and members of parts - each rank reads its rows.  What is unusual or wrong raises
`Unusual`: the file is then read whole, which says everything there is to say.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.errors import KratosLiteError
from kratos_lite.io.formats.mdpa.scan import ARGUMENTS, Frame, Source, scan, statements
from kratos_lite.io.text import blank_comments
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.records import field, record

LONG = {
    "Nodes", "Elements", "Conditions", "Geometries", "NodalData", "ElementalData", "ConditionalData",
    "SubModelPartNodes", "SubModelPartElements", "SubModelPartConditions",
}  # fmt: skip
"""Blocks whose rows are read by ranges."""
WINDOW = 1_000_000
"""Bytes in which a line must end."""


class Unusual(KratosLiteError):
    """The file is better read whole."""


class RangeSource(Source):
    """The range of a file that a rank reads; lines count through the whole file.

    Parameters
    ----------
    name : of the file.
    data : of the range, which starts and ends with a line.
    before : number of lines before it.
    """

    def __init__(self, name: str, data: bytes, strict: bool, before: int = 0) -> None:
        super().__init__(name, data, strict)
        self.before = before

    def lines(self, offsets: ArrayLike) -> NDArray[np.int32]:
        """Return the lines of the file, from 1, of offsets in the range."""
        return (super().lines(offsets) + self.before).astype(np.int32)


class Skeleton(Source):
    """The text of a file without the rows of long blocks; lines are those of the file.

    Parameters
    ----------
    pieces : (line in the file, from 1, text) of each piece, in order.
    """

    def __init__(self, name: str, pieces: list[tuple[int, bytes]], strict: bool) -> None:
        super().__init__(name, b"".join(text for _, text in pieces), strict)
        lengths = [len(text) for _, text in pieces]
        self._starts = np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype(np.int64)
        first = super().lines(self._starts)
        self._shift = np.array([line for line, _ in pieces], dtype=np.int64) - first

    def lines(self, offsets: ArrayLike) -> NDArray[np.int32]:
        """Return the lines of the file, from 1, of offsets in the text."""
        piece = np.maximum(np.searchsorted(self._starts, offsets, side="right") - 1, 0)
        return (super().lines(offsets) + self._shift[piece]).astype(np.int32)


@record(eq=False)
class LongBlock:
    """A long block, and the rows of it that this rank reads.

    Attributes
    ----------
    frame : its words and its place in the skeleton.
    line : of its ``Begin``.
    span : of its rows in the range of this rank; empty if there are none.
    """

    frame: Frame
    line: int
    span: tuple[int, int]


@record(eq=False)
class Ranges:
    """What this rank has read of a file.

    Attributes
    ----------
    source : its range.
    skeleton : the text that all ranks have.
    root : the tree of blocks in the skeleton.
    blocks : the long blocks, by the offsets of their frames in the skeleton.
    """

    source: RangeSource
    skeleton: Skeleton
    root: Frame
    blocks: dict[int, LongBlock] = field(default_factory=dict)

    def long(self, name: str) -> Iterator[LongBlock]:
        """Yield the long blocks of a name at the top of the file."""
        for frame in self.root.children:
            if frame.name == name:
                yield self.blocks[frame.offset]


def read_ranges(path: Path, ranks: Alone, strict: bool) -> Ranges:
    """Return what each rank reads of a file; `Unusual` is raised on all of them alike.

    Parameters
    ----------
    path : an ordinary file, not zipped.
    ranks : the communicator.
    strict : as for `read_mdpa`.
    """
    with _usual(ranks):
        data = _range(path, ranks)
        lines, lengths = (ranks.gather(count) for count in (data.count(b"\n"), len(data)))
        start = sum(lengths[: ranks.rank])
        source = RangeSource(str(path), data, strict, sum(lines[: ranks.rank]))
        found = [one for of_rank in ranks.gather(_statements(source, start)) for one in of_rank]
        inner = list(_interiors(found))
        pieces = [one for of_rank in ranks.gather(_kept(source, inner, start)) for one in of_rank]
        skeleton = Skeleton(str(path), pieces, strict)
        root = scan(skeleton)
        frames = [frame for frame in _leaves(root) if frame.name in LONG]
        if len(frames) != len(inner):
            raise Unusual("blocks that are not where they seem to be")
        blocks = {}
        for frame, (first, last, line) in zip(frames, inner, strict=True):
            ends = (min(max(at - start, 0), len(data)) for at in (first, last))
            blocks[frame.offset] = LongBlock(frame, line, (next(ends), next(ends)))
        return Ranges(source, skeleton, root, blocks)


@contextmanager
def _usual(ranks: Alone) -> Iterator[None]:
    """Turn any error into `Unusual`, on all ranks."""
    with ranks.together():
        try:
            yield
        except KratosLiteError as error:
            if getattr(error, "is_shared", False):
                raise
            raise Unusual(str(error)) from None


def _leaves(frame: Frame) -> Iterator[Frame]:
    for child in frame.children:
        yield child
        yield from _leaves(child)


def _range(path: Path, ranks: Alone) -> bytes:
    """Return the lines that start in this rank's share of the bytes, without comments."""
    size = path.stat().st_size
    starts = [size * rank // ranks.size for rank in range(ranks.size + 1)]
    with path.open("rb") as file:
        first, last = (_line_start(file, starts[ranks.rank + i], size) for i in (0, 1))
        file.seek(first)
        data = file.read(last - first).replace(b"\r\n", b"\n")
    if b"\r" in data or b"\0" in data or b"/*" in data or data[:3] == b"\xef\xbb\xbf":
        raise Unusual("line ends, comments or characters that are rare")
    if data and not data.endswith(b"\n"):
        data += b"\n"
    if len(data) > WINDOW and max(map(len, (data[a:b] for a, b in _long_lines(data))), default=0) > WINDOW:
        raise Unusual("a very long line")
    return blank_comments(data, str(path))


def _long_lines(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield the lines that hold every WINDOW-th byte: one of them is very long, if any is."""
    for at in range(0, len(data), WINDOW):
        yield data.rfind(b"\n", 0, at) + 1, data.find(b"\n", at)


def _line_start(file: Any, at: int, size: int) -> int:
    """Return where the first line begins that starts at an offset or behind it."""
    if at == 0 or at >= size:
        return min(at, size)
    file.seek(at - 1)
    window = file.read(WINDOW)
    end = window.find(b"\n")
    if end < 0:
        if at - 1 + len(window) < size:
            raise Unusual("a very long line")
        return size
    return int(at + end)


def _statements(source: RangeSource, start: int) -> list[tuple[int, int, int, list[str]]]:
    """Return (offset, end of its line, line, words) of each Begin and End; offsets count from `start`."""
    data, at = source.data, statements(source.data)
    ends = [data.index(b"\n", one) for one in at]
    if any(end > following for end, following in zip(ends, at[1:], strict=False)):
        raise Unusual("several blocks on a line")
    lines = source.lines(np.array(at, dtype=np.int64)).tolist()
    words = [data[one:end].decode("ascii", "replace").split() for one, end in zip(at, ends, strict=True)]
    return [
        (start + one, start + end, line, said)
        for one, end, line, said in zip(at, ends, lines, words, strict=True)
    ]


def _interiors(found: list[tuple[int, int, int, list[str]]]) -> Iterator[tuple[int, int, int]]:
    """Yield the offsets between which the rows of each long block stand, and the line of its Begin."""
    for (_, end, line, words), (following, _, _, closing) in pairwise(found):
        if words[0] != "Begin" or len(words) < 2 or words[1] not in LONG:
            continue
        if len(words) != 2 + ARGUMENTS.get(words[1], 0) or closing != ["End", words[1]]:
            raise Unusual("a header with other words")
        yield end + 1, following, line


def _kept(source: RangeSource, inner: list[tuple[int, int, int]], start: int) -> list[tuple[int, bytes]]:
    """Return line and text of what stands between the rows of long blocks in the range of this rank."""
    found, at, data = [], 0, source.data
    for first, last, _ in [*inner, (start + len(data), start + len(data), 0)]:
        stop = min(max(first - start, 0), len(data))
        if stop > at:
            found.append((source.line(at), data[at:stop]))
        at = max(at, min(last - start, len(data)))
    return found
