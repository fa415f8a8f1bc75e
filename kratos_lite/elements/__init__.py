"""Elements: the KinematicLinear family, one file each; they register themselves."""

from kratos_lite.elements.b_bar_3d8n import BBar3D8N
from kratos_lite.elements.b_bar_3d10n import BBar3D10N
from kratos_lite.elements.b_bar_3d13n import BBar3D13N
from kratos_lite.elements.b_bar_3d15n import BBar3D15N
from kratos_lite.elements.b_bar_3d20n import BBar3D20N
from kratos_lite.elements.b_bar_3d27n import BBar3D27N
from kratos_lite.elements.enhanced_strain_3d8n import EnhancedStrain3D8N
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
from kratos_lite.elements.reduced_3d20n import Reduced3D20N
from kratos_lite.elements.surface import surface_load, surface_pressure

__all__ = [
    "ELEMENTS",
    "BBar3D8N",
    "BBar3D10N",
    "BBar3D13N",
    "BBar3D15N",
    "BBar3D20N",
    "BBar3D27N",
    "EnhancedStrain3D8N",
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
    "Reduced3D20N",
    "surface_load",
    "surface_pressure",
]
