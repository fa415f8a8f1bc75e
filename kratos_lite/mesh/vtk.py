"""Cells as VTK numbers them, for files and for PyVista.

Source of the node orders: VTK User's Guide, "VTK File Formats".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from kratos_lite.errors import InputError, KratosLiteError
from kratos_lite.mesh.blocks import Block, Cells
from kratos_lite.typing import Mask, Numbers


def mesh_fields(mesh: Cells) -> tuple[dict[str, Numbers], dict[str, Numbers]]:
    """Return the point and cell data that every file carries: ids of nodes, elements and properties."""
    none = np.zeros(0, dtype=np.int64)
    properties = np.concatenate([none, *(block.properties for block in mesh.blocks)])
    return {"NODE_ID": mesh.node_ids}, {"ELEMENT_ID": mesh.element_ids, "PROPERTIES_ID": properties}


def with_shape(mesh: Cells) -> tuple[list[Block], Mask | slice]:
    """Return the blocks of cells that can be shown, and which elements these are."""
    shown = [block.shape is not None for block in mesh.blocks]
    blocks = [block for block in mesh.blocks if block.shape is not None]
    return blocks, slice(None) if all(shown) else np.repeat(shown, [len(block) for block in mesh.blocks])


def vtk_cells(blocks: Sequence[Block], n_nodes: int) -> tuple[Numbers, Numbers, Numbers]:
    """Return nodes of all cells in the order of VTK, the end of each cell in them, and its type (m,)."""
    size = sum(block.nodes.size for block in blocks)
    index = "<i4" if max(size, n_nodes) < 2**31 else "<i8"
    nodes = np.empty(size, dtype=index)
    at = 0
    for block in blocks:
        shape = block.known_shape
        if not shape.vtk:
            raise InputError(f"{block.name}: {shape.__name__} has no VTK number; set its `vtk`")
        nodes[at : at + block.nodes.size] = block.nodes[:, list(shape.to_vtk)].ravel()
        at += block.nodes.size
    counts = [len(block) for block in blocks]
    sizes = np.repeat([block.nodes.shape[1] for block in blocks], counts)
    types = np.repeat([block.known_shape.vtk for block in blocks], counts)
    return nodes, np.cumsum(sizes, dtype=index), types.astype("|u1")


def pyvista_grid(mesh: Cells, point_data: Mapping[str, Numbers], cell_data: Mapping[str, Numbers]) -> Any:
    """Return a grid of PyVista with data of nodes and elements."""
    try:
        from pyvista import UnstructuredGrid
    except ImportError as error:
        raise KratosLiteError(
            "grids need PyVista: pip install pyvista; kl.write('x.vtu', ...) writes the same for ParaView"
        ) from error
    blocks, keep = with_shape(mesh)
    nodes, ends, types = vtk_cells(blocks, len(mesh.points))
    begins = np.append(0, ends[:-1]) if len(ends) else ends
    counted = np.insert(nodes.astype(np.int64), begins, ends - begins)
    grid = UnstructuredGrid(counted, types, mesh.points.copy())
    for name, values in point_data.items():
        grid.point_data[name] = values
    for name, values in cell_data.items():
        grid.cell_data[name] = values[keep]
    return grid
