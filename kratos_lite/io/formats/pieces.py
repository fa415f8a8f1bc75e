"""From what each of several ranks has read of a model file, by ids, to the document that it holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite.distributed.directory import all_of
from kratos_lite.distributed.pieces import Kind, Piece
from kratos_lite.distributed.subdomains import subdomain_mesh
from kratos_lite.errors import InputError
from kratos_lite.io.formats.document import Constraint, Data, Document
from kratos_lite.mesh import Block, Mesh, ids_of, rows_of_ids
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.typing import Array, Ints


def joined(ranks: Alone, document: Document, piece: Piece, source: str) -> Document:
    """Return what this rank holds of the document of all ranks.

    Parameters
    ----------
    ranks : the communicator.
    document : what this rank has read, whose mesh is not used: its constraints and properties are those of
        the model, its values on nodes and conditions any share of them.
    piece : what this rank gives of the mesh.
    source : name of the file, used in messages.

    Raises
    ------
    MeshError
        As for `subdomain_mesh`.
    """
    wanted = [node for one in document.constraints for node, _ in (one.slave, *one.masters)]
    piece = replace(piece, wanted=np.unique(np.array(wanted, dtype=np.int64)))
    mesh = subdomain_mesh(ranks, piece, source=source)
    return replace(
        document,
        mesh=mesh,
        nodal_data=spread(ranks, document.nodal_data, mesh.node_ids),
        condition_data=spread(ranks, document.condition_data, ids_of(mesh.conditions)),
        element_data=[replace(one, ids=one.ids[:0], values=one.values[:0]) for one in document.element_data],
        constraints=[one for one in document.constraints if _touches(one, mesh)],
    )


def _touches(constraint: Constraint, mesh: Mesh) -> bool:
    """Return whether a constraint has an own node."""
    rows = mesh.node_rows([node for node, _ in (constraint.slave, *constraint.masters)])
    return bool(mesh.own_nodes[rows[rows >= 0]].any())


def piece_of(mesh: Mesh, owners: Ints | None = None, merge: bool = False) -> Piece:
    """Return a mesh that this rank has read, by ids.

    Parameters
    ----------
    mesh : of one process.
    owners : as of a `Piece`.
    merge : make blocks of one name one, as other ranks have different ones.
    """
    ids: dict[str, Ints] = {
        "nodes": mesh.node_ids,
        "elements": mesh.element_ids,
        "conditions": ids_of(mesh.conditions),
    }
    kinds = _merged if merge else _one_by_one
    parts = {
        name: replace(part, **{what: of[getattr(part, what)] for what, of in ids.items()})
        for name, part in mesh.parts.items()
    }
    elements, conditions = kinds(mesh, mesh.blocks), kinds(mesh, mesh.conditions)
    return Piece(elements, conditions, mesh.node_ids, mesh.points, owners, parts=parts)


def _one_by_one(mesh: Mesh, blocks: Sequence[Block]) -> tuple[Kind, ...]:
    return tuple(
        Kind(b.name, mesh.node_ids[b.nodes], b.ids, b.properties, b.shape, b.lines, place)
        for place, b in enumerate(blocks)
    )


def _merged(mesh: Mesh, blocks: Sequence[Block]) -> tuple[Kind, ...]:
    found: dict[str, Kind] = {}
    for block in blocks:
        kind = Kind(block.name, mesh.node_ids[block.nodes], block.ids, block.properties, block.shape)
        old = found.get(block.name)
        found[block.name] = kind if old is None else kind.with_table(np.concatenate([old.table, kind.table]))
    return tuple(found.values())


def spread(ranks: Alone, given: Sequence[Data], ids: Ints) -> list[Data]:
    """Return the values of some ids from all ranks, in the order of the first rank that has each variable.

    Where an id has several values of a variable, those of the lowest rank count.
    """
    out = []
    for (variable, turn), (line, source, shape) in _variables(ranks, given).items():
        mine = [one for one in given if one.variable == variable][turn : turn + 1]
        own = np.concatenate([np.zeros(0, dtype=np.int64), *(one.ids for one in mine)])
        width = 0 if shape is None else int(np.prod(shape, dtype=int))
        none = np.zeros((0, 1 + width))
        came: Ints
        values: Array
        table = np.concatenate([none, *(_table(one) for one in mine if len(one.ids))])
        came, values = all_of(ranks, own, table, ids)
        rows = rows_of_ids(ids, came)
        first = np.unique(rows, return_index=True)[1]
        came, values = came[first], values[first]
        numbers: Array = values[:, 1:].reshape(len(came), *(shape or ())) if width else np.zeros(0)
        out.append(Data(variable, came, values[:, 0] > 0, numbers, line, source))
    return out


def _variables(ranks: Alone, given: Sequence[Data]) -> dict[tuple[str, int], list[Any]]:
    """Return line, source and shape of one value of each block of values, by variable and turn.

    The shape is that on the ranks that have values, None where nobody has any.
    """
    found: dict[tuple[str, int], list[Any]] = {}
    for all_of_rank in ranks.gather([(one.variable, one.line, one.source, shape_of(one)) for one in given]):
        for number, (variable, line, source, shape) in enumerate(all_of_rank):
            turn = sum(one[0] == variable for one in all_of_rank[:number])
            known = found.setdefault((variable, turn), [line, source, shape])
            known[2] = shape if known[2] is None else known[2]
            if shape not in (None, known[2]):
                raise InputError(
                    f"{source or variable}: {variable} has values of size {list(shape)} in line {line}, but "
                    f"of size {list(known[2])} on another rank; give all the same size"
                )
    return found


def shape_of(data: Data) -> tuple[int, ...] | None:
    """Return the shape of one value, (0,) of a flag; None where there are none."""
    if not len(data.ids):
        return None
    return data.values.shape[1:] if data.values.size else (0,)


def _table(data: Data) -> Array:
    """Return whether each value is fixed, and its numbers, (m, 1 + k)."""
    m = len(data.ids)
    numbers = data.values.reshape(m, -1) if data.values.size else np.zeros((m, 0))
    return np.column_stack([data.fixed.astype(float), numbers])
