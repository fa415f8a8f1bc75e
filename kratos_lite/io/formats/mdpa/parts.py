"""SubModelParts of an `.mdpa` file."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from kratos_lite.io.formats.cells import already
from kratos_lite.io.formats.mdpa.rows import Layout, read_rows
from kratos_lite.io.formats.mdpa.scan import LISTS, Frame, Source
from kratos_lite.io.formats.mdpa.values import read_values
from kratos_lite.mesh import Part, rows_of_ids, without_repeats
from kratos_lite.typing import Ints

PART_NAME = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")
"""Names that may be part of a file name without harm."""


class PartReader:
    """Read the parts of a file; `ids` holds the ids of all nodes, elements, … in the order of their rows."""

    def __init__(self, source: Source, ids: dict[str, Ints]) -> None:
        self.source = source
        self.ids = ids
        self.order = {kind: np.argsort(values, kind="stable") for kind, values in ids.items()}
        self.fields: dict[str, dict[str, Any]] = {}
        self.lines: dict[str, int] = {}
        self._rows: dict[tuple[str, str], list[Ints]] = {}

    def read(self, frames: list[Frame]) -> dict[str, Part]:
        """Return all parts by their full names, parents before their children."""
        for frame in frames:
            self._read(frame, "")
        for (name, kind), rows in self._rows.items():
            self.fields[name][kind] = without_repeats(np.concatenate(rows))
        return {name: Part(**fields) for name, fields in self.fields.items()}

    def _read(self, frame: Frame, parent: str) -> None:
        name = frame.arguments[0]
        if not PART_NAME.fullmatch(name):
            self.source.problem(
                f"SubModelPart {name!r} is no name; use letters, digits, '_', '-' and single dots inside",
                frame.offset,
            )
            return
        full = f"{parent}.{name}" if parent else name
        if full in self.lines:
            text = already(f"SubModelPart {full}", self.lines[full], "; give each part its own name")
            self.source.problem(text, frame.offset)
            return
        self.lines[full] = self.source.line(frame.offset)
        for ancestor in _chain(full):
            self.fields.setdefault(ancestor, {"data": {}})
        for child in frame.children:
            self._read_child(child, full)

    def _read_child(self, child: Frame, full: str) -> None:
        if child.name == "SubModelPart":
            self._read(child, full)
        elif child.name == "SubModelPartData":
            self.fields[full]["data"].update(read_values(self.source, child.spans)[0])
        elif child.name in LISTS:
            self._add(child, child.name.removeprefix("SubModelPart").lower(), full)
        else:
            self.source.note(f"unknown block {child.name} in SubModelPart {full} is skipped", child.offset)

    def _add(self, child: Frame, kind: str, full: str) -> None:
        """Add the members in a list of ids to a part and to all its ancestors."""
        is_number = kind in ("properties", "tables")
        read = read_rows(self.source, child.spans[0], Layout("id", "p" if kind == "properties" else "i"))
        ids = read.ints[:, 0]
        rows = rows_of_ids(self.ids[kind], ids, self.order[kind])
        exists = rows >= 0
        for i in np.flatnonzero(~exists)[:1000]:
            word = "Properties" if kind == "properties" else _singular(kind)
            text = f"SubModelPart {full} lists {word} {ids[i]}, which the file does not have"
            report = self.source.note_in_line if is_number else self.source.problem_in_line
            report(text, int(read.lines[i]))
        for ancestor in _chain(full) if len(ids) else ():
            if is_number:
                have = self.fields[ancestor].get(kind, ())
                self.fields[ancestor][kind] = tuple(dict.fromkeys([*have, *ids[exists].tolist()]))
            else:
                self._rows.setdefault((ancestor, kind), []).append(rows[exists])


def _chain(full: str) -> list[str]:
    """Return the full names of a part and of its ancestors, the outermost first."""
    words = full.split(".")
    return [".".join(words[:i]) for i in range(1, len(words) + 1)]


def _singular(kind: str) -> str:
    return "geometry" if kind == "geometries" else kind[:-1]
