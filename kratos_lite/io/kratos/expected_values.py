"""Expected values of a Kratos run file, compared with a result after solving."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.analysis.fields import listed
from kratos_lite.analysis.result import Result
from kratos_lite.errors import InputError
from kratos_lite.io.kratos.context import RunContext, interval_of
from kratos_lite.io.kratos.expressions import evaluate
from kratos_lite.io.kratos.processes import refuse_local_axes
from kratos_lite.io.settings import Settings, find_file, is_number, read_settings, shown
from kratos_lite.typing import Array, Ints

Comparison: TypeAlias = Callable[[Result], str]
"""Compares a result with what a file expects and says so in one line."""
VECTORS = {field.kratos: name for name, field in listed("node").items() if field.kind == "vector"}
"""Nodal fields that are compared."""
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
    """Compares a component on nodes with the values that `expected` gives."""

    what: str  # name of the check.
    component: str  # such as ``DISPLACEMENT_X``.
    indices: Ints  # (m,) int, node indices.
    # called with the result and indices; returns expected values and allowed differences of these.
    expected: Callable[[Result, Ints], tuple[Array, Array]]

    def __call__(self, result: Result) -> str:
        """Return ``check … passed`` or ``failed`` with the numbers of the worst node."""
        name, _, axis = self.component.rpartition("_")
        if name not in VECTORS or axis not in ("X", "Y", "Z"):
            return f"check {self.what} not evaluated: kratos_lite has no nodal {self.component}"
        values = result.field(VECTORS[name], "node")
        if not len(self.indices):
            return f"check {self.what} not evaluated: its part has no nodes"
        found = values[self.indices, "XYZ".index(axis)]
        try:
            worst = _worst(result.mesh.node_ids[self.indices], found, *self.expected(result, self.indices))
        except ValueError as error:
            return f"check {self.what} not evaluated: {error}"
        excess, node, number, expected, allowed = worst
        return (
            f"check {self.what} {'passed' if excess <= 0 else 'failed'} "
            f"(node {node}: found {number:.9g}, expected {expected:.9g}, tolerance {allowed:.3g})"
        )


def _worst(nodes: Ints, found: Array, expected: Array, allowed: Array) -> list[Any]:
    """Return how much the worst node is beyond its tolerance, its id, value, expected value and tolerance."""
    excess = np.nan_to_num(np.abs(found - expected) - allowed, nan=np.inf)
    row = int(np.argmax(excess))
    return [column[row].item() for column in (excess, nodes, found, expected, allowed)]


def _idle(what: str, why: str) -> Comparison:
    return lambda result: f"check {what} not evaluated: {why}"


def node_comparisons(settings: Settings, context: RunContext) -> Iterator[Comparison]:
    """Yield the comparisons of check_scalar_to_nodes_process or of its kin for vectors.

    Values agree when their difference, rounded to `tolerance_rank` decimals, is zero.
    """
    settings.check_keys(NODE_KEYS)
    refuse_local_axes(settings)
    name, part = settings.text("variable_name"), settings.text("model_part_name")
    indices, value, time = context.part(settings).nodes, settings.get("value", 0.0), context.times[-1]
    rank, span = settings.integer("tolerance_rank", 3), interval_of(settings)
    text = f"tolerance_rank is a number of decimals; got {rank}"
    settings.expect(abs(rank) <= 30, "tolerance_rank", text)
    moved = context.moved and not settings.flag("reference_conf", False)
    values = dict(zip(("_X", "_Y", "_Z"), value, strict=False)) if isinstance(value, list) else {"": value}
    for suffix, one in values.items():
        what = f"{name}{suffix} on {part}"
        if one is None:
            continue
        fits = is_number(one) or isinstance(one, str)
        settings.expect(fits, "value", f"must be a number or an expression; got {shown(one)}")
        if span.begin <= time < span.end:
            expected = partial(_from_expression, str(one), time, moved, 0.5 * 10.0**-rank)
            yield NodeComparison(what, name + suffix, indices, expected)
        else:
            yield _idle(what, f"time {time:g} s is outside its interval")


def _from_expression(
    text: str, time: float, moved: bool, allowed: float, result: Result, indices: Ints
) -> tuple[Array, Array]:
    """Return the values of an expression in x, y, z, t, as Python reads it, and the allowed differences."""
    points = result.mesh.points[indices] + (result.displacement()[indices] if moved else 0.0)
    x, y, z = points.T
    value = evaluate(text, {"x": x, "y": y, "z": z, "t": time}, python=True)
    # A difference that rounds to zero is at most half a unit of the last decimal.
    return np.broadcast_to(value, x.shape), np.full(x.shape, allowed)


def file_comparisons(settings: Settings, context: RunContext) -> Iterator[Comparison]:
    """Yield the comparisons of from_json_check_result_process: nodal values of a reference file.

    Values agree within the larger of `tolerance` and `relative_tolerance` × the expected value.
    """
    settings.check_keys(FILE_KEYS)
    what = f"against {settings.text('input_file_name')}"
    try:
        path, _ = find_file(settings, "input_file_name", context.folder, outside=context.outside)
    except InputError as error:
        yield _idle(what, str(error))
        return
    key = "sub_model_part_name" if settings.text("sub_model_part_name", "") else "model_part_name"
    context.part(settings)
    indices, data = context.part(settings, key).nodes, read_settings(path)
    tolerances = settings.number("tolerance", 1e-3), settings.number("relative_tolerance", 1e-6)
    for variable in settings.texts("check_variables"):
        for component in [f"{variable}_{axis}" for axis in "XYZ"] if variable in VECTORS else [variable]:
            expected = partial(_from_table, data, component, context.times[-1], tolerances)
            yield NodeComparison(f"{component} {what}", component, indices, expected)
    for variable in settings.texts("gauss_points_check_variables"):
        yield _idle(f"{variable} {what}", "values at Gauss points are not compared")


def _from_table(
    data: Settings,
    component: str,
    time: float,
    tolerances: tuple[float, float],
    result: Result,
    indices: Ints,
) -> tuple[Array, Array]:
    """Return the values at a time in a file of json_output_process, and the allowed differences."""
    times = data.numbers("TIME")
    if not times or not times[0] - 1e-9 <= time <= times[-1] + 1e-9:
        raise ValueError(f"the file has no values at time {time:g} s")
    nodes = [data.section(f"NODE_{i}", required=True) for i in result.mesh.node_ids[indices]]
    series = [node.numbers(component) for node in nodes]
    if any(len(values) != len(times) for values in series):
        raise ValueError(f"{component} must be a list with one number for each TIME")
    expected = np.array([np.interp(time, times, values) for values in series])
    return expected, np.maximum(tolerances[0], tolerances[1] * np.abs(expected))


COMPARISONS: dict[str, Callable[[Settings, RunContext], Iterator[Comparison]]] = {
    "check_scalar_to_nodes_process": node_comparisons,
    "check_vector_components_to_nodes_process": node_comparisons,
    "check_vector_to_nodes_process": node_comparisons,
    "from_json_check_result_process": file_comparisons,
}
"""Processes that compare a result with expected values, by Kratos' module name."""
