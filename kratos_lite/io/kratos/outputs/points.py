"""point_output_process and its kin: values at points, a line of text for each step."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from kratos_lite.analysis.result import Result
from kratos_lite.analysis.state import State
from kratos_lite.atomic import refuse_nan, write_whole
from kratos_lite.errors import InputError
from kratos_lite.io.case import Case
from kratos_lite.io.kratos.context import RunContext, interval_of
from kratos_lite.io.kratos.outputs.process import OutputProcess
from kratos_lite.io.kratos.outputs.values import at_nodes, cells_of, split
from kratos_lite.io.settings import Settings
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import finite

FILE_KEYS = ("file_name", "output_path", "folder_name", "write_buffer_size", "file_extension")
KEYS = (
    "entity_type", "search_configuration", "interval", "historical_value", "search_tolerance", "print_format",
    "output_file_settings",
)  # fmt: skip
FORMAT = re.compile(r"[<>=^]?[-+ ]?#?0?\d{0,2}(\.\d{1,2})?[eEfFgG]?")
HEAD = (
    '# Results for "{}" with Id # {} for search config "initial" at position: '
    "x0: {:.12g}; y0: {:.12g}; z0: {:.12g}"
)


class PointOutput(OutputProcess):
    """The file of a point, with the values of a node or interpolated in the element that holds it."""

    keys: tuple[str, ...] = ("position", *KEYS)

    def __init__(self, settings: Settings, context: RunContext) -> None:
        super().__init__(settings, context)
        self.require_historical()
        self.word("search_configuration", "initial")
        self.kind = self.word("entity_type", "element", "node")
        settings.expect(settings.texts("output_variables"), "output_variables", "must name a variable")
        self.format = settings.text("print_format", "")
        text = f"must be a format of numbers such as '.6e'; got {self.format!r}"
        settings.expect(FORMAT.fullmatch(self.format), "print_format", text)
        self.points = self.places()
        self.files = self.named(settings.section("output_file_settings", required=True))
        self.lines: list[list[str]] = [[] for _ in self.files]

    def places(self) -> Array:
        """Return the points (p, 3) in m."""
        return np.array([self.settings.vector("position")])

    def due(self) -> list[int]:
        """Return the steps after which it writes."""
        interval = interval_of(self.settings)
        return [step for step, time in enumerate(self.context.times) if step and time in interval]

    def named(self, settings: Settings) -> list[str]:
        """Return the file of each point."""
        settings.check_keys(FILE_KEYS)
        ending = "." + settings.text("file_extension", "dat").removeprefix(".")
        name, folder = settings.text("file_name"), settings.text("folder_name", "")
        folder = settings.text("output_path", folder)
        settings.expect(Path(name).name, "file_name", "must be the name of a file")
        names = [name]
        if "position" not in self.keys:
            names = [f"{name.removesuffix('.dat')}_{i}" for i in range(1, len(self.points) + 1)]
        key = "output_file_settings"
        return [self.path(str(Path(folder, each).with_suffix(ending)), key) for each in names]

    def paths(self) -> list[str]:
        """Return the file of each point."""
        return self.files

    def check(self, case: Case) -> None:
        """Raise InputError for a variable that the results do not have, or a point outside the part."""
        super().check(case)
        self.mesh = case.model.mesh
        self.found = self.settings.placed(self.keys[0], self.find, self.mesh)

    def find(self, mesh: Mesh) -> tuple[Ints, Callable[[Array], Array]]:
        """Return the ids of what holds the points, and what takes nodal values there."""
        part = self.part(mesh)
        if self.kind == "element":
            cells, nodes = cells_of(mesh, part)
            if not cells.n_elements:
                raise InputError("the part has no elements; name one that has, or take entity_type 'node'")
            located = cells.locate(self.points, required=True)
            return cells.element_ids[located.rows], lambda values: located.interpolate(values[nodes])
        far = self.settings.number("search_tolerance", 1e-6)
        distances = [np.linalg.norm(mesh.points[part.nodes] - x, axis=1) for x in self.points]
        for x, distance in zip(self.points.tolist(), distances, strict=True):
            if not distance.min(initial=np.inf) <= far:
                raise InputError(f"no node of the part is at {x} m; take entity_type 'element'")
        rows = part.nodes[[distance.argmin() for distance in distances]]
        return mesh.node_ids[rows], lambda values: np.asarray(values[rows])

    def add(self, result: Result, time: float, state: State | None = None) -> None:
        """Take the values of a step."""
        ids, at_points = self.found if result.mesh is self.mesh else self.find(result.mesh)
        variables = self.settings.texts("output_variables")
        placed = [split(name, at_points(at_nodes(name, result, state))) for name in variables]
        rows = np.column_stack([values for columns in placed for values in columns.values()])
        refuse_nan(self.files[0], "a value", rows)
        names = " ".join(name for columns in placed for name in columns)
        for lines, i, x, row in zip(
            self.lines, ids.tolist(), self.points.tolist(), rows.tolist(), strict=True
        ):
            lines.extend([] if lines else [HEAD.format(self.kind, i, *x), f"# time {names}"])
            lines.append(" ".join([str(time), *(format(value, self.format) for value in row)]))

    def close(self) -> None:
        """Write the files."""
        for path, lines in zip(self.files, self.lines, strict=True):
            if lines:
                self.begin(path)
                write_whole(path, ("\n".join(lines) + "\n").encode())
            lines.clear()


class PointsOutput(PointOutput):
    """The files of several points."""

    keys = ("positions", *KEYS)

    def places(self) -> Array:
        """Return the points (p, 3) in m."""
        given = self.settings.get("positions")
        return self.settings.placed("positions", finite, given, "the positions", ("n", 3))


class LineOutput(PointOutput):
    """The files of points on a line, at equal distances; one point is that in the middle."""

    keys = ("start_point", "end_point", "sampling_points", *KEYS)

    def places(self) -> Array:
        """Return the points (p, 3) in m."""
        settings, count = self.settings, self.settings.integer("sampling_points", 3)
        settings.expect(0 < count <= 10_000, "sampling_points", f"must be 1 … 10000; got {count}")
        a, b = (np.array(settings.vector(key)) for key in self.keys[:2])
        t = np.linspace(0.0, 1.0, count) if count > 1 else np.array([0.5])
        return np.asarray(a + t[:, None] * (b - a))
