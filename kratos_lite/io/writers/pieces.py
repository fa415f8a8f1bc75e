"""Results of many processes for ParaView: a `.vtu` file of each, and a `.pvtu` file that names them.

Source of the format: VTK User's Guide, "VTK File Formats", parallel file formats.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.analysis.fields import fields
from kratos_lite.atomic import replacing
from kratos_lite.io.formats.vtu import HEAD, checked, described, escaped, writer_of
from kratos_lite.io.writers.endings import index_of, piece_of
from kratos_lite.mesh import Mesh, with_rows
from kratos_lite.typing import Mask, Numbers

if TYPE_CHECKING:
    from kratos_lite.analysis.result import Result

Fields = tuple[Mapping[str, Numbers], Mapping[str, Numbers]]


def write_pieces(path: str | Path, result: Result, mode: str = "binary") -> None:
    """Write a result as `.pvtu`, with a piece of each rank that has nodes; all ranks call it.

    A piece holds the own elements of the rank and their nodes, so that nodes between ranks stand in several
    pieces, with the same values; PARTITION_INDEX says which rank owns them.  All files are written, or none.
    """
    points, cells = fields(result)
    share, ranks = result.mesh.subdomain, result.mesh.ranks
    if share is not None:
        points = {name: share.fetch(np.asarray(values)) for name, values in points.items()}
        points["PARTITION_INDEX"] = share.owner
    mesh, data = _piece(result.mesh, points, cells)
    path = index_of(path)
    with ranks.together(), ExitStack() as files:  # all are written before one takes its place, the index last
        written = [rank for rank, count in enumerate(ranks.gather(mesh.n_nodes)) if count]
        if ranks.rank == 0:
            index = files.enter_context(replacing(path))
            index.write_text(_index(data, [piece_of(path, rank).name for rank in written]), encoding="utf-8")
        if ranks.rank in written:
            piece = piece_of(path, ranks.rank)
            write = writer_of(piece, mesh, *data, mode)
            with open(files.enter_context(replacing(piece)), "r+b") as file:
                write(file)
        ranks.agree()


def _piece(mesh: Mesh, points: Mapping[str, Numbers], cells: Mapping[str, Numbers]) -> tuple[Mesh, Fields]:
    """Return the own elements of a rank with their nodes, and their data."""
    if mesh.subdomain is None:
        return mesh, (points, cells)
    elements = mesh.own_elements
    nodes = mesh.own_nodes & ~mesh.used_nodes()  # those without an element are in one piece, too
    for block, at in with_rows(mesh.blocks):
        nodes[block.nodes[elements[at]]] = True
    data = tuple(
        {name: np.asarray(values)[kept] for name, values in given.items()}
        for given, kept in ((points, nodes), (cells, elements))
    )
    return _cut(mesh, nodes, elements), (data[0], data[1])


def _cut(mesh: Mesh, nodes: Mask, elements: Mask) -> Mesh:
    """Return the mesh of some elements and some nodes, among them all of theirs."""
    rows = np.cumsum(nodes) - 1
    blocks = []
    for block, at in with_rows(mesh.blocks):
        some = block.take(elements[at])
        blocks.append(type(block)(some.name, rows[some.nodes], some.ids, some.properties, some.shape))
    return Mesh(mesh.points[nodes], blocks, node_ids=mesh.node_ids[nodes], source=mesh.source)


def _index(data: Fields, pieces: list[str]) -> str:
    """Return the `.pvtu` file: what each piece holds, and their names."""
    kinds = zip(("PPointData", "PCellData"), data, strict=True)
    groups = {
        kind: checked(given, len(next(iter(given.values()))), kind) if given else [] for kind, given in kinds
    }
    groups["PPoints"] = [("Points", np.zeros((0, 3)))]
    text = HEAD.format("PUnstructuredGrid") + '<PUnstructuredGrid GhostLevel="0">\n'
    for kind, arrays in groups.items():
        members = "".join(f"<PDataArray {described(name, array)}/>\n" for name, array in arrays)
        text += f"<{kind}>\n{members}</{kind}>\n"
    text += "".join(f'<Piece Source="{escaped(name)}"/>\n' for name in pieces)
    return text + "</PUnstructuredGrid>\n</VTKFile>\n"
