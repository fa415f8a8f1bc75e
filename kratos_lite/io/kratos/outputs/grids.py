"""vtk_output_process and gid_output_process: a mesh with fields for each part and step."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kratos_lite.analysis.result import Result
from kratos_lite.analysis.state import State
from kratos_lite.io.case import Case
from kratos_lite.io.formats.vtu import write_legacy_vtk, write_vtu
from kratos_lite.io.kratos.context import Omission, RunContext
from kratos_lite.io.kratos.outputs.process import OutputProcess
from kratos_lite.io.kratos.outputs.values import at_nodes, cells_of, means, nodal_means
from kratos_lite.io.settings import Settings
from kratos_lite.mesh import Mesh, rows_of_ids
from kratos_lite.typing import Numbers

ON_NODES, IN_ELEMENTS = "gauss_point_variables_extrapolated_to_nodes", "gauss_point_variables_in_elements"
RENAMED = {
    "output_frequency": "output_interval",
    "write_properties_id": "write_ids",
    "folder_name": "output_path",
}
"""Keys of older files of Kratos, and their present names."""


class VtkOutput(OutputProcess):
    """A legacy `.vtk` file of the part, and of each of the parts in it if requested."""

    keys: tuple[str, ...] = (
        "file_format", "entity_type", "output_precision", "output_control_type", "output_interval",
        "output_path", "custom_name_prefix", "custom_name_postfix", "output_sub_model_parts",
        "save_output_files_in_folder", "write_deformed_configuration", "write_ids",
    )  # fmt: skip
    nodal = ("nodal_solution_step_data_variables",)
    gauss: tuple[str, ...] = (ON_NODES, IN_ELEMENTS)
    absent: tuple[str, ...] = (
        "nodal_data_value_variables", "nodal_flags", "element_data_value_variables", "element_flags",
        "condition_data_value_variables", "condition_flags",
    )  # fmt: skip

    def __init__(self, settings: Settings, context: RunContext) -> None:
        values = {RENAMED.get(key, key): value for key, value in settings.values.items()}
        super().__init__(Settings(values, settings.source, settings.path), context)
        settings = self.settings
        self.is_text = self.word("file_format", "binary", "ascii") == "ascii"
        self.cells = self.word("entity_type", "automatic", "element", "condition")
        digits = settings.integer("output_precision", 7)
        settings.expect(0 <= digits <= 17, "output_precision", f"must be 0 … 17 digits; got {digits}")
        self.digits = digits
        self.parts = {self.part_name: (self.part_name or context.root).rpartition(".")[2]}
        if settings.flag("output_sub_model_parts", False):
            inner = (name for name in context.mesh.parts if name.rpartition(".")[0] == self.part_name)
            self.parts |= {name: f"{self.parts[self.part_name]}_{name.rpartition('.')[2]}" for name in inner}
        self.files = {
            (step, name): self.file(label, str(step) if self.by_step else f"{context.times[step]:.{digits}f}")
            for step in self.steps
            for name, label in self.parts.items()
        }

    def due(self) -> list[int]:
        """Return the steps after which it writes."""
        settings, steps = self.settings, list[int]()
        interval = settings.number("output_interval", 1.0)
        self.by_step = self.word("output_control_type", "step", "time") == "step"
        interval = int(interval) if self.by_step else interval
        following = max(interval, 0)
        for step, time in enumerate(self.context.times):
            now = step if self.by_step else time
            if step and following <= now:
                steps.append(step)
                following = (int(now / interval) + 1) * interval if interval > 0 else 0
        return steps

    def file(self, label: str, when: str) -> str:
        """Return the path of the file of a part and a step."""
        settings = self.settings
        prefix, postfix = (settings.text(f"custom_name_{key}", "") for key in ("prefix", "postfix"))
        in_folder = settings.flag("save_output_files_in_folder", True)
        folder = settings.text("output_path", "VTK_Output") if in_folder else ""
        return self.path(str(Path(folder, f"{prefix}{label}{postfix}_0_{when}.vtk")), "output_path")

    def paths(self) -> list[str]:
        """Return all files."""
        return list(self.files.values())

    def add(self, result: Result, time: float, state: State | None = None) -> None:
        """Write the files of a step."""
        step, settings = self.step_at(time), self.settings
        whole = self.part(result.mesh)
        nodal = {name: at_nodes(name, result, state) for key in self.nodal for name in settings.texts(key)}
        points = result.mesh.points + result.u if self.context.moved else result.mesh.points
        if ON_NODES in self.gauss:
            names = settings.texts(ON_NODES)
            nodal |= {name: nodal_means(result, name, whole.elements, points) for name in names}
        elemental = {name: means(result, name) for name in settings.texts(self.gauss[-1])}
        for name in self.parts:
            part, path = self.part(result.mesh, name), self.files[step, name]
            faces = self.cells == "condition" or (self.cells == "automatic" and not len(part.elements))
            grid, nodes = cells_of(result.mesh, part, faces=faces)
            rows = rows_of_ids(result.mesh.element_ids, grid.element_ids)
            on_nodes: dict[str, Numbers] = {key: values[nodes] for key, values in nodal.items()}
            cells: dict[str, Numbers] = (
                {} if faces else {key: values[rows] for key, values in elemental.items()}
            )
            if settings.flag("write_ids", False):
                on_nodes["KRATOS_NODE_ID"] = grid.node_ids
                numbers = np.concatenate([rows[:0], *(block.properties for block in grid.blocks)])
                kind = "CONDITION" if faces else "ELEMENT"
                cells = {"PROPERTIES_ID": numbers, f"KRATOS_{kind}_ID": grid.element_ids, **cells}
            if self.deformed():
                grid = grid.replace(points=points[nodes])
            self.begin(path)
            self.write(path, grid, on_nodes, cells)

    def deformed(self) -> bool:
        """Return whether the nodes are where they have moved."""
        return self.settings.flag("write_deformed_configuration", False)

    def write(self, path: str, grid: Mesh, points: dict[str, Numbers], cells: dict[str, Numbers]) -> None:
        """Write a file."""
        write_legacy_vtk(path, grid, points, cells, self.digits if self.is_text else None)


class GidOutput(VtkOutput):
    """A `.vtu` file for each step, which ParaView reads, in place of one for GiD."""

    note = "files for GiD are not written; ParaView reads the .vtu that hold the same, Gauss points as means"
    keys = (
        "gidpost_flags", "file_label", "time_label_format", "output_control_type", "output_interval",
        "flush_after_output", "body_output",
    )  # fmt: skip
    nodal, gauss = ("nodal_results",), ("gauss_point_results",)
    absent = (
        "node_output", "skin_output", "plane_output", "nodal_nonhistorical_results", "nodal_flags_results",
        "elemental_conditional_flags_results", "additional_list_files",
    )  # fmt: skip

    def __init__(self, settings: Settings, context: RunContext) -> None:
        settings.check_keys(["help", "model_part_name", "output_name", "postprocess_parameters"])
        own, self.output_name = settings.section("postprocess_parameters"), settings.text("output_name")
        text = "is not supported; add a point_output_process"
        own.expect(not own.values.get("point_data_configuration"), "point_data_configuration", text)
        own = own.section("result_file_configuration")
        values = {"model_part_name": settings.text("model_part_name"), **own.values}
        super().__init__(Settings(values, own.source, own.path), context)

    def check(self, case: Case) -> None:
        """Leave out, with a note, the variables that the results do not have."""
        for key, have in self.known(case).items():
            names = [name.replace("_TENSOR", "_VECTOR") for name in self.settings.texts(key)]
            self.settings.values[key] = [name for name in names if name in have]
            if lost := [name for name in names if name not in have]:
                case.model.notes.append(Omission(f"{self.settings.path}: {', '.join(lost)} not written"))

    def file(self, label: str, when: str) -> str:
        """Return the path of the file of a step."""
        return self.path(f"{self.output_name}_{when}.vtu", "output_name")

    def deformed(self) -> bool:
        """Return whether the nodes are where they have moved."""
        flag = self.settings.section("gidpost_flags").values.get("WriteDeformedMeshFlag")
        return flag in (True, "WriteDeformed")

    def write(self, path: str, grid: Mesh, points: dict[str, Numbers], cells: dict[str, Numbers]) -> None:
        """Write a file."""
        write_vtu(path, grid, points, cells)
