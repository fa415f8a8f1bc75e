"""KinematicLinear3D20N: twenty-node serendipity hexahedron, 3x3x3 points."""

from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.quadrature import hexahedron
from kratos_lite.shapes.hexahedra import Hexahedron20


class KinematicLinear3D20N(KinematicLinear):
    """Twenty-node serendipity hexahedron, 3x3x3 points."""

    shape = Hexahedron20
    rule = hexahedron(degree=5)
