"""Shapes: reference cells with their shape functions, faces and node orders.

A family of solid cells, a file each, is imported when one of its shapes is asked for.
"""

from kratos_lite.shapes.base import LINEAR, SHAPES, Shape
from kratos_lite.shapes.faces import (
    FACE_SHAPES,
    Line2,
    Line3,
    Point1,
    Quadrilateral4,
    Quadrilateral8,
    Quadrilateral9,
    Triangle3,
    Triangle6,
)

__all__ = [
    "FACE_SHAPES",
    "LINEAR",
    "SHAPES",
    "Line2",
    "Line3",
    "Point1",
    "Quadrilateral4",
    "Quadrilateral8",
    "Quadrilateral9",
    "Shape",
    "Triangle3",
    "Triangle6",
]

for _family, _cell, *_nodes in (
    ("hexahedra", "Hexahedron", 8, 20, 27),
    ("pyramids", "Pyramid", 5, 13),
    ("tetrahedra", "Tetrahedron", 4, 10),
    ("wedges", "Wedge", 6, 15),
):
    LINEAR.expect(_cell.lower(), f"{__name__}.{_family}")
    for _count in _nodes:
        SHAPES.expect(f"{_cell}{_count}", f"{__name__}.{_family}")
