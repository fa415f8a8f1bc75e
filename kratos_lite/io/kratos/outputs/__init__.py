"""Output processes of Kratos run files."""

from __future__ import annotations

from kratos_lite.io.kratos.outputs.grids import GidOutput, VtkOutput
from kratos_lite.io.kratos.outputs.json_values import JsonOutput
from kratos_lite.io.kratos.outputs.points import LineOutput, PointOutput, PointsOutput
from kratos_lite.io.kratos.outputs.process import OutputProcess as OutputProcess

OUTPUT_PROCESSES: dict[str, type[OutputProcess]] = {
    "vtk_output_process": VtkOutput,
    "gid_output_process": GidOutput,
    "json_output_process": JsonOutput,
    "point_output_process": PointOutput,
    "multiple_points_output_process": PointsOutput,
    "line_output_process": LineOutput,
}
"""What writes files, by Kratos' module name."""
