"""Expected values of a Kratos run file, compared with a result after solving."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TypeAlias

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


def _compared(
    what: str, component: str, indices: Ints, expected: Callable[[Result], tuple[Array, Array]]
) -> Comparison:
    """Return the comparison of a component on nodes; `expected` gives values and allowed differences.

    It says ``check … passed`` or ``failed`` with the numbers of the worst node.
    """

    def compare(result: Result) -> str:
        name, _, axis = component.rpartition("_")
        if name not in VECTORS or axis not in ("X", "Y", "Z"):
            return f"check {what} not evaluated: kratos_lite has no nodal {component}"
        if not len(indices):
            return f"check {what} not evaluated: its part has no nodes"
        values = result.field(VECTORS[name], "node")[indices, "XYZ".index(axis)]
        try:
            wanted, allowed = expected(result)
        except ValueError as error:
            return f"check {what} not evaluated: {error}"
        excess = np.nan_to_num(np.abs(values - wanted) - allowed, nan=np.inf)
        i = int(np.argmax(excess))
        return (
            f"check {what} {'passed' if excess[i] <= 0 else 'failed'} "
            f"(node {result.mesh.node_ids[indices[i]]}: found {values[i]:.9g}, "
            f"expected {wanted[i]:.9g}, tolerance {allowed[i]:.3g})"
        )

    return compare


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
    settings.expect(abs(rank) <= 30, "tolerance_rank", f"tolerance_rank is a number of decimals; got {rank}")
    moved = context.moved and not settings.flag("reference_conf", False)

    def expected(text: str, result: Result) -> tuple[Array, Array]:
        """Return the values of an expression in x, y, z, t, as Python reads it."""
        points = result.mesh.points[indices] + (result.displacement()[indices] if moved else 0.0)
        x, y, z = points.T
        values = evaluate(text, {"x": x, "y": y, "z": z, "t": time}, python=True)
        # A difference that rounds to zero is at most half a unit of the last decimal.
        return np.broadcast_to(values, x.shape), np.full(x.shape, 0.5 * 10.0**-rank)

    values = dict(zip(("_X", "_Y", "_Z"), value, strict=False)) if isinstance(value, list) else {"": value}
    for suffix, wanted in values.items():
        what = f"{name}{suffix} on {part}"
        if wanted is None:
            continue
        fits = is_number(wanted) or isinstance(wanted, str)
        settings.expect(fits, "value", f"must be a number or an expression; got {shown(wanted)}")
        if span.begin <= time < span.end:
            yield _compared(what, name + suffix, indices, partial(expected, str(wanted)))
        else:
            yield _idle(what, f"time {time:g} s is outside its interval")


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
    indices, data, time = context.part(settings, key).nodes, read_settings(path), context.times[-1]
    absolute, relative = settings.number("tolerance", 1e-3), settings.number("relative_tolerance", 1e-6)

    def expected(component: str, result: Result) -> tuple[Array, Array]:
        """Return the values at the last time in a file of json_output_process."""
        times = data.numbers("TIME")
        if not times or not times[0] - 1e-9 <= time <= times[-1] + 1e-9:
            raise ValueError(f"the file has no values at time {time:g} s")
        nodes = [data.section(f"NODE_{i}", required=True) for i in result.mesh.node_ids[indices]]
        series = [node.numbers(component) for node in nodes]
        if any(len(values) != len(times) for values in series):
            raise ValueError(f"{component} must be a list with one number for each TIME")
        wanted = np.array([np.interp(time, times, values) for values in series])
        return wanted, np.maximum(absolute, relative * np.abs(wanted))

    for variable in settings.texts("check_variables"):
        for component in [f"{variable}_{axis}" for axis in "XYZ"] if variable in VECTORS else [variable]:
            yield _compared(f"{component} {what}", component, indices, partial(expected, component))
    for variable in settings.texts("gauss_points_check_variables"):
        yield _idle(f"{variable} {what}", "values at Gauss points are not compared")


COMPARISONS: dict[str, Callable[[Settings, RunContext], Iterator[Comparison]]] = {
    "check_scalar_to_nodes_process": node_comparisons,
    "check_vector_components_to_nodes_process": node_comparisons,
    "check_vector_to_nodes_process": node_comparisons,
    "from_json_check_result_process": file_comparisons,
}
"""Processes that compare a result with expected values, by Kratos' module name."""
