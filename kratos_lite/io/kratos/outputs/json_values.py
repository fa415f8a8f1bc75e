"""json_output_process: values of nodes and Gauss points, a list over time for each."""

from __future__ import annotations

import json
from typing import Any

from kratos_lite.analysis.result import Result
from kratos_lite.analysis.state import State
from kratos_lite.atomic import refuse_nan, write_whole
from kratos_lite.io.case import Case
from kratos_lite.io.kratos.context import RunContext, steps_by_frequency
from kratos_lite.io.kratos.outputs.process import OutputProcess
from kratos_lite.io.kratos.outputs.values import (
    at_nodes,
    names_of_nodes,
    order_of_points,
    split,
    values_of_elements,
)
from kratos_lite.io.settings import Settings


class JsonOutput(OutputProcess):
    """A file that `from_json_check_result_process` compares with."""

    keys = (
        "output_file_name", "sub_model_part_name", "time_frequency", "historical_value", "resultant_solution",
        "use_node_coordinates",
    )  # fmt: skip
    gauss = ("gauss_points_output_variables",)
    absent = ("check_for_flag",)

    def __init__(self, settings: Settings, context: RunContext) -> None:
        super().__init__(settings, context)
        self.file = self.path(settings.text("output_file_name"), "output_file_name")
        self.summed = settings.flag("resultant_solution", False)
        self.by_place = settings.flag("use_node_coordinates", False)
        self.require_historical()
        text = "resultants of Gauss points are not supported, and fail in Kratos; leave one out"
        settings.expect(not (self.summed and settings.texts(self.gauss[0])), "resultant_solution", text)
        self.data: dict[str, Any] = {"TIME": []}

    def due(self) -> list[int]:
        """Return the steps after which it writes."""
        return steps_by_frequency(self.context.times, self.settings.number("time_frequency", 1.0))

    def paths(self) -> list[str]:
        """Return the one file."""
        return [self.file]

    def check(self, case: Case) -> None:
        """Raise InputError for a variable that the results do not have, or for other Gauss points."""
        super().check(case)
        names = self.settings.texts("output_variables")
        twice = [name for name in names if names.count(name) > 1 or name.rpartition("_")[0] in names]
        self.settings.expect(not twice, "output_variables", f"{', '.join(twice[:1])} would be written twice")
        for group in case.model.element_groups() if self.settings.texts(self.gauss[0]) else ():
            self.settings.placed(self.gauss[0], order_of_points, group)

    def add(self, result: Result, time: float, state: State | None = None) -> None:
        """Take the values of a step."""
        mesh, part, data = result.mesh, self.part(result.mesh), self.data
        data["TIME"].append(time)
        for variable in self.settings.texts("output_variables"):
            for name, values in split(variable, at_nodes(variable, result, state)[part.nodes]).items():
                refuse_nan(self.file, name, values)
                names = ["RESULTANT"] if self.summed else names_of_nodes(mesh, part.nodes, self.by_place)
                numbers = [float(values.sum())] if self.summed else values.tolist()
                for node, value in zip(names, numbers, strict=True):
                    data.setdefault(node, {}).setdefault(name, []).append(value)
        ids = mesh.element_ids
        for variable in self.settings.texts(self.gauss[0]):
            for row in part.elements.tolist():
                data.setdefault(f"ELEMENT_{ids[row]}", {})
            for row, values in values_of_elements(result, variable, part.elements):
                refuse_nan(self.file, variable, values)
                points = data[f"ELEMENT_{ids[row]}"].setdefault(variable, {})
                for i, value in enumerate(values.tolist()):
                    points.setdefault(str(i), []).append(value)

    def close(self) -> None:
        """Write the file."""
        if self.data["TIME"]:
            self.begin(self.file)
            write_whole(self.file, json.dumps(self.data, indent=2).encode())
        self.data = {"TIME": []}
