"""Results of many processes for ParaView: a `.vtu` file of each, and a `.pvtu` file that names them.

Source of the format: VTK User's Guide, "VTK File Formats", parallel file formats.
"""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path

import numpy as np

from kratos_lite.analysis.fields import fields
from kratos_lite.analysis.partitioned_static import PartResult
from kratos_lite.analysis.result import Result
from kratos_lite.atomic import all_or_none, write_whole
from kratos_lite.distributed.communicator import ALONE, Alone
from kratos_lite.distributed.partition import Partition
from kratos_lite.io.formats.vtu import HEAD, checked, described, write_vtu
from kratos_lite.typing import Numbers

Fields = tuple[Mapping[str, Numbers], Mapping[str, Numbers]]


def write_pieces(path: str | Path, result: Result, mode: str = "binary") -> None:
    """Write a result as `.pvtu`, with a piece for each part of its mesh; all processes with a part call it.

    Nodes between parts stand in several pieces, with the same values.  All files are written, or none.
    """
    path, (points, cells) = Path(path), fields(result)
    parts: Alone | Partition = ALONE
    if isinstance(result, PartResult):
        parts = result.partition
        smooth = {name: values for name, values in points.items() if np.asarray(values).dtype.kind == "f"}
        points |= {name: parts.average(np.asarray(values)) for name, values in smooth.items()}
        points["PARTITION_INDEX"] = parts.owner
    data = points, cells
    with all_or_none(), parts.agree_on_errors():
        if parts.rank == 0:
            names = [piece_of(path, number).name for number in range(parts.size)]
            write_whole(path, _index(data, names).encode())
        write_vtu(piece_of(path, parts.rank), result.mesh, *data, mode)


def piece_of(path: str | Path, number: int) -> Path:
    """Return the `.vtu` file of one part of a `.pvtu` file.

    >>> piece_of("out/beam.pvtu", 3).name
    'beam_3.vtu'
    """
    return Path(path).with_name(f"{Path(path).stem}_{number}.vtu")


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
    text += "".join(f'<Piece Source="{escape(name)}"/>\n' for name in pieces)
    return text + "</PUnstructuredGrid>\n</VTKFile>\n"
