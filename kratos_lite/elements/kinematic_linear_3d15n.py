"""KinematicLinear3D15N: fifteen-node wedge, 6x3 points."""

from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.quadrature import wedge
from kratos_lite.shapes.wedges import Wedge15


class KinematicLinear3D15N(KinematicLinear):
    """Fifteen-node wedge, 6x3 points."""

    shape = Wedge15
    rule = wedge(degree=4)
