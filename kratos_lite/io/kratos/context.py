"""RunContext: what the entries of a Kratos run file refer to - the mesh, its parts, and time."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kratos_lite.errors import nearest
from kratos_lite.io.settings import Settings, is_number, shown
from kratos_lite.mesh import Mesh, Part

FOREVER = 1e30
"""What Kratos takes for "End" of an interval."""
MAX_STEPS = 1_000_000
"""Steps of a run; each process lists those in which it acts."""


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

    def part(self, settings: Settings, key: str = "model_part_name") -> Part:
        """Return the part that a key names; the root's name may stand before it, or alone for all."""
        mesh, name = self.mesh, settings.text(key)
        if name == self.root:
            return Part(np.arange(mesh.n_nodes), np.arange(mesh.n_elements), np.arange(mesh.n_conditions))
        short = name.removeprefix(self.root + ".")
        if short not in mesh.parts:
            text = f"there is no part {name!r}.{nearest(short, mesh.parts)} The parts are {self.root} (all), "
            raise settings.error(key, text + ", ".join(mesh.parts))
        return mesh.parts[short]


def times_of(problem: Settings, solver: Settings) -> list[float]:
    """Return the start time and the time of every step, as Kratos' loop makes them."""
    stepping = solver.section("time_stepping", required=True)
    table = "time_step_table" in stepping and "time_step" not in stepping
    stepping.expect(not table, "time_step_table", "time_step_table is not supported; give time_step")
    step = stepping.number("time_step")
    time, end = problem.number("start_time"), problem.number("end_time")
    stepping.expect(step > 0, "time_step", f"must be > 0 s; got {step:g}")
    text = f"no step is solved: end_time {end:g} must be > start_time {time:g}"
    problem.expect(time < end, "end_time", text)
    text = f"time_step {step:g} s makes more than {MAX_STEPS} steps; enlarge it"
    stepping.expect((end - time) / step <= MAX_STEPS, "time_step", text)
    times = [time]
    while times[-1] < end:
        times.append(times[-1] + step)
    return times


def module_of(entry: Settings) -> str:
    """Return the module name of a process entry, from ``python_module`` or the registered ``name``.

    ``Processes.KratosMultiphysics.AssignVectorVariableProcess`` is assign_vector_variable_process.
    """
    if "name" not in entry:
        return entry.text("python_module").rsplit(".", 1)[-1]
    words = re.findall(r"[A-Z][a-z0-9]*", entry.text("name").rsplit(".", 1)[-1])
    # The class of this one module is in the singular.
    return "_".join(words).lower().replace("variable_to_condition_process", "variable_to_conditions_process")
