"""KinematicLinear3D27N: twenty-seven-node hexahedron, exact for quadratics on distorted cells."""

from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.quadrature import hexahedron
from kratos_lite.shapes.hexahedra import Hexahedron27


class KinematicLinear3D27N(KinematicLinear):
    """Twenty-seven-node hexahedron, 3x3x3 points; exact for quadratics on distorted cells."""

    shape = Hexahedron27
    rule = hexahedron(degree=5)
