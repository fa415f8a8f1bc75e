"""Figures: bodies deformed and colored, along their paths; reference cells; errors of adaptive solutions."""

from kratos_lite.view.canvas import file_types
from kratos_lite.view.cells import OBLIQUE, element_figure
from kratos_lite.view.history import history_figure
from kratos_lite.view.surface import ISOMETRIC, surface_figure
from kratos_lite.view.trajectory import trajectory_figure

__all__ = [
    "ISOMETRIC",
    "OBLIQUE",
    "element_figure",
    "file_types",
    "history_figure",
    "surface_figure",
    "trajectory_figure",
]
