"""The files of a five-file set: which are there, and the statements found in them."""

from __future__ import annotations

import os
from pathlib import Path

from kratos_lite.errors import InputError, Problems
from kratos_lite.io.formats.document import Note
from kratos_lite.io.formats.elem.grammar import Form, Run, Source

ENDINGS = (".node", ".elem", ".cond", ".prop", ".init")
REQUIRED = (".node", ".elem")

_CELLS = Form("[ <id> , [ <ids> ] , <number> ] <next>")
FIX = Form("NODES [ <id> ] . Fix ( <Name> )")
INIT = Form("NODES [ <id> ] ( <Name> , <number> ) = <real>")
SCALAR = Form("PROPERTIES [ <number> ] [ <Name> ] = <real>")
VECTOR = Form("PROPERTIES [ <number> ] [ <Name> ] = [ <reals> ]")
MATRIX = Form("PROPERTIES [ <number> ] [ <Name> ] = [ <rows> ]")
FORMS = {
    ".node": (
        Form("NODES = NodesList ( [", Form("[ <id> , <real> , <real> , <real> ] <next>")),
        Form("NODES [ <id> ] = Node ( <real> , <real> , <real> )"),
    ),
    ".elem": (
        Form("ELEMENTS [ <id> ] = <Name> ( [ <ids> ] , <number> )"),
        Form("ELEMENTS = ElementsList ( <Name> , [", _CELLS),
        Form("ElementsGroup = <Name>"),
    ),
    ".cond": (
        FIX,
        Form("CONDITIONS [ <id> ] = <Name> ( [ <ids> ] , <number> )"),
        Form("CONDITIONS = ConditionsList ( <Name> , [", _CELLS),
    ),
    ".prop": (SCALAR, VECTOR, MATRIX),
    ".init": (INIT,),
}
"""Statements of each file."""


class ElemFiles:
    """The five files, scanned; `problems` and `notes` of all of them."""

    def __init__(self, path: str | Path) -> None:
        self.problems = Problems()
        self.notes: list[Note] = []
        self.sources: dict[str, Source] = {}
        self.runs: dict[str, list[Run]] = {ending: [] for ending in ENDINGS}
        self.stem = stem(path)
        self._scan(".node")
        self.nodes_known = not self.problems
        for ending in ENDINGS[1:]:
            self._scan(ending)

    def _scan(self, ending: str) -> None:
        file = self._find(ending)
        if file is not None:
            try:
                self.sources[ending] = source = Source(file, self.problems, self.notes)
            except InputError as error:
                self.problems.add(str(error))
            else:
                self.runs[ending] = source.scan(FORMS[ending])

    def _find(self, ending: str) -> Path | None:
        plain, zipped = Path(self.stem + ending), Path(self.stem + ending + ".gz")
        if plain.exists() and zipped.exists():
            self.notes.append(Note(0, f"{zipped} is not read: {plain} is there too"))
        if plain.exists() or zipped.exists():
            return plain if plain.exists() else zipped
        if ending in REQUIRED:
            also = f"nor {zipped.name}; expected NAME.node and NAME.elem side by side"
            self.problems.add(f"{plain}: there is no such file, {also}")
        else:
            self.notes.append(Note(0, f"there is no file {plain}"))
        return None

    def no_node(self, node: int) -> str:
        """Return the message for a node id that no node has."""
        return f"there is no node {node} in {self.sources['.node'].name}"


def stem(path: str | Path) -> str:
    """Return the path without ``.node`` … ``.init`` and ``.gz``.

    >>> stem("a/beam.v2.elem.gz")
    'a/beam.v2'
    """
    text = os.fspath(path).removesuffix(".gz")
    return text[:-5] if text.endswith(ENDINGS) else text
