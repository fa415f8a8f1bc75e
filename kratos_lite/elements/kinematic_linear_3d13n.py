"""KinematicLinear3D13N: thirteen-node pyramid, 3x3x3 conical points; fewer leave hourglass modes."""

from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.quadrature import pyramid
from kratos_lite.shapes.pyramids import Pyramid13


class KinematicLinear3D13N(KinematicLinear):
    """Thirteen-node pyramid, 3x3x3 conical points; fewer leave hourglass modes."""

    shape = Pyramid13
    rule = pyramid(degree=5)
