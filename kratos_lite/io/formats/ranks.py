"""What each of several ranks holds of a document."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np

from kratos_lite.distributed.partition import parts_of
from kratos_lite.distributed.subdomains import scattered
from kratos_lite.io.formats.document import Constraint, Document
from kratos_lite.io.formats.mdpa.ranges import Unusual
from kratos_lite.io.formats.mdpa.ranks import read_mdpa_by_ranks
from kratos_lite.io.formats.part_files import part_files, read_part_files
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.subdomain import Alone
from kratos_lite.records import replace
from kratos_lite.typing import Ints

LARGE = 4_000_000
"""Bytes of an `.mdpa` file from which each rank reads a range of it; smaller ones are read whole by all."""


def read_shared(path: Path, ranks: Alone, strict: bool, read: Callable[[Path, bool], Document]) -> Document:
    """Return what this rank holds of a model file, or of the part files that it stands for.

    Parameters
    ----------
    path : the file.
    ranks : that share the model.
    strict : of `.mdpa` files, as for one process.
    read : reads the whole file.
    """
    if files := part_files(path):
        return read_part_files(files, path, ranks, strict)
    if path.suffix.lower() == ".mdpa" and path.is_file() and path.stat().st_size >= LARGE:
        with suppress(Unusual):
            return read_mdpa_by_ranks(path, ranks, strict)
    return shared(read(path, strict), ranks)


def shared(document: Document, ranks: Alone) -> Document:
    """Return what this rank holds of a document that every rank has read.

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
