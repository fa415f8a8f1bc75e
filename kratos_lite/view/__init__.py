"""Figures: bodies deformed and colored, in motion, and reference cells with node numbers."""

from kratos_lite.view.canvas import file_types
from kratos_lite.view.cells import OBLIQUE, element_figure
from kratos_lite.view.motion import motion_figure
from kratos_lite.view.surface import ISOMETRIC, surface_figure

__all__ = ["ISOMETRIC", "OBLIQUE", "element_figure", "file_types", "motion_figure", "surface_figure"]
