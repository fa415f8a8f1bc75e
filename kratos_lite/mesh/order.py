"""Order: nodes in the middle of edges, faces and cells, which make linear cells quadratic."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.elements import ELEMENTS
from kratos_lite.errors import MeshError
from kratos_lite.mesh.blocks import Block
from kratos_lite.mesh.finer import Finer
from kratos_lite.mesh.growth import Cut, Growth, name_of
from kratos_lite.mesh.hanging import known_centers
from kratos_lite.mesh.mesh import Mesh
from kratos_lite.mesh.subdivision import unchanged
from kratos_lite.shapes import Shape
from kratos_lite.shapes.faces import Line3, Quadrilateral8, Quadrilateral9, Triangle6
from kratos_lite.shapes.hexahedra import Hexahedron20
from kratos_lite.shapes.pyramids import Pyramid13
from kratos_lite.shapes.tetrahedra import Tetrahedron10
from kratos_lite.shapes.wedges import Wedge15

QUADRATIC: dict[str, type[Shape]] = {
    shape.cell: shape
    for shape in (Line3, Triangle6, Quadrilateral8, Tetrahedron10, Pyramid13, Wedge15, Hexahedron20)
}
"""The quadratic shape of each family with the fewest nodes."""


def raised(mesh: Mesh, element_of: Callable[[str], str] | None = None) -> Finer:
    """Return the same cells as quadratic elements; conditions follow the faces that they lie on."""
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
