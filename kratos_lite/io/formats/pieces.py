"""From what each of several ranks has read of a model file, by ids, to the document that it holds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kratos_lite.distributed.directory import all_of
from kratos_lite.distributed.pieces import Kind, Piece
from kratos_lite.distributed.subdomains import subdomain_mesh
from kratos_lite.io.formats.document import Constraint, Data, Document
from kratos_lite.mesh import Block, Mesh, ids_of, rows_of_ids
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.records import replace
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


def kinds_of(mesh: Mesh, blocks: Sequence[Block]) -> tuple[Kind, ...]:
    """Return blocks of a mesh by ids; those of one name become one, as ranks have different ones."""
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
    found: dict[tuple[str, int], Any] = {}
    for all_of_rank in ranks.gather(
        [(one.variable, one.line, one.source, one.values.shape[1:]) for one in given]
    ):
        for number, (variable, *rest) in enumerate(all_of_rank):
            turn = sum(one[0] == variable for one in all_of_rank[:number])
            found.setdefault((variable, turn), rest)
    out = []
    for (variable, turn), (line, source, shape) in found.items():
        mine = [one for one in given if one.variable == variable][turn : turn + 1]
        table = [_table(one) for one in mine] or [np.zeros((0, 1 + int(np.prod(shape, dtype=int))))]
        own = np.concatenate([np.zeros(0, dtype=np.int64), *(one.ids for one in mine)])
        width = int(ranks.max(table[0].shape[1]))
        came: Ints
        values: Array
        came, values = all_of(ranks, own, _widened(table[0], width), ids)
        rows = rows_of_ids(ids, came)
        first = np.unique(rows, return_index=True)[1]
        came, values = came[first], values[first]
        numbers: Array = values[:, 1:].reshape(len(came), *shape) if width > 1 else np.zeros(0)
        out.append(Data(variable, came, values[:, 0] > 0, numbers, line, source))
    return out


def _table(data: Data) -> Array:
    """Return whether each value is fixed, and its numbers, (m, 1 + k)."""
    m = len(data.ids)
    numbers = data.values.reshape(m, -1) if data.values.size else np.zeros((m, 0))
    return np.column_stack([data.fixed.astype(float), numbers])


def _widened(table: Array, width: int) -> Array:
    return table if table.shape[1] == width else np.zeros((len(table), width))
