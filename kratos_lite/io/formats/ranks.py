"""What each of several ranks holds of a document."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from kratos_lite.distributed.partition import partitioned, parts_of
from kratos_lite.distributed.pieces import Piece
from kratos_lite.distributed.subdomains import scattered
from kratos_lite.io.formats.document import Constraint, Document
from kratos_lite.io.formats.part_files import part_files, read_part_files
from kratos_lite.io.formats.pieces import joined, piece_of
from kratos_lite.mesh import Mesh, without_repeats
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.typing import Ints


def read_shared(path: Path, ranks: Alone, strict: bool, read: Callable[[Path, bool], Document]) -> Document:
    """Return what this rank holds of a model file that rank 0 reads, or of the part files that it stands for.

    Parameters
    ----------
    path : the file.
    ranks : that share the model.
    strict : of `.mdpa` files, as for one process.
    read : reads the whole file.
    """
    if files := part_files(path):
        return read_part_files(files, path, ranks, strict)
    with ranks.together():
        whole = read(path, strict) if ranks.rank == 0 else None
        if ranks.any(whole is not None and _has_repeated_values(whole)):
            return shared(ranks.first(whole), ranks)  # in which order they count, only the whole knows
        rest = ranks.first(None if whole is None else _without_mesh(whole))
        document = rest if whole is None else replace(whole, mesh=rest.mesh, geometries=[])
        piece = Piece() if whole is None else piece_of(whole.mesh)
        del whole
        return joined(ranks, document, partitioned(ranks, piece), rest.mesh.source)


def _has_repeated_values(document: Document) -> bool:
    given = (*document.nodal_data, *document.condition_data)
    return any(len(without_repeats(one.ids)) < len(one.ids) for one in given)


def _without_mesh(document: Document) -> Document:
    """Return what all ranks have of a document: all but cells, nodes and values on them."""
    return replace(
        document,
        mesh=Mesh(np.zeros((0, 3)), source=document.mesh.source),
        nodal_data=[],
        condition_data=[],
        element_data=[replace(one, ids=one.ids[:0], values=one.values[:0]) for one in document.element_data],
        geometries=[],
    )


def shared(document: Document, ranks: Alone) -> Document:
    """Return what this rank holds of a document that every rank has.

    Values of nodes and conditions that are elsewhere stay in it; whoever uses them skips them.

    Parameters
    ----------
    document : the same on all ranks.
    ranks : that share it.
    """
    mesh = document.mesh
    tied = [_rows(mesh, constraint) for constraint in document.constraints]
    own = scattered(mesh, ranks, parts_of(mesh, ranks), together=tied)
    here = np.isin(mesh.node_ids, own.node_ids)
    kept = [one for one, rows in zip(document.constraints, tied, strict=True) if here[rows].all()]
    return replace(document, mesh=own, constraints=kept)


def _rows(mesh: Mesh, constraint: Constraint) -> Ints:
    """Return the rows of the nodes of a constraint, of those that exist."""
    rows = mesh.node_rows([node for node, _ in (constraint.slave, *constraint.masters)])
    return rows[rows >= 0]
