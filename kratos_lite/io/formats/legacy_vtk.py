"""Legacy `.vtk` files as Kratos writes them: numbers in single precision, or as text with so many digits.

Source of the format: VTK User's Guide, "VTK File Formats", simple legacy formats.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from kratos_lite.atomic import refuse_nan, write_whole
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.blocks import ranges
from kratos_lite.mesh.vtk import vtk_cells
from kratos_lite.typing import Numbers

TITLE = "# vtk DataFile Version 4.0\nvtk output\n{}\nDATASET UNSTRUCTURED_GRID\n"


def write_legacy_vtk(
    path: str | Path,
    mesh: Mesh,
    point_data: Mapping[str, Numbers],
    cell_data: Mapping[str, Numbers],
    digits: int | None = None,
) -> None:
    """Write a mesh with data of nodes and elements, these by their ids; as text if it has digits."""
    text = [TITLE.format("BINARY" if digits is None else "ASCII").encode()]
    text += [f"POINTS {mesh.n_nodes} float\n".encode(), _numbers(path, "a coordinate", mesh.points, digits)]
    order = np.argsort(mesh.element_ids)
    if len(order):
        nodes, ends, types = vtk_cells(mesh.blocks, mesh.n_nodes)
        counts = np.diff(ends, prepend=0)
        starts, count = (ends - counts)[order], counts[order]
        cells = np.insert(nodes[ranges(starts, count)], np.cumsum(count) - count, count)
        rows = np.split(cells, np.cumsum(count + 1)[:-1]) if digits is not None else [cells]
        text += [
            f"\nCELLS {len(order)} {len(cells)}\n".encode(),
            *(_numbers(path, "", row, digits) for row in rows),
        ]
        text += [
            f"\nCELL_TYPES {len(order)}\n".encode(),
            _numbers(path, "", types[order, None].astype(int), digits),
        ]
    text += _data(path, "POINT_DATA", mesh.n_nodes, point_data, digits)
    if len(order):
        data = {name: np.asarray(values)[order] for name, values in cell_data.items()}
        text += _data(path, "CELL_DATA", len(order), data, digits)
    write_whole(path, b"".join(text))


def _data(
    path: str | Path, kind: str, count: int, data: Mapping[str, Numbers], digits: int | None
) -> list[bytes]:
    """Return data as a field for each name."""
    text = [f"{kind} {count}\nFIELD FieldData {len(data)}\n".encode()]
    for name, values in data.items():
        rows = np.asarray(values).reshape(count, int(np.prod(np.shape(values)[1:])))
        word = "int" if rows.dtype.kind in "iu" else "float"
        text += [f"{name} {rows.shape[1]} {count}  {word}\n".encode(), _numbers(path, name, rows, digits)]
    return text


def _numbers(path: str | Path, name: str, values: Numbers, digits: int | None) -> bytes:
    """Return numbers of single precision, or rows of text with so many digits."""
    whole = values.dtype.kind in "iu"
    single = values.astype(">i4" if whole else ">f4")
    refuse_nan(path, name, single)
    if digits is None:
        return single.tobytes() + b"\n"
    form = "{}" if whole else f"{{:.{digits}e}}"
    line = " ".join([form] * values.shape[-1]) + "\n"
    return "".join(line.format(*row) for row in np.atleast_2d(single).tolist()).encode()
