"""BBar3D8N: eight-node hexahedron with the mean dilatation of each element."""

from kratos_lite.elements.b_bar import BBar
from kratos_lite.quadrature import hexahedron
from kratos_lite.shapes.hexahedra import Hexahedron8


class BBar3D8N(BBar):
    """Eight-node hexahedron, 2x2x2 points, the mean dilatation of each element.

    It takes ν → ½, but bends as stiffly as `KinematicLinear3D8N`: `EnhancedStrain3D8N` does both.
    """

    aliases = ("SmallDisplacementBbarElement3D8N",)
    shape = Hexahedron8
    rule = hexahedron(degree=3)
