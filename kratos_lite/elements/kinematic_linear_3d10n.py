"""KinematicLinear3D10N: ten-node tetrahedron; linear strain."""

from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.quadrature import tetrahedron
from kratos_lite.shapes.tetrahedra import Tetrahedron10


class KinematicLinear3D10N(KinematicLinear):
    """Ten-node tetrahedron; linear strain."""

    shape = Tetrahedron10
    rule = tetrahedron(degree=2)
