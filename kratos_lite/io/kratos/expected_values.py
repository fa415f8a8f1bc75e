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
from kratos_lite.io.case import Comparison
from kratos_lite.io.kratos.context import RunContext, interval_of, steps_by_frequency
from kratos_lite.io.kratos.expressions import evaluate
from kratos_lite.io.kratos.outputs.values import at_nodes, names_of_nodes, values_of_elements
from kratos_lite.io.kratos.processes import refuse_local_axes
from kratos_lite.io.settings import Settings, find_file, is_number, read_settings, shown
from kratos_lite.mesh import Part
from kratos_lite.typing import Array, Ints
from kratos_lite.validation import finite

VECTORS = [field.kratos for field in listed("node").values() if field.kind == "vector"]
COMPONENTS = [f"{name}_{axis}" for name in VECTORS for axis in "XYZ"]
"""Nodal variables that are compared, and their components."""
NODE_KEYS = (
    "help", "mesh_id", "model_part_name", "variable_name", "interval", "value", "tolerance_rank",
    "reference_conf", "local_axes",
)  # fmt: skip
FILE_KEYS = (
    "help", "mesh_id", "check_variables", "gauss_points_check_variables", "input_file_name",
    "model_part_name", "sub_model_part_name", "check_for_flag", "historical_value", "tolerance",
    "relative_tolerance", "time_frequency", "use_node_coordinates", "check_only_local_entities",
)  # fmt: skip


Expected: TypeAlias = Callable[[Result, float], "tuple[Array, Array]"]
"""From a result and its time: expected values and allowed differences."""


def _at_nodes(
    component: str, indices: Ints, expected: Expected
) -> Callable[[Result, float], tuple[float, str]]:
    """Return the comparison of a component on nodes."""

    def compare(result: Result, time: float) -> tuple[float, str]:
        if component not in COMPONENTS:
            raise ValueError(f"kratos_lite has no nodal {component}")
        if not len(indices):
            raise ValueError("its part has no nodes")
        values = at_nodes(component, result)[indices]
        nodes = result.mesh.node_ids[indices]
        return _worst(values, *expected(result, time), lambda i: f"node {nodes[i[0]]}")

    return compare


def _worst(
    values: Array, wanted: Array, allowed: Array, name: Callable[[tuple[int, ...]], str]
) -> tuple[float, str]:
    """Return by how much the worst of values exceeds what is allowed, and its numbers."""
    excess = np.nan_to_num(np.abs(values - wanted) - allowed, nan=np.inf)
    i = tuple(map(int, np.unravel_index(np.argmax(excess), excess.shape)))
    text = f"found {values[i]:.9g}, expected {wanted[i]:.9g}, tolerance {allowed[i]:.3g}"
    return float(excess[i]), f"{name(i)}: {text}"


def _idle(what: str, why: str) -> Callable[[Result], str]:
    return lambda result: f"check {what} not evaluated: {why}"


def node_comparisons(settings: Settings, context: RunContext) -> Iterator[Callable[[Result], str]]:
    """Yield the comparisons of check_scalar_to_nodes_process or of its kin for vectors.

    Values agree when their difference, rounded to `tolerance_rank` decimals, is zero.
    """
    settings.check_keys(NODE_KEYS)
    refuse_local_axes(settings)
    name, part = settings.text("variable_name"), settings.text("model_part_name")
    indices, value = context.part(settings).nodes, settings.get("value", 0.0)
    rank, span = settings.integer("tolerance_rank", 3), interval_of(settings)
    settings.expect(abs(rank) <= 30, "tolerance_rank", f"tolerance_rank is a number of decimals; got {rank}")
    moved = context.moved and not settings.flag("reference_conf", False)

    def acts(time: float) -> bool:
        return span.begin <= time < span.end

    def expected(text: str, result: Result, time: float) -> tuple[Array, Array]:
        """Return the values of an expression in x, y, z, t, as Python reads it."""
        if not acts(time):
            raise ValueError(f"time {time:g} s is outside its interval")
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
        compare = _at_nodes(name + suffix, indices, partial(expected, str(wanted)))
        yield Comparison(what, [time for time in context.times[1:] if acts(time)], context.times[-1], compare)


@dataclass(frozen=True, eq=False)
class Reference:
    """A file of json_output_process, with whose values those of a part are compared."""

    data: Settings
    part: Part
    absolute: float
    relative: float
    by_place: bool  # nodes are named by their places

    def place(self, time: float) -> float:
        """Return where a time lies among those of the file."""
        instants = self.data.numbers("TIME")
        if not instants or not instants[0] - 1e-9 <= time <= instants[-1] + 1e-9:
            raise ValueError(f"the file has no values at time {time:g} s")
        return float(np.interp(time, instants, np.arange(len(instants))))

    def at(self, section: Settings, name: str, place: float) -> Array:
        """Return the value of a key, or its components."""
        series = np.atleast_1d(finite(section.get(name, []), section.name(name)))
        if len(series) != len(self.data.values["TIME"]):
            raise ValueError(f"{section.name(name)} must be a list with one number for each TIME")
        before, after = series[int(place)], series[int(np.ceil(place))]
        return np.asarray(before + (place - int(place)) * (after - before))

    def allowed(self, wanted: Array) -> Array:
        """Return the differences that values may have."""
        return np.maximum(self.absolute, self.relative * np.abs(wanted))

    def at_nodes(self, component: str, result: Result, time: float) -> tuple[Array, Array]:
        """Return expected values of a component on nodes and allowed differences."""
        now, names = self.place(time), names_of_nodes(result.mesh, self.part.nodes, self.by_place)
        wanted = [self.at(self.data.section(name, required=True), component, now) for name in names]
        return np.array(wanted), self.allowed(np.array(wanted))

    def at_gauss(self, variable: str, result: Result, time: float) -> tuple[float, str]:
        """Compare a variable at Gauss points."""
        ids, found = result.mesh.element_ids, list[tuple[Array, Array, str]]()
        of_elements = list(values_of_elements(result, variable, self.part.elements))
        now = self.place(time)
        for row, values in of_elements:
            points = self.data.section(f"ELEMENT_{ids[row]}", required=True).section(variable)
            for i, numbers in enumerate(values):
                value, wanted = np.ravel(numbers), np.ravel(self.at(points, str(i), now))
                if len(value) != len(wanted):
                    raise ValueError(f"{variable} has {len(value)} components, {len(wanted)} in the file")
                found.append((value, wanted, f"element {ids[row]}, point {i}"))
        if not found:
            raise ValueError("its part has no elements")
        every, wanted_all, names = zip(*found, strict=True)
        expected = np.array(wanted_all)
        return _worst(np.array(every), expected, self.allowed(expected), lambda i: names[i[0]])


def file_comparisons(settings: Settings, context: RunContext) -> Iterator[Callable[[Result], str]]:
    """Yield the comparisons of from_json_check_result_process: values of a reference file.

    Values agree within the larger of `tolerance` and `relative_tolerance` × the expected value.
    """
    settings.check_keys(FILE_KEYS)
    what = f"against {settings.text('input_file_name')}"
    try:
        path, _ = find_file(settings, "input_file_name", context.folder, outside=context.outside)
    except InputError as error:
        yield _idle(what, str(error))
        return
    part, data = context.part(settings), read_settings(path)
    absolute, relative = settings.number("tolerance", 1e-3), settings.number("relative_tolerance", 1e-6)
    reference = Reference(data, part, absolute, relative, settings.flag("use_node_coordinates", False))
    steps = steps_by_frequency(context.times, settings.number("time_frequency", 0.1))
    times = [context.times[step] for step in steps]
    compares = {
        component: _at_nodes(component, part.nodes, partial(reference.at_nodes, component))
        for variable in settings.texts("check_variables")
        for component in ([f"{variable}_{axis}" for axis in "XYZ"] if variable in VECTORS else [variable])
    }
    for variable in settings.texts("gauss_points_check_variables"):
        compares[variable] = partial(reference.at_gauss, variable)
    for name, compare in compares.items():
        yield Comparison(f"{name} {what}", times, context.times[-1], compare)


def eigenvalue_comparisons(settings: Settings, context: RunContext) -> Iterator[Callable[[Any], str]]:
    """Yield the comparison of check_eigenvalues_process: ω² to 5 decimals, as many as are stated."""
    settings.check_keys(("help", "model_part_name", "variable_name", "reference_values"))
    text = settings.text("reference_values").strip("[] ")
    try:
        wanted = np.array([float(word) for word in text.split(",")])
    except ValueError:
        text = f"must be numbers such as '[1.0, 2.5]'; got {text!r}"
        raise settings.error("reference_values", text) from None

    def compare(frequencies: Any) -> str:
        found = frequencies[: len(wanted)] ** 2
        allowed = np.full(len(found), 0.5e-5)
        excess, text = _worst(found, wanted[: len(found)], allowed, lambda i: f"eigenvalue {i[0] + 1}")
        return f"check EIGENVALUE_VECTOR {'passed' if excess <= 0 else 'failed'} ({text})"

    yield compare


COMPARISONS: dict[str, Callable[[Settings, RunContext], Iterator[Callable[[Result], str]]]] = {
    "check_scalar_to_nodes_process": node_comparisons,
    "check_vector_components_to_nodes_process": node_comparisons,
    "check_vector_to_nodes_process": node_comparisons,
    "from_json_check_result_process": file_comparisons,
}
"""Processes that compare a result with expected values, by Kratos' module name."""
