"""Files for ParaView: `.vtu` (one mesh with its results) and `.pvd` (a series of them).

Source of the format and of the node orders: VTK User's Guide, "VTK File Formats".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import accumulate
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from kratos_lite import voigt
from kratos_lite.errors import InputError
from kratos_lite.io.output import write_whole
from kratos_lite.mesh import Block, Mesh

_HEAD = """<?xml version="1.0"?>
<VTKFile type="{}" version="1.0" byte_order="LittleEndian" header_type="UInt64">
"""
_TYPES = {"<f8": "Float64", "<i8": "Int64", "<i4": "Int32", "|u1": "UInt8"}
_COMPONENTS = {3: tuple("XYZ"), 6: voigt.NAMES}

Array = NDArray[Any]
Named = list[tuple[str, Array]]


def write_vtu(
    path: str | Path,
    mesh: Mesh,
    point_data: Mapping[str, Array] | None = None,
    cell_data: Mapping[str, Array] | None = None,
) -> None:
    """Write a mesh and its results for ParaView, VTK or meshio, as a whole or not at all.

    The numbers are stored in binary, uncompressed and unrounded.  Blocks of a kind without a shape are
    left out, together with their rows of `cell_data`.

    Parameters
    ----------
    path : the `.vtu` file to write.
    mesh : points in m and element blocks.
    point_data : (n,) or (n, k) numbers on the nodes by name; k = 3 is a vector, k = 6 a stress or strain
        xx, yy, zz, xy, yz, xz, and (n, 3, 3) a tensor.
    cell_data : the same on the elements, with one row per element through all blocks in order.

    Raises
    ------
    InputError
        An array has the wrong number of rows or holds no real numbers, or the file cannot be written.

    Examples
    --------
    >>> import numpy as np
    >>> from kratos_lite.shapes import Tetrahedron4
    >>> tetra = Block("T", np.array([[0, 1, 2, 3]]), np.array([1]), np.array([1]), Tetrahedron4)
    >>> mesh = Mesh(Tetrahedron4.nodes, [tetra])
    >>> write_vtu(getfixture("tmp_path") / "one.vtu", mesh, {"TEMPERATURE": np.ones(4)})
    """
    if Path(path).suffix.lower() == ".gz":
        raise InputError(f"{path}: ParaView reads no gzipped file; write it as .vtu")
    blocks = [block for block in mesh.blocks if block.shape is not None]
    keep = np.repeat([block.shape is not None for block in mesh.blocks], [len(b) for b in mesh.blocks])
    groups = {
        "PointData": _checked(point_data or {}, mesh.n_nodes, "node"),
        "CellData": [(n, a[keep]) for n, a in _checked(cell_data or {}, mesh.n_elements, "element")],
        "Points": [("Points", mesh.points.astype("<f8"))],
        "Cells": _cells(blocks),
    }
    head = _header(groups, mesh.n_nodes, sum(map(len, blocks)))
    arrays = [array for group in groups.values() for _, array in group]

    def write(file: BinaryIO) -> None:
        file.write(head.encode())
        for array in arrays:
            file.write(array.nbytes.to_bytes(8, "little"))
            file.write(np.ascontiguousarray(array).data.cast("B") if array.size else b"")
        file.write(b"\n</AppendedData>\n</VTKFile>\n")

    write_whole(path, write)


def write_pvd(path: str | Path, steps: Iterable[tuple[float, str]]) -> None:
    """Write the index of a time series: ParaView opens it and plays the steps.

    Parameters
    ----------
    path : the `.pvd` file to write.
    steps : time in s and name of the `.vtu` file, relative to the folder of `path`.

    Raises
    ------
    InputError
        The file cannot be written.

    Examples
    --------
    >>> write_pvd(getfixture("tmp_path") / "swing.pvd", [(0.0, "swing_0.vtu"), (0.1, "swing_1.vtu")])
    """
    sets = [
        f'<DataSet timestep="{float(time)!r}" part="0" file="{_escaped(name)}"/>\n' for time, name in steps
    ]
    text = _HEAD.format("Collection") + f"<Collection>\n{''.join(sets)}</Collection>\n</VTKFile>\n"
    write_whole(path, text.encode())


def _checked(data: Mapping[str, Array], rows: int, place: str) -> Named:
    """Return arrays of (rows, …) little-endian numbers of one of the types of the file."""
    checked = []
    for name, values in data.items():
        array = np.asarray(values)
        if array.ndim == 0 or len(array) != rows:
            raise InputError(f"{name}: expected one row per {place}, that is {rows}; got shape {array.shape}")
        if array.dtype.kind not in "biuf":
            raise InputError(f"{name}: expected real or whole numbers; got {array.dtype}")
        small = array.dtype.kind == "b" or array.dtype == np.int32
        checked.append((name, array.astype("<f8" if array.dtype.kind == "f" else "<i4" if small else "<i8")))
    return checked


def _cells(blocks: list[Block]) -> Named:
    """Return the three arrays that describe the cells, in the node order of VTK."""
    none = np.zeros(0, dtype="<i8")
    nodes, sizes, types = [none], [none], [none]
    for block in blocks:
        assert block.shape is not None
        if not block.shape.vtk:
            raise InputError(f"{block.name}: {block.shape.__name__} has no VTK number; set its `vtk`")
        nodes.append(block.nodes[:, list(block.shape.to_vtk)].astype("<i8").ravel())
        sizes.append(np.full(len(block), block.nodes.shape[1]))
        types.append(np.full(len(block), block.shape.vtk))
    return [
        ("connectivity", np.concatenate(nodes)),
        ("offsets", np.cumsum(np.concatenate(sizes)).astype("<i8")),
        ("types", np.concatenate(types).astype("|u1")),
    ]


def _header(groups: dict[str, Named], n_points: int, n_cells: int) -> str:
    """Return the XML in front of the binary data; each array is preceded by its size in 8 bytes."""
    arrays = [array for group in groups.values() for _, array in group]
    offsets = accumulate((8 + array.nbytes for array in arrays), initial=0)
    text = _HEAD.format("UnstructuredGrid") + "<UnstructuredGrid>\n"
    text += f'<Piece NumberOfPoints="{n_points}" NumberOfCells="{n_cells}">\n'
    for group, members in groups.items():
        text += f"<{group}>\n"
        for name, array in members:
            text += f'<DataArray {_describe(name, array)} format="appended" offset="{next(offsets)}"/>\n'
        text += f"</{group}>\n"
    return text + '</Piece>\n</UnstructuredGrid>\n<AppendedData encoding="raw">\n_'


def _describe(name: str, array: Array) -> str:
    """Return type, name and, for more than one number per row, the components as XML attributes."""
    text = f'type="{_TYPES[array.dtype.str]}" Name="{_escaped(name)}"'
    if array.ndim > 1:
        count = int(np.prod(array.shape[1:]))
        text += f' NumberOfComponents="{count}"'
        names = _COMPONENTS.get(count, ()) if name != "Points" else ()
        text += "".join(f' ComponentName{i}="{part}"' for i, part in enumerate(names))
    return text


def _escaped(name: str) -> str:
    """Return a name as the value of an XML attribute."""
    for sign, word in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;")):
        name = name.replace(sign, word)
    return name
