"""Writer of the five-file sets NAME.node, .elem, .cond, .prop and .init (Kratos data of 2008)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kratos_lite.atomic import all_or_none, write_whole
from kratos_lite.errors import InputError, Problems
from kratos_lite.io.formats.document import Data, Document
from kratos_lite.io.formats.elem.reader import stem
from kratos_lite.mesh import Block, Mesh


def write_elem(path: str | Path, document: Document) -> list[str]:
    """Write a document as a five-file set, all files or none; return notes on what the format cannot hold.

    >>> document = Document(Mesh([[0, 0, 0.1]]))
    >>> write_elem(getfixture("tmp_path") / "point", document)
    []
    >>> print((getfixture("tmp_path") / "point.node").read_text())
    NODES = NodesList([
    [1, 0.0, 0.0, 0.1]
    ])
    """
    if str(path).lower().endswith(".gz"):
        # A plain file of the same name beside it would be read in its place.
        raise InputError(f"{path}: five-file sets are not written gzipped; leave out the ending .gz")
    mesh, problems, notes = document.mesh, Problems(), _left_out(document)
    _check(document, problems)
    dofs = _dofs(document)
    fixed = [f"NODES[{n}].Fix({name});" for (n, name), (_, is_fixed) in dofs.items() if is_fixed]
    lines = {
        ".node": _node_lines(mesh),
        ".elem": _cell_lines(mesh, mesh.blocks, "ELEMENTS"),
        ".cond": [*fixed, *_cell_lines(mesh, mesh.conditions, "CONDITIONS")],
        ".prop": list(_property_lines(document, problems, notes)),
        ".init": [f"NODES[{n}]({name}, 0) = {value!r};" for (n, name), (value, _) in dofs.items()],
    }
    problems.raise_if_any()
    with all_or_none():
        for ending, text in lines.items():
            write_whole(stem(path) + ending, "".join(f"{line}\n" for line in text).encode("ascii"))
    return notes


def _left_out(document: Document) -> list[str]:
    kinds = ("constraints", "geometries", "tables", "model_data", "element_data", "condition_data")
    have = {"parts": document.mesh.parts} | {kind: getattr(document, kind) for kind in kinds}
    texts = [f"{len(items)} {kind.replace('_', ' ')}" for kind, items in have.items() if items]
    texts += [f"nodal {data.variable}" for data in document.nodal_data if not _is_scalar(data)]
    return [f"left out: {text}; a five-file set cannot hold it" for text in texts]


def _is_scalar(data: Data) -> bool:
    return data.values.shape == data.ids.shape


def _check(document: Document, problems: Problems) -> None:
    mesh = document.mesh
    if not mesh.n_nodes:
        problems.add("there are no nodes to write; expected at least one")
    for data in document.nodal_data:
        if not _is_scalar(data) and data.fixed.any():
            problems.add(f"{data.variable} is fixed as a whole; fix its components, e.g. {data.variable}_X")
        elif not np.isfinite(data.values).all():
            problems.add(f"some values of {data.variable} are not finite; expected finite numbers")
    names = [block.name for block in [*mesh.blocks, *mesh.conditions]]
    names += [data.variable for data in document.nodal_data]
    names += [name for properties in document.properties.values() for name in properties.values]
    for name in dict.fromkeys(names):
        if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
            problems.add(f"{name!r} cannot be written; expected a name of letters, digits and _")


def _node_lines(mesh: Mesh) -> list[str]:
    rows = zip(mesh.node_ids.tolist(), mesh.points.tolist(), strict=True)
    text = ",\n".join(f"[{node}, {x!r}, {y!r}, {z!r}]" for node, (x, y, z) in rows)
    return ["NODES = NodesList([", text, "])"]


def _cell_lines(mesh: Mesh, blocks: Sequence[Block], word: str) -> list[str]:
    return [
        f"{word}[{cell}] = {block.name}({nodes},{properties});"
        for block in blocks
        for cell, nodes, properties in zip(
            block.ids.tolist(), mesh.node_ids[block.nodes].tolist(), block.properties.tolist(), strict=True
        )
    ]


def _property_lines(document: Document, problems: Problems, notes: list[str]) -> Iterator[str]:
    """Yield the statements; values without a number are left out, with a note."""
    written = set()
    for number, properties in document.properties.items():
        for name, value in properties.values.items():
            if text := _number_text(value):
                written.add(number)
                yield f"PROPERTIES[{number}][{name}] = {text};"
            else:
                why = f".prop files hold numbers, not {value!r}"
                notes.append(f"left out: {name} of properties {number}; {why}")
    used = {int(number) for block in document.mesh.blocks for number in np.unique(block.properties)}
    for number in sorted(used - written - {0}) if written else ():
        problems.add(f"properties {number} have no number to write, but elements use them; give them a value")


def _number_text(value: Any) -> str:
    """Return a number, vector or matrix as text; nothing for anything else."""
    try:
        array = np.asarray(value)
    except ValueError:
        return ""
    fits = array.dtype.kind in "iuf" and array.ndim <= 2 and array.size and np.isfinite(array).all()
    return repr(array.astype(float).tolist()) if fits else ""


def _dofs(document: Document) -> dict[tuple[int, str], tuple[float, bool]]:
    """Return value and fixity by node and variable; where the document states one twice, the last value."""
    dofs: dict[tuple[int, str], tuple[float, bool]] = {}
    for data in filter(_is_scalar, document.nodal_data):
        # Values on nodes that do not exist mean nothing; the reader of the document noted them.
        known = document.mesh.node_rows(data.ids) >= 0
        columns = data.ids[known], data.values[known], data.fixed[known]
        for node, value, fixed in zip(*columns, strict=True):
            dof = int(node), data.variable
            dofs[dof] = float(value), bool(fixed) or dofs.get(dof, (0.0, False))[1]
    return dofs
