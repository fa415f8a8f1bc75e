"""The directive ``known-words``: names and keys that files may hold, from the tables of their readers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from sphinx.util.docutils import SphinxDirective

from kratos_lite.analysis.fields import FIELDS
from kratos_lite.analysis.subjects import names_of_parts
from kratos_lite.io.formats.mdpa.scan import LISTS, TOP
from kratos_lite.io.kratos import (
    expected_values,
    expressions,
    keys,
    motion,
    processes,
    properties,
)
from kratos_lite.io.kratos.outputs import OUTPUT_PROCESSES
from kratos_lite.io.kratos.variables import LOADING
from kratos_lite.materials import MATERIALS


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("known-words", KnownWords)
    return {"parallel_read_safe": True}


class KnownWords(SphinxDirective):
    """A list or a table, by its name."""

    required_arguments = 1

    def run(self) -> list[Any]:
        """Return what the readers know."""
        return self.parse_text_to_nodes("\n".join(TABLES[self.arguments[0]]()))


def _code(words: Iterable[str]) -> str:
    return " ".join(f"`{word}`" for word in words) or "–"


def _table(*rows: tuple[str, ...], head: str) -> list[str]:
    return [head, "| --- " * len(rows[0]) + "|", *("| " + " | ".join(row) + " |" for row in rows)]


def _of_registry(registry: Any, head: str) -> list[str]:
    rows = [(f"`{name}`", _code(registry.aliases(name))) for name in registry]
    return _table(*rows, head=f"| {head} | also called |")


def _processes() -> list[str]:
    rows = []
    for name, process in processes.PROCESSES.items():
        keys = (*processes.COMMON, *process.keys, "entities" if process.on_conditions else "constrained")
        rows.append((f"`{name}`", _code(keys)))
    rows += [
        (f"`{name}`", _code(expected_values.FILE_KEYS if "json" in name else expected_values.NODE_KEYS))
        for name in expected_values.COMPARISONS
    ]
    rows += [(f"`{name}`", _code(process.words())) for name, process in OUTPUT_PROCESSES.items()]
    return _table(*rows, head="| process | keys of its `Parameters` |")


def _fields() -> list[str]:
    rows = []
    for key, field in FIELDS.items():
        variable = [field.kratos] if field.listed and field.kratos else []
        pictures = [name for name, (of, *_) in names_of_parts(FIELDS).items() if of == key]
        rows.append((f"`{key}`", field.unit or "–", _code(variable), ", ".join(field.where), _code(pictures)))
    return _table(*rows, head="| field | unit | in files | where | in pictures |")


TABLES: dict[str, Callable[[], list[str]]] = {
    "blocks": lambda: [_code(TOP)],
    "lists": lambda: [_code(LISTS)],
    "laws": lambda: _of_registry(MATERIALS, "law"),
    "properties": lambda: [_code(sorted(properties.USED))],
    "loading": lambda: [_code(sorted(LOADING))],
    "processes": _processes,
    "functions": lambda: [_code(sorted(expressions._FUNCTIONS))],
    "solver_settings": lambda: [_code(sorted(keys.SOLVER.keys() - keys.ELSEWHERE.keys()))],
    "dynamic": lambda: [_code(keys.IN_TIME)],
    "eigenvalues": lambda: [
        _code(keys.EIGEN_KEYS),
        "",
        *_table(*((f"`{k}`", _code(v)) for k, v in keys.EIGENSOLVERS.items()), head="| solver | keys |"),
    ],
    "fields": _fields,
    "ale": lambda: _table(*((f"`{k}`", _code(v)) for k, v in motion.KEYS.items()), head="| motion | keys |"),
}
