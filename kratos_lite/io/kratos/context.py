"""RunContext: what the entries of a Kratos run file refer to - the mesh, its parts, and time."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from kratos_lite.errors import nearest
from kratos_lite.io.settings import Settings, is_number, shown
from kratos_lite.mesh import Mesh, Part
from kratos_lite.typing import Array
from kratos_lite.validation import finite

FOREVER = 1e30
"""What Kratos takes for "End" of an interval."""
MAX_STEPS = 1_000_000
"""Steps of a run; each process lists those in which it acts."""


class Omission(str):
    """A note on what Kratos would do, and kratos_lite does not: ``--strict`` makes it an error."""


@dataclass(frozen=True)
class Interval:
    """Span of time in s in which a process acts, with the tolerance of Kratos.

    >>> 1.1 in Interval(0.0, 1e30), 1.1 in Interval(0.0, 1.0)
    (True, False)
    """

    begin: float = 0.0
    end: float = FOREVER

    def __contains__(self, time: object) -> bool:
        slack = max(1e-14 * self.begin, 1e-30)
        return isinstance(time, float) and self.begin - slack < time < self.end + slack


def interval_of(settings: Settings) -> Interval:
    """Return the key ``interval``: two numbers, of which the second may be ``"End"``."""
    value = settings.get("interval", [0.0, "End"])
    if isinstance(value, list) and len(value) == 2 and is_number(value[0]):
        end = FOREVER if value[1] == "End" else value[1]
        if is_number(end):
            return Interval(float(value[0]), float(end))
    raise settings.error("interval", f'must be [number, number or "End"]; got {shown(value)}')


@dataclass(frozen=True, eq=False)
class RunContext:
    """The mesh and the time steps that processes and checks refer to."""

    mesh: Mesh  # the mesh.
    root: str  # name of the model part that holds everything.
    folder: Path  # folder of the run file.
    times: Sequence[float] = (0.0, 1.0)  # start time and the time of every step, s.
    moved: bool = True  # Kratos would move the nodes with the displacement.
    outside: bool = False  # files outside the folder may be named.
    dofs: tuple[str, ...] = ("DISPLACEMENT",)  # what the names of variables that can be fixed begin with.

    @cached_property
    def places(self) -> tuple[Array, Array]:
        """Where values are evaluated: nodes (n, 3) and centers of conditions (c, 3)."""
        centers = [self.mesh.points[block.nodes].mean(axis=1) for block in self.mesh.conditions]
        return self.mesh.points, np.concatenate([np.zeros((0, 3)), *centers])

    def rounded(self, time: float) -> float:
        """Return a time in s, or that of a step which it is but for rounding."""
        slack = 1e-9 * abs(time)
        near = self.times[min(bisect_left(self.times, time - slack), len(self.times) - 1)]
        return near if abs(near - time) <= slack else float(time)

    def part(self, settings: Settings) -> Part:
        """Return the part that parameters name."""
        return part_of(self.mesh, self.part_name(settings))

    def part_name(self, settings: Settings) -> str:
        """Return the name that a part has in meshes, "" of all; the root's name may stand before it."""
        key, name = "model_part_name", settings.text("model_part_name")
        short = "" if name == self.root else name.removeprefix(self.root + ".")
        if within := settings.text("sub_model_part_name", ""):
            key, short = "sub_model_part_name", f"{short}.{within}".removeprefix(".")
        if short and short not in (known := self.mesh.parts):
            text = f"there is no part {settings.text(key)!r}.{nearest(short, known)} The parts are "
            raise settings.error(key, text + ", ".join([f"{self.root} (all)", *known]))
        return short


def part_of(mesh: Mesh, name: str) -> Part:
    """Return a part by its name in a mesh, or all without one."""
    if name:
        return mesh.parts[name]
    return Part(np.arange(mesh.n_nodes), np.arange(mesh.n_elements), np.arange(mesh.n_conditions))


def steps_by_frequency(times: Sequence[float], frequency: float) -> list[int]:
    """Return the steps of which a process acts once for each `time_frequency` in s, as Kratos counts."""
    counter, steps = 0.0, list[int]()
    for step, (before, time) in enumerate(pairwise(times), 1):
        counter += time - before
        if counter > frequency:
            counter = 0.0
            steps.append(step)
    return steps


def times_of(problem: Settings, solver: Settings, alike: bool = False) -> list[float]:
    """Return the start time and the time of every step, which may have to be alike, as Kratos' loop does."""
    stepping = solver.section("time_stepping", required=True)
    key = "time_step_table" if "time_step" not in stepping and "time_step_table" in stepping else "time_step"
    text = "is for static steps; give 'time_step', as those of a motion are alike here"
    stepping.expect(not alike or key == "time_step", key, text)
    step_at = _steps_of_table(stepping) if key == "time_step_table" else None
    step = 0.0 if step_at else stepping.number(key)
    time, end = problem.number("start_time"), problem.number("end_time")
    text = f"no step is solved: end_time {end:g} must be > start_time {time:g}"
    problem.expect(time < end, "end_time", text)
    times = [time]
    while times[-1] < end:
        step = step_at(times[-1]) if step_at else step
        if not step > 0:
            raise stepping.error(key, f"must be > 0 s; got {step:g} at t = {times[-1]:g} s")
        if (end - times[-1]) / step + len(times) - 1 > MAX_STEPS:
            more = (
                f" at t = {times[-1]:g} s, to which its last rows are extended, as in Kratos,"
                if step_at
                else ""
            )
            raise stepping.error(key, f"{key} {step:g} s{more} makes more than {MAX_STEPS} steps; enlarge it")
        times.append(times[-1] + step)
    return times


def _steps_of_table(stepping: Settings) -> Callable[[float], float]:
    """Return the step after a time by ``time_step_table``: linear between its rows and beyond them."""
    key = "time_step_table"
    rows = stepping.placed(key, finite, stepping.get(key), "the table of times and steps", ("n", 2))
    x, y = rows.T.tolist()
    stepping.expect(x and (np.diff(x) > 0).all(), key, "must have times that grow")

    def step_at(time: float) -> float:
        k = min(max(bisect_left(x, time), 1), len(x) - 1)
        slope = (y[k] - y[k - 1]) / (x[k] - x[k - 1]) if k else 0.0
        return float(y[k - 1] + slope * (time - x[k - 1]))

    return step_at


def module_of(entry: Settings) -> str:
    """Return the module name of a process entry, from ``python_module`` or the registered ``name``.

    ``Processes.KratosMultiphysics.AssignVectorVariableProcess`` is assign_vector_variable_process.
    """
    if "name" not in entry:
        return entry.text("python_module").rsplit(".", 1)[-1]
    words = re.findall(r"[A-Z][a-z0-9]*", entry.text("name").rsplit(".", 1)[-1])
    # The class of this one module is in the singular.
    return "_".join(words).lower().replace("variable_to_condition_process", "variable_to_conditions_process")
