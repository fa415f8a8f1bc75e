"""KinematicLinear3D4N: four-node tetrahedron; constant strain."""

from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.quadrature import tetrahedron
from kratos_lite.shapes.tetrahedra import Tetrahedron4


class KinematicLinear3D4N(KinematicLinear):
    """Four-node tetrahedron; constant strain."""

    shape = Tetrahedron4
    rule = tetrahedron(degree=1)
