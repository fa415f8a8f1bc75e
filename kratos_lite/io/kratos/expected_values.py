"""Checks of a Kratos run file: expected values, compared with a result after solving."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from kratos_lite.analysis.result import Result
from kratos_lite.errors import InputError
from kratos_lite.io.kratos.context import RunContext, interval_of
from kratos_lite.io.kratos.expressions import evaluate
from kratos_lite.io.settings import Settings, find_file, is_number, read_settings, shown
from kratos_lite.typing import Array

Comparison: TypeAlias = Callable[[Result], str]
"""Compares a result with what a file expects and says so in one line."""
FIELDS = ("DISPLACEMENT", "REACTION")
NODE_KEYS = (
    "help", "mesh_id", "model_part_name", "variable_name", "interval", "value", "tolerance_rank",
    "reference_conf", "local_axes",
)  # fmt: skip
FILE_KEYS = (
    "help", "mesh_id", "check_variables", "gauss_points_check_variables", "input_file_name",
    "model_part_name", "sub_model_part_name", "check_for_flag", "historical_value", "tolerance",
    "relative_tolerance", "time_frequency", "use_node_coordinates", "check_only_local_entities",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class NodeComparison:
    """Compares a component on nodes with the values that `expected` gives.

    Attributes
    ----------
    what : name of the check.
    component : such as ``DISPLACEMENT_X``.
    rows : (m,) int, node rows.
    expected : called with the result; returns the expected values and the allowed differences (m,).
    """

    what: str
    component: str
    rows: NDArray[np.int64]
    expected: Callable[[Result], tuple[Array, Array]]

    def __call__(self, result: Result) -> str:
        """Return ``check … passed`` or ``failed`` with the numbers of the worst node."""
        name, _, axis = self.component.rpartition("_")
        if name not in FIELDS or axis not in ("X", "Y", "Z"):
            return f"check {self.what} not evaluated: kratos_lite has no nodal {self.component}"
        if not len(self.rows):
            return f"check {self.what} not evaluated: its part has no nodes"
        values = result.displacement() if name == "DISPLACEMENT" else result.reaction()
        found = values[self.rows, "XYZ".index(axis)]
        try:
            expected, allowed = self.expected(result)
        except ValueError as error:
            return f"check {self.what} not evaluated: {error}"
        error_ = np.abs(found - expected)
        worst = int(np.argmax(error_ - allowed))
        return (
            f"check {self.what} {'passed' if (error_ <= allowed).all() else 'failed'} "
            f"(node {result.mesh.node_ids[self.rows[worst]]}: found {found[worst]:.9g}, "
            f"expected {expected[worst]:.9g}, tolerance {allowed[worst]:.3g})"
        )


def _idle(line: str) -> Comparison:
    return lambda result: line


def node_comparisons(settings: Settings, context: RunContext) -> Iterator[Comparison]:
    """Yield the checks of check_scalar_to_nodes_process or of its kin for vectors.

    Values agree when their difference, rounded to `tolerance_rank` decimals, is zero.
    """
    settings.check_keys(NODE_KEYS)
    if settings.section("local_axes").values:
        raise settings.error("local_axes", "local_axes are not supported; give the values along x, y, z")
    name, part = settings.text("variable_name"), settings.text("model_part_name")
    rows, value, time = context.part(settings).nodes, settings.get("value", 0.0), context.times[-1]
    is_list = isinstance(value, list)
    pairs = zip(("_X", "_Y", "_Z"), value, strict=False) if is_list else [("", value)]
    rank, span = settings.integer("tolerance_rank", 3), interval_of(settings)
    if abs(rank) > 30:
        raise settings.error("tolerance_rank", f"tolerance_rank is a count of decimals; got {rank}")
    deformed = context.moved and not settings.flag("reference_conf", False)
    for suffix, one in pairs:
        what = f"{name}{suffix} on {part}"
        if one is None:
            continue
        if not is_number(one) and not isinstance(one, str):
            raise settings.error("value", f"value must be a number or an expression; got {shown(one)}")
        if not span.begin <= time < span.end:
            yield _idle(f"check {what} not evaluated: time {time:g} s is outside its interval")
            continue
        yield NodeComparison(what, name + suffix, rows, Analytic(one, rows, rank, time, deformed))


@dataclass(frozen=True, eq=False)
class Analytic:
    """Expected values from a number or an expression in x, y, z, t, as Python reads it."""

    value: float | str
    rows: NDArray[np.int64]
    rank: int
    time: float
    deformed: bool

    def __call__(self, result: Result) -> tuple[Array, Array]:
        """Return the expected values and the allowed differences."""
        points = result.mesh.points[self.rows]
        if self.deformed:
            points = points + result.displacement()[self.rows]
        x, y, z = points.T
        value = evaluate(str(self.value), {"x": x, "y": y, "z": z, "t": self.time}, python=True)
        # A difference that rounds to zero is at most half a unit of the last decimal.
        return np.broadcast_to(value, x.shape), np.full(x.shape, 0.5 * 10.0**-self.rank)


def file_comparisons(settings: Settings, context: RunContext) -> Iterator[Comparison]:
    """Yield the checks of from_json_check_result_process: nodal values of a reference file.

    Values agree within the larger of `tolerance` and `relative_tolerance` × the expected value.
    """
    settings.check_keys(FILE_KEYS)
    what = f"against {settings.text('input_file_name')}"
    try:
        path, _ = find_file(settings, "input_file_name", context.folder, outside=context.outside)
    except InputError as error:
        yield _idle(f"check {what} not evaluated: {error}")
        return
    part = context.part(settings)
    if settings.text("sub_model_part_name", ""):
        part = context.part(settings, "sub_model_part_name")
    data = read_settings(path)
    tolerances = settings.number("tolerance", 1e-3), settings.number("relative_tolerance", 1e-6)
    for variable in settings.texts("check_variables"):
        for component in [f"{variable}_{axis}" for axis in "XYZ"] if variable in FIELDS else [variable]:
            tabled = Tabled(data, component, part.nodes, context.times[-1], tolerances)
            yield NodeComparison(f"{component} {what}", component, part.nodes, tabled)
    for variable in settings.texts("gauss_points_check_variables"):
        yield _idle(f"check {variable} {what} not evaluated: values at Gauss points are not compared")


@dataclass(frozen=True, eq=False)
class Tabled:
    """Expected values from a file of Kratos' json_output_process, at a time in s."""

    data: Settings
    component: str
    rows: NDArray[np.int64]
    time: float
    tolerances: tuple[float, float]

    def __call__(self, result: Result) -> tuple[Array, Array]:
        """Return the expected values and the allowed differences."""
        times = self.data.numbers("TIME")
        if not times or not times[0] - 1e-9 <= self.time <= times[-1] + 1e-9:
            raise ValueError(f"the file has no values at time {self.time:g} s")
        nodes = [self.data.section(f"NODE_{i}", required=True) for i in result.mesh.node_ids[self.rows]]
        series = [node.numbers(self.component) for node in nodes]
        if any(len(values) != len(times) for values in series):
            raise ValueError(f"{self.component} must be a list with one number for each TIME")
        expected = np.array([np.interp(self.time, times, values) for values in series])
        return expected, np.maximum(self.tolerances[0], self.tolerances[1] * np.abs(expected))


COMPARISONS: dict[str, Callable[[Settings, RunContext], Iterator[Comparison]]] = {
    "check_scalar_to_nodes_process": node_comparisons,
    "check_vector_components_to_nodes_process": node_comparisons,
    "check_vector_to_nodes_process": node_comparisons,
    "from_json_check_result_process": file_comparisons,
}
"""Processes that compare a result with expected values, by Kratos' module name."""
