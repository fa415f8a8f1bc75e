"""Reduced3D20N: twenty-node serendipity hexahedron, reduced integration with 2x2x2 points."""

from kratos_lite.elements.kinematic_linear import KinematicLinear
from kratos_lite.quadrature import hexahedron
from kratos_lite.shapes.hexahedra import Hexahedron20


class Reduced3D20N(KinematicLinear):
    """Twenty-node serendipity hexahedron, reduced integration with 2x2x2 points.

    Stresses at its points are more accurate than elsewhere.  An element alone has six modes without energy
    beside the rigid ones; a neighbor across a face, or supports, take them away.

    Source: Zienkiewicz, Taylor & Too, IJNME 3 (1971) 275; Barlow, IJNME 10 (1976) 243.
    """

    formulation = "reduced"
    spurious_modes = 6
    shape = Hexahedron20
    rule = hexahedron(degree=3)
