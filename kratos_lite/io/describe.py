"""Describe: what a document holds, for ``kratos-lite info``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from kratos_lite.analysis.nodal_loads import external_loads
from kratos_lite.analysis.report import sizes
from kratos_lite.elements import ELEMENTS
from kratos_lite.elements.formulations import element_of, is_unnamed
from kratos_lite.errors import KratosLiteError
from kratos_lite.io.formats.document import Data, Document
from kratos_lite.io.formats.mdpa.values import Table
from kratos_lite.mesh import Block
from kratos_lite.model.loads import TimeDependentLoad
from kratos_lite.model.structure import Structure


def describe(document: Document) -> str:
    """Return a table of what a document holds, with line numbers of what will not be used."""
    mesh = document.mesh
    lines = [f"{'file':<12}{mesh.source}", f"{'nodes':<12}{mesh.n_nodes}"]
    if mesh.n_nodes:
        low, high = mesh.extent
        lines.append(
            f"{'extent':<12}" + " × ".join(f"[{a:g}, {b:g}]" for a, b in zip(low, high, strict=True)) + " m"
        )
    lines += _blocks("elements", mesh.blocks, known=True)
    lines += _blocks("conditions", mesh.conditions)
    lines += _blocks("geometries", document.geometries)
    for properties in document.properties.values():
        shown = [
            f"{name} {_short(value)}"
            for name, value in properties.values.items()
            if not isinstance(value, Table)
        ]
        values = ", ".join(shown) or "empty"
        lines.append(f"{'properties':<12}{properties.id}: {values}{_at(properties.line)}")
    for title, group in (
        ("nodal data", document.nodal_data),
        ("element data", document.element_data),
        ("cond. data", document.condition_data),
    ):
        lines += [f"{title:<13}{_data(data)}" for data in group]
    if document.constraints:
        lines.append(f"{'constraints':<12} {len(document.constraints)} multi-point constraints")
    if document.tables:
        lines.append(f"{'tables':<12}{len(document.tables)}, not used")
    lines += [f"{'data':<12}{name} {_short(value)}" for name, value in document.model_data.items()]
    lines += _parts(document)
    lines += [f"{'note':<12}{note}" for note in document.notes]
    return "\n".join(lines)


def amounts(model: Structure, time: float = 0.0) -> list[tuple[str, str]]:
    """Return loads at a time in s in words and their sum, volume and mass, as far as a model says them."""
    acting = [(model._label(load), *pair) for load in model.loads for pair in load.acting(time)]
    when = f" at t = {time:g} s" if any(isinstance(load, TimeDependentLoad) for load in model.loads) else ""
    rows = [
        ("load", name + (f"{size:g} × " if size != 1 else "") + f"{load}{when}")
        for name, size, load in acting
    ]
    with suppress(KratosLiteError):
        groups = model.element_groups()
        rows += sizes(model.mesh.points, groups)
        force = sum(size * external_loads(model, groups, [load]).sum(axis=0) for _, size, load in acting)
        total = (force + np.zeros(3)).tolist()
        rows.append(("total load", f"({', '.join(map(_short, total))}) N{when}"))
    return rows


def _at(line: int) -> str:
    return f" (line {line})" if line else ""


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return "[" + ", ".join(_short(v) for v in value.tolist()) + "]"
    if isinstance(value, list):
        return _short(np.array(value))
    return f"{value + 0.0:g}" if isinstance(value, float) else str(value)  # + 0.0 makes -0 a 0


def _blocks(title: str, blocks: Sequence[Block], known: bool = False) -> Iterable[str]:
    counts: Counter[str] = Counter()
    for block in blocks:
        counts[block.name] += len(block)
    for name, count in counts.items():
        if count:
            remark = ""
            if known and name not in ELEMENTS:
                remark = ", an element that kratos_lite cannot solve"
            elif known and is_unnamed(name):
                remark = f", which names no formulation: solved as {element_of(name, None, None).__name__}"
            elif known and ELEMENTS[name].__name__ != name:
                remark = f", solved as {ELEMENTS[name].__name__}"
            yield f"{title:<12}{count} {name}{remark}"
    empty = sum(1 for count in counts.values() if not count)
    if empty:
        yield f"{title:<12}{empty} empty blocks of other kinds"


def _data(data: Data) -> str:
    fixed = int(data.fixed.sum())
    return f"{data.variable}: {len(data.ids)} values, {fixed} fixed{_at(data.line)}"


def _parts(document: Document) -> Iterable[str]:
    for name, part in document.mesh.parts.items():
        indent = "  " * name.count(".")
        yield f"{'part':<12}{indent}{name.rsplit('.', 1)[-1]}: {part}"
