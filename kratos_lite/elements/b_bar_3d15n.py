"""BBar3D15N: fifteen-node wedge with a dilatation linear in x, y, z."""

from kratos_lite.elements.b_bar import BBar
from kratos_lite.quadrature import wedge
from kratos_lite.shapes.wedges import Wedge15


class BBar3D15N(BBar):
    """Fifteen-node wedge, 6x3 points, a dilatation linear in x, y, z."""

    shape = Wedge15
    rule = wedge(degree=4)
    dilatation = 1
