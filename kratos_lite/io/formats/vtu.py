"""Files for ParaView: `.vtu` (one mesh with its results), `.pvd` (a series of them), and Kratos's `.vtk`.

Source of the formats and of the node orders: VTK User's Guide, "VTK File Formats".
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from html import escape
from itertools import accumulate
from pathlib import Path
from typing import TypeAlias

import numpy as np

from kratos_lite import voigt
from kratos_lite.atomic import refuse_nan, replacing, write_whole
from kratos_lite.errors import InputError
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.blocks import ranges
from kratos_lite.mesh.vtk import vtk_cells, with_shape
from kratos_lite.native import threads
from kratos_lite.typing import Numbers

HEAD = """<?xml version="1.0"?>
<VTKFile type="{}" version="1.0" byte_order="LittleEndian" header_type="UInt64">
"""
"""First lines of a file of some type."""
_TYPES = {"<f8": "Float64", "<i8": "Int64", "<i4": "Int32", "|u1": "UInt8"}
_COMPONENTS = {3: tuple("XYZ"), 6: voigt.NAMES}

CELLS = ("connectivity", "offsets", "types")
MODES = ("binary", "compressed", "ascii")
"""How the numbers of a file are stored."""
BLOCK = 1 << 20
"""Bytes that are compressed together."""

Buffer: TypeAlias = "bytes | memoryview"
Named: TypeAlias = "list[tuple[str, Numbers]]"


def write_vtu(
    path: str | Path,
    mesh: Mesh,
    point_data: Mapping[str, Numbers] | None = None,
    cell_data: Mapping[str, Numbers] | None = None,
    mode: str = "binary",
) -> None:
    """Write a mesh in m and its results for ParaView, VTK or meshio, all or nothing; numbers are not rounded.

    Data on nodes (n, …) and elements (m, …) have 1, 3 (vector), 6 (xx yy zz xy yz xz) or 3×3 components.

    >>> import numpy as np
    >>> from kratos_lite.shapes.tetrahedra import Tetrahedron4
    >>> mesh = Mesh(Tetrahedron4.nodes, {"KinematicLinear3D4N": [[0, 1, 2, 3]]})
    >>> write_vtu(getfixture("tmp_path") / "one.vtu", mesh, {"TEMPERATURE": np.ones(4)})
    """
    if Path(path).suffix.lower() == ".gz":
        raise InputError(f"{path}: ParaView reads no gzipped file; write it as .vtu")
    check_mode(mode)
    blocks, keep = with_shape(mesh)
    nodal = checked(point_data or {}, mesh.n_nodes, "node")
    cells = [(name, array[keep]) for name, array in checked(cell_data or {}, mesh.n_elements, "element")]
    for name, values in (("a coordinate", mesh.points), *nodal, *cells):
        refuse_nan(path, name, values)
    groups = {
        "PointData": nodal,
        "CellData": cells,
        "Points": [("Points", mesh.points.astype("<f8", copy=False))],
        "Cells": list(zip(CELLS, vtk_cells(blocks, mesh.n_nodes), strict=True)),
    }
    arrays = [np.ascontiguousarray(array) for group in groups.values() for _, array in group]
    stored = [[] if mode == "ascii" else _compressed(a) if mode == "compressed" else _raw(a) for a in arrays]
    # Stored from the last to the first: meshio 5 moves offsets as it reads, and takes the first array
    # in the header that has the one it looks for, which must not be an array it has moved already.
    ends = accumulate((sum(map(len, pieces)) for pieces in reversed(stored)), initial=0)
    offsets = iter([*ends][-2::-1])
    appended = ' format="appended" offset="{}"/>'
    places = (_text(array) if mode == "ascii" else appended.format(next(offsets)) for array in arrays)
    head = _header(groups, mesh.n_nodes, sum(map(len, blocks)), mode, places)
    with replacing(path) as temporary, open(temporary, "r+b") as file:
        file.write(head.encode())
        for pieces in reversed(stored):
            file.writelines(pieces)
        file.write(b"</VTKFile>\n" if mode == "ascii" else b"\n</AppendedData>\n</VTKFile>\n")


def check_mode(mode: str) -> None:
    """Raise InputError for a way to store numbers that is none of `MODES`."""
    if mode not in MODES:
        raise InputError(f"a .vtu file is written as {', '.join(MODES)}; got {mode!r}")


def _raw(array: Numbers) -> list[Buffer]:
    """Return the size in bytes and the numbers."""
    return [array.nbytes.to_bytes(8, "little"), _bytes(array)]


def _bytes(array: Numbers) -> Buffer:
    return array.data.cast("B") if array.size else b""


def _compressed(array: Numbers) -> list[Buffer]:
    """Return the numbers in blocks that zlib has compressed, behind the sizes by which they are found."""
    import zlib
    from concurrent.futures import ThreadPoolExecutor

    data = _bytes(array)
    blocks = [data[at : at + BLOCK] for at in range(0, len(data), BLOCK)]
    with ThreadPoolExecutor(threads()) as pool:  # zlib lets other threads run meanwhile
        packed = list(pool.map(lambda block: zlib.compress(block, 1), blocks))
    sizes = [len(blocks), BLOCK, len(data) % BLOCK, *map(len, packed)]
    return [np.array(sizes, dtype="<u8").tobytes(), *packed]


def _text(array: Numbers) -> str:
    """Return the numbers as text that gives the same numbers when it is read, one row a line."""
    rows = array.reshape(len(array), -1).tolist() if array.size else []
    return ' format="ascii">\n' + "\n".join(" ".join(map(repr, row)) for row in rows) + "\n</DataArray>"


def write_pvd(path: str | Path, steps: Iterable[tuple[float, str]]) -> None:
    """Write the index of a time series: times in s, and names of `.vtu` files from the folder of `path`.

    >>> write_pvd(getfixture("tmp_path") / "swing.pvd", [(0.0, "swing_0.vtu"), (0.1, "swing_1.vtu")])
    """
    sets = [f'<DataSet timestep="{float(t)!r}" part="0" file="{escape(name)}"/>\n' for t, name in steps]
    text = HEAD.format("Collection") + f"<Collection>\n{''.join(sets)}</Collection>\n</VTKFile>\n"
    write_whole(path, text.encode())


def checked(data: Mapping[str, Numbers], rows: int, place: str) -> Named:
    """Return arrays of (rows, …) little-endian numbers of one of the types of the file."""
    arrays = []
    for name, values in data.items():
        array = np.asarray(values)
        if array.ndim == 0 or len(array) != rows:
            raise InputError(f"{name}: expected one row per {place}, that is {rows}; got shape {array.shape}")
        if array.dtype.kind not in "biuf":
            raise InputError(f"{name}: expected real or whole numbers; got {array.dtype}")
        small = array.dtype.kind == "b" or array.dtype == np.int32
        kind = "<f8" if array.dtype.kind == "f" else "<i4" if small else "<i8"
        arrays.append((name, array.astype(kind, copy=False)))
    return arrays


def _header(groups: dict[str, Named], n_points: int, n_cells: int, mode: str, places: Iterator[str]) -> str:
    """Return the XML up to the binary data; `places` gives for each array in turn where its numbers are."""
    text = HEAD.format("UnstructuredGrid")
    if mode == "compressed":
        text = text.replace("header_type", 'compressor="vtkZLibDataCompressor" header_type')
    text += f'<UnstructuredGrid>\n<Piece NumberOfPoints="{n_points}" NumberOfCells="{n_cells}">\n'
    for group, members in groups.items():
        text += f"<{group}>\n"
        for (name, array), place in zip(members, places, strict=False):
            text += f"<DataArray {described(name, array)}{place}\n"
        text += f"</{group}>\n"
    text += "</Piece>\n</UnstructuredGrid>\n"
    return text if mode == "ascii" else text + '<AppendedData encoding="raw">\n_'


def described(name: str, array: Numbers) -> str:
    """Return type, name and, for more than one number per row, the components as XML attributes."""
    text = f'type="{_TYPES[array.dtype.str]}" Name="{escape(name)}"'
    if array.ndim > 1:
        count = int(np.prod(array.shape[1:]))
        text += f' NumberOfComponents="{count}"'
        names = _COMPONENTS.get(count, ()) if name != "Points" else ()
        text += "".join(f' ComponentName{i}="{part}"' for i, part in enumerate(names))
    return text


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
