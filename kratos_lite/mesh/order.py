"""Order: nodes in the middle of edges, faces and cells, which make linear cells quadratic."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import MeshError
from kratos_lite.mesh.blocks import Block
from kratos_lite.mesh.centers import surroundings
from kratos_lite.mesh.finer import Finer
from kratos_lite.mesh.growth import Cut, Growth, name_of
from kratos_lite.mesh.hanging import known_centers
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.mesh.subdivision import unchanged
from kratos_lite.shapes import (
    Hexahedron20,
    Line3,
    Pyramid13,
    Quadrilateral8,
    Quadrilateral9,
    Shape,
    Tetrahedron10,
    Triangle6,
    Wedge15,
)
from kratos_lite.typing import Array, Ints

QUADRATIC: dict[str, type[Shape]] = {
    shape.cell: shape
    for shape in (Line3, Triangle6, Quadrilateral8, Tetrahedron10, Pyramid13, Wedge15, Hexahedron20)
}
"""The quadratic shape of each family with the fewest nodes."""


def raise_order(points: Array, corners: Ints, shape: type[Shape]) -> tuple[Array, Ints]:
    """Add the mid-edge, face and center nodes that `shape` has beyond its corners.

    Parameters
    ----------
    points : (n, 3) float.
    corners : (m, c) int, corner nodes of each cell in Kratos order.
    shape : the shape wanted.

    Returns
    -------
    points (n', 3), nodes (m, k); each new node lies in the middle of its corners.
    """
    around = surroundings(shape)
    nodes = [corners]
    for size in sorted({len(among) for among in around}):
        group = [among for among in around if len(among) == size]
        keys = np.sort(corners[:, np.array(group)], axis=2).reshape(-1, size)
        unique, inverse = np.unique(keys, axis=0, return_inverse=True)
        nodes.append(len(points) + inverse.reshape(len(corners), len(group)))
        points = np.vstack([points, points[unique].mean(axis=1)])
    return points, np.hstack(nodes)


def raised(mesh: Mesh, element_of: Callable[[str], str] | None = None) -> Finer:
    """Return the same cells as quadratic elements; conditions follow the faces that they lie on.

    Parameters
    ----------
    mesh : the mesh; nodes of cells that are quadratic already stay where they are.
    element_of : gives the name of the new element from that of the old one; linear elements become quadratic
        ones of the same family, hexahedra with 20 nodes, if not given.

    Returns
    -------
    Finer
        The mesh, and how it has come from the old one.

    Raises
    ------
    MeshError
        The mesh has hanging nodes, or an element of another family would take its place.

    Examples
    --------
    >>> from kratos_lite import box
    >>> raised(box()).mesh.blocks[0].name
    'Element3D20N'
    """
    if mesh.hanging is not None:
        raise MeshError("a mesh with hanging nodes keeps its order: raise the order first, then refine")
    names = {block.name: (element_of or quadratic)(block.name) for block in mesh.blocks}
    centered = any(len(ELEMENTS[name].nodes) == 27 for name in names.values())

    def target(block: Block, cell: str) -> tuple[str, type[Shape]]:
        if block.name in names:
            return names[block.name], ELEMENTS[names[block.name]].shape
        shape = Quadrilateral9 if centered and cell == "quadrilateral" else QUADRATIC[cell]
        return name_of(block.name, shape), shape

    def whole(block: Block, at: slice) -> list[Cut]:
        shape = block.shape
        if shape is None or shape.cell == "point" or not len(block):
            return []
        if ELEMENTS[names[block.name]].shape.cell != shape.cell if block.name in names else False:
            raise MeshError(f"{names[block.name]} cannot take the place of {block.name}")
        return [(np.arange(len(block)), [unchanged(shape.cell)])]

    growth = Growth(mesh, known_centers(mesh.blocks, None), target)
    growth.elements(whole)
    growth.conditions(whole)
    return growth.finer()


def quadratic(name: str) -> str:
    """Return the name of the quadratic element of the same family as an element.

    >>> quadratic("KinematicLinear3D6N")
    'KinematicLinear3D15N'
    """
    shape = ELEMENTS[name].shape
    return name if len(shape.nodes) > shape.corners else name_of(name, QUADRATIC[shape.cell])
