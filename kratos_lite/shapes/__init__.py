"""Shapes: reference cells with their shape functions, faces and node orders.

A family, a file each, is imported when one of its shapes is requested.
"""

from kratos_lite.shapes.base import LINEAR, SHAPES, Shape

__all__ = ["LINEAR", "SHAPES", "Shape"]

for _family, _cell, *_nodes in (
    ("faces", "Point", 1),
    ("faces", "Line", 2, 3),
    ("faces", "Triangle", 3, 6),
    ("faces", "Quadrilateral", 4, 8, 9),
    ("hexahedra", "Hexahedron", 8, 20, 27),
    ("pyramids", "Pyramid", 5, 13),
    ("tetrahedra", "Tetrahedron", 4, 10),
    ("wedges", "Wedge", 6, 15),
):
    LINEAR.expect(_cell.lower(), f"{__name__}.{_family}")
    for _count in _nodes:
        SHAPES.expect(f"{_cell}{_count}", f"{__name__}.{_family}")
