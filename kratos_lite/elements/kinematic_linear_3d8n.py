"""KinematicLinear3D8N: eight-node hexahedron, full 2x2x2 integration."""

from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.quadrature import hexahedron
from kratos_lite.shapes.hexahedra import Hexahedron8


class KinematicLinear3D8N(KinematicLinear):
    """Eight-node hexahedron, full 2x2x2 integration."""

    shape = Hexahedron8
    rule = hexahedron(degree=3)
