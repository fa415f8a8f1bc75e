"""KinematicLinear3D6N: six-node wedge, 3x2 points."""

from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.quadrature import wedge
from kratos_lite.shapes.wedges import Wedge6


class KinematicLinear3D6N(KinematicLinear):
    """Six-node wedge, 3x2 points."""

    shape = Wedge6
    rule = wedge(degree=2)
