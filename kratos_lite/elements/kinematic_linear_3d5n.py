"""KinematicLinear3D5N: five-node pyramid, 2x2x2 conical points."""

from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.quadrature import pyramid
from kratos_lite.shapes.pyramids import Pyramid5


class KinematicLinear3D5N(KinematicLinear):
    """Five-node pyramid, 2x2x2 conical points."""

    shape = Pyramid5
    rule = pyramid(degree=3)
