"""BBar3D27N: twenty-seven-node hexahedron with a dilatation linear in x, y, z."""

from kratos_lite.elements.b_bar import BBar
from kratos_lite.quadrature import hexahedron
from kratos_lite.shapes.hexahedra import Hexahedron27


class BBar3D27N(BBar):
    """Twenty-seven-node hexahedron, 3x3x3 points, a dilatation linear in x, y, z."""

    shape = Hexahedron27
    rule = hexahedron(degree=5)
    dilatation = 1
