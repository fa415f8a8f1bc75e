"""Pictures: bodies deformed and colored, in motion, and reference cells with node numbers."""

from kratos_lite.view.canvas import check_picture_target
from kratos_lite.view.cells import OBLIQUE, element_picture
from kratos_lite.view.motion import motion_picture
from kratos_lite.view.surface import ISOMETRIC, picture

__all__ = [
    "ISOMETRIC",
    "OBLIQUE",
    "check_picture_target",
    "element_picture",
    "motion_picture",
    "picture",
]
