"""Elements: the KinematicLinear family, one file each; they register themselves."""

from kratos_lite.elements.kinematic_linear import ELEMENTS, KinematicLinear
from kratos_lite.elements.kinematic_linear_3d4n import KinematicLinear3D4N
from kratos_lite.elements.kinematic_linear_3d5n import KinematicLinear3D5N
from kratos_lite.elements.kinematic_linear_3d6n import KinematicLinear3D6N
from kratos_lite.elements.kinematic_linear_3d8n import KinematicLinear3D8N
from kratos_lite.elements.kinematic_linear_3d10n import KinematicLinear3D10N
from kratos_lite.elements.kinematic_linear_3d13n import KinematicLinear3D13N
from kratos_lite.elements.kinematic_linear_3d15n import KinematicLinear3D15N
from kratos_lite.elements.kinematic_linear_3d20n import KinematicLinear3D20N
from kratos_lite.elements.kinematic_linear_3d27n import KinematicLinear3D27N
from kratos_lite.elements.surface import surface_load, surface_pressure

__all__ = [
    "ELEMENTS",
    "KinematicLinear",
    "KinematicLinear3D4N",
    "KinematicLinear3D5N",
    "KinematicLinear3D6N",
    "KinematicLinear3D8N",
    "KinematicLinear3D10N",
    "KinematicLinear3D13N",
    "KinematicLinear3D15N",
    "KinematicLinear3D20N",
    "KinematicLinear3D27N",
    "surface_load",
    "surface_pressure",
]
