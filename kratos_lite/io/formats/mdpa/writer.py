"""Write Kratos model files, `.mdpa`, so that both Kratos and kratos_lite read the same numbers back."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kratos_lite.atomic import write_whole
from kratos_lite.elements import ELEMENTS
from kratos_lite.elements.formulations import is_unnamed
from kratos_lite.errors import InputError
from kratos_lite.io.formats.document import Constraint, Data, Document, Note
from kratos_lite.io.formats.mdpa.mesh import NUMBERS, PART_NAME, WORDS, chain_of, member_ids
from kratos_lite.io.formats.mdpa.scan import NAME
from kratos_lite.io.formats.mdpa.values import Table, kind_of
from kratos_lite.io.names import PRESTRESS, kratos_name
from kratos_lite.mesh import Block, Mesh

Lines = Iterator[str]


def write_mdpa(path: str | Path, document: Document) -> list[Note]:
    """Write a document for Kratos and kratos_lite, all or nothing; return notes on what Kratos does not know.

    Numbers are written with the digits that give exactly the same number again, elements and conditions by
    the names of Kratos; elements keep theirs where a prestress or an initial displacement, which the present
    elements of Kratos ignore, is their initial state.

    >>> path = getfixture("tmp_path") / "one.mdpa"
    >>> _ = write_mdpa(path, Document(Mesh([[0.1, 0, 0]], node_ids=[7])))
    >>> print(path.read_text().strip())
    Begin Nodes
    7 0.1 0.0 0.0
    End Nodes
    """
    keep = _has_initial_state(document)
    try:
        data = "\n".join(_lines(document, keep)).encode("ascii") + b"\n"
    except (InputError, UnicodeEncodeError) as error:
        raise InputError(f"{path}: cannot be written: {error}") from None
    if str(path).lower().endswith(".gz"):
        import gzip

        data = gzip.compress(data, mtime=0)
    write_whole(path, data)
    return _unknown_to_kratos(document, keep) + ([] if keep else _made_plain(document))


def _has_initial_state(document: Document) -> bool:
    """Whether a document has a prestress, or a displacement of free nodes."""
    stresses = (p.values.get(name) for p in document.properties.values() for name in PRESTRESS)
    return any(np.any(stress) for stress in stresses if stress is not None) or any(
        data.variable.startswith("DISPLACEMENT") and data.values[~data.fixed].any()
        for data in document.nodal_data
    )


def _unknown_to_kratos(document: Document, keep: bool) -> list[Note]:
    """Note what would stop Kratos: contact faces and names of 2008, and elements that users defined."""
    counts = Counter[str]()
    mesh = document.mesh
    for block in (*mesh.blocks, *mesh.conditions):
        name = block.name if keep and block in mesh.blocks else kratos_name(block.name)
        built_in = ("KinematicLinear3D", "BBar3D8N")
        is_custom = name in ELEMENTS and not ELEMENTS[name].__name__.startswith(built_in)
        is_old = name.startswith(("KinematicLinear", "TotalLagrangian3D"))
        if is_custom or is_old or "ContactFace" in name or re.search(r"3D\d+$", name):
            counts[name] += len(block)
    text = "{} {} are written, but Kratos 10 does not know them"
    return [Note(0, text.format(n, name)) for name, n in counts.items() if n]


def _made_plain(document: Document) -> list[Note]:
    """Note elements without a formulation, which the file gives one."""
    names = sorted({block.name for block in document.mesh.blocks if len(block) and is_unnamed(block.name)})
    text = (
        "{}, which names no formulation, is written as {}, the plain element; to solve by another, ask for "
    )
    text += "formulation='non_locking' (--formulation non_locking)"
    return [Note(0, text.format(name, kratos_name(name))) for name in names]


def _lines(document: Document, keep: bool) -> Lines:
    """Yield the lines of the file in the order that Kratos needs: what is referred to comes first."""
    mesh = document.mesh
    if document.model_data:
        yield from _block("ModelPartData", _values(document.model_data))
    for number, table in document.tables.items():
        yield from _table(f"Table {number}", table)
    yield from _properties(document)
    yield from _block("Nodes", _rows(mesh.node_ids[:, None], mesh.points))
    for kind, blocks in (
        ("Geometries", document.geometries), ("Elements", mesh.blocks), ("Conditions", mesh.conditions),
    ):  # fmt: skip
        for block in blocks:
            is_kept = kind == "Geometries" or (kind == "Elements" and keep)
            yield from _cells(kind, block, mesh, block.name if is_kept else kratos_name(block.name))
    yield from _constraints(document.constraints)
    for kind, entries in (
        ("NodalData", document.nodal_data), ("ElementalData", document.element_data),
        ("ConditionalData", document.condition_data),
    ):  # fmt: skip
        for data in entries:
            yield from _block(f"{kind} {_name(data.variable)}", _data(data, kind == "NodalData"))
    yield from _parts(document)


def _block(header: str, body: Iterable[str]) -> Lines:
    yield f"Begin {header}"
    yield from body
    yield f"End {header.split(maxsplit=1)[0]}\n"


def _name(name: str) -> str:
    if not NAME.fullmatch(name.encode()) or name in ("Begin", "End"):
        raise InputError(f"{name!r} is no name for a .mdpa file; use letters, digits and '_'")
    return name


def _rows(ints: NDArray[Any], reals: ArrayLike = ()) -> Lines:
    """Yield the lines of a table of integers (m, a), followed by reals (m, b)."""
    numbers = np.asarray(reals, dtype=float).reshape(len(ints), -1 if len(ints) else 0)
    if not np.isfinite(numbers).all():
        raise InputError("a number is not finite (nan or inf); give a finite one")
    for row, more in zip(ints.tolist(), numbers.tolist(), strict=True):
        yield " ".join([*map(str, row), *map(repr, more)])


def _properties(document: Document) -> Lines:
    """Yield the Properties; those that cells use but nobody filled become empty blocks."""
    mesh = document.mesh
    used = {int(n) for block in (*mesh.blocks, *mesh.conditions) for n in np.unique(block.properties)}
    for number in [*document.properties, *sorted(used - document.properties.keys())]:
        values = document.properties[number].values if number in document.properties else {}
        yield from _block(f"Properties {number}", _values(values))


def _values(values: dict[str, Any]) -> Lines:
    for name, value in values.items():
        if isinstance(value, Table):
            yield from _table("Table", value)
        else:
            yield f" {_name(name)} {_value(name, value)}"


def _value(name: str, value: Any) -> str:
    """Return a value as Kratos reads it."""
    if isinstance(value, (bool, np.bool_)):
        return str(bool(value))
    if isinstance(value, (int, np.integer)) and kind_of(name) != "number":
        return str(int(value))
    if isinstance(value, str):
        if not value or re.search(r"[\s\[\]()]|//|/\*", value) or value in ("Begin", "End"):
            raise InputError(f"{name}: {value!r} is not a single word")
        return value
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.ndim > 2:
        raise InputError(f"{name}: {value!r} is not a number, word, vector or matrix")
    return _array(name, array)


def _array(name: str, array: NDArray[Any]) -> str:
    """Return a number, a vector or a matrix as Kratos reads it."""
    if not np.isfinite(array).all():
        raise InputError(f"{name}: a number is not finite (nan or inf); give a finite one")
    text = repr(array.astype(float).tolist()).replace(" ", "").replace("[", "(").replace("]", ")")
    return f"[{','.join(map(str, array.shape))}] {text}" if array.ndim else text


def _table(header: str, table: Any) -> Lines:
    if not isinstance(table, Table):
        raise InputError(f"{header}: expected a Table, got {type(table).__name__}")
    rows = _rows(np.zeros((len(table.rows), 0)), table.rows)
    yield from _block(f"{header} {_name(table.x)} {_name(table.y)}", rows)


def _cells(kind: str, block: Block, mesh: Mesh, name: str) -> Lines:
    columns = [block.ids[:, None], mesh.node_ids[block.nodes]]
    if kind != "Geometries":
        columns.insert(1, np.asarray(block.properties)[:, None])
    yield from _block(f"{kind} {_name(name)}", _rows(np.hstack(columns)))


def _constraints(constraints: list[Constraint]) -> Lines:
    """Yield the constraints, those of the same variables in one block."""
    # Kratos misreads a block whose constraints have different numbers of independent nodes.
    for (_, *words), group in groupby(constraints, key=_header):
        rows = []
        for c in group:
            constant, *weights = (_array(f"constraint {c.id}", np.array(x)) for x in (c.constant, *c.weights))
            nodes = " ".join(str(node) for node, _ in (c.dependent, *c.independents))
            rows.append(f"{c.id} {constant} [{','.join(weights)}] {nodes}")
        yield from _block(" ".join(["Constraints", *map(_name, map(str, words))]), rows)


def _header(constraint: Constraint) -> tuple[int | str, ...]:
    """Return the number of independent nodes, the name and the variables of the header."""
    # Kratos misreads a header with more than the dependent node's variable where one is enough.
    variables = [constraint.dependent[1], *(variable for _, variable in constraint.independents)]
    shown = variables[:1] if len(set(variables)) == 1 else variables
    return (len(constraint.independents), constraint.name, *shown)


def _data(data: Data, is_nodal: bool) -> Lines:
    """Yield the rows of nodal, elemental or conditional data."""
    values = np.asarray(data.values)
    if not values.size:
        return _rows(data.ids[:, None])
    columns = [data.ids, data.fixed.astype(np.int64)] if is_nodal else [data.ids]
    if values.ndim > 1:
        rows = zip(_rows(np.stack(columns, axis=1)), values, strict=True)
        return (f"{row} {_array(data.variable, value)}" for row, value in rows)
    if kind_of(data.variable) == "truth":
        return _rows(np.stack([*columns, values.astype(np.int64)], axis=1))
    return _rows(np.stack(columns, axis=1), values)


def _parts(document: Document) -> Lines:
    parts = document.mesh.parts
    ids = member_ids(document)
    children: dict[str, list[str]] = {}
    for name in parts:
        if not PART_NAME.fullmatch(name):
            raise InputError(f"part {name!r} has no name for a .mdpa file; use letters, digits, '_' and '-'")
        parent = next((ancestor for ancestor in chain_of(name)[-2::-1] if ancestor in parts), "")
        children.setdefault(parent, []).append(name)

    def lines(name: str, parent: str) -> Lines:
        part = parts[name]
        body: list[str] = []
        if part.data:
            body += _block("SubModelPartData", _values(part.data))
        for kind in WORDS:
            members = getattr(part, kind)
            if len(members):
                numbers = members if kind in NUMBERS else ids[kind][members].tolist()
                body += _block(f"SubModelPart{kind.capitalize()}", map(str, numbers))
        for child in children.get(name, ()):
            body += lines(child, name)
        yield from _block(f"SubModelPart {name.removeprefix(parent + '.')}", body)

    for name in children.get("", ()):
        yield from lines(name, "")
