"""BBar3D13N: thirteen-node pyramid with a dilatation linear in x, y, z."""

from kratos_lite.elements.b_bar import BBar
from kratos_lite.quadrature import pyramid
from kratos_lite.shapes.pyramids import Pyramid13


class BBar3D13N(BBar):
    """Thirteen-node pyramid, 3x3x3 conical points, a dilatation linear in x, y, z."""

    shape = Pyramid13
    rule = pyramid(degree=5)
    dilatation = 1
