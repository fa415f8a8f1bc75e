"""BBar3D20N: twenty-node serendipity hexahedron with a dilatation linear in x, y, z."""

from kratos_lite.elements.b_bar import BBar
from kratos_lite.quadrature import hexahedron
from kratos_lite.shapes.hexahedra import Hexahedron20


class BBar3D20N(BBar):
    """Twenty-node serendipity hexahedron, 3x3x3 points, a dilatation linear in x, y, z."""

    shape = Hexahedron20
    rule = hexahedron(degree=5)
    dilatation = 1
