"""Shapes: reference cells with their shape functions, faces and node orders."""

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
from kratos_lite.shapes.hexahedra import Hexahedron8, Hexahedron20, Hexahedron27
from kratos_lite.shapes.inverse import Inverse, inverse_map
from kratos_lite.shapes.pyramids import Pyramid5, Pyramid13
from kratos_lite.shapes.tetrahedra import Tetrahedron4, Tetrahedron10
from kratos_lite.shapes.wedges import Wedge6, Wedge15

LINEAR.update(
    (shape.cell, shape)
    for shape in (Point1, Line2, Triangle3, Quadrilateral4, Tetrahedron4, Pyramid5, Wedge6, Hexahedron8)
)

__all__ = [
    "FACE_SHAPES",
    "LINEAR",
    "SHAPES",
    "Hexahedron8",
    "Hexahedron20",
    "Hexahedron27",
    "Inverse",
    "Line2",
    "Line3",
    "Point1",
    "Pyramid5",
    "Pyramid13",
    "Quadrilateral4",
    "Quadrilateral8",
    "Quadrilateral9",
    "Shape",
    "Tetrahedron4",
    "Tetrahedron10",
    "Triangle3",
    "Triangle6",
    "Wedge6",
    "Wedge15",
    "inverse_map",
]
