"""Processes of a Kratos run file in time: what they hold, set and load while a model moves.

Kratos runs all processes before every time step, in order; values stay until they are set again.  It starts
with the acceleration 0, as if nothing acted at the start: so loads act here from the first step on.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.errors import InputError
from kratos_lite.io.kratos.context import RunContext
from kratos_lite.io.kratos.processes import Action, notes_of, places_of, set_values
from kratos_lite.io.kratos.variables import LOADING, Variables
from kratos_lite.model.loads import Load, ScaledLoad, TimeDependentLoad
from kratos_lite.typing import Array, Ints

GRAVITY = frozenset(f"VOLUME_ACCELERATION_{axis}" for axis in "XYZ")
SURFACE = frozenset(name for name in LOADING - GRAVITY if not name.startswith("DISPLACEMENT"))
HELD = ("VELOCITY", "ACCELERATION")
"""Variables that cannot be prescribed here."""


class ProcessesInTime:
    """The processes of a run file as supports, loads and initial state of a transient."""

    def __init__(self, actions: Sequence[Action], context: RunContext) -> None:
        self.context = context
        self.notes = notes_of(actions, context)
        self.actions = [action for action in actions if action.steps and len(action.indices)]
        self.displacement: Array | None = None
        self.velocity: Array | None = None
        self._later: list[Load] = []
        self._moving: list[tuple[Ints, str, Callable[[float], float]]] = []

    def prepare(self, values: Variables) -> None:
        """Bring values and supports to what stays in time, and keep what changes for `finish`."""
        self._check(values)
        self._begin(values)
        base = values.copy()
        set_values(self.actions, self.context.times, values)
        for action in self.actions:
            if action.fixed:
                values.fix(action.component, action.indices)
        for i, action in enumerate(self.actions):
            if action.component.startswith("DISPLACEMENT") and action.factors:
                self._move(i, action, values)
        for group, load_of in ((GRAVITY, Variables.gravity), (SURFACE, Variables.condition_loads)):
            actions = [action for action in self.actions if action.component in group]
            if all(self._acts_always(action) and not action.mentions("t") for action in actions):
                continue
            values.note_idle(self.notes, group)
            values.drop(group)
            self._later.append(TimeDependentLoad(_LoadInTime(self, actions, base.only(group), load_of)))
        values.drop({f"{name}_{axis}" for name in HELD for axis in "XYZ"})

    def finish(self, model: Model) -> None:
        """Give a model the loads and supports that change, and let all loads begin with the first step."""
        loads: list[Load] = [ScaledLoad(load, _begun) for load in model.loads]
        model.loads[:] = [*loads, *self._later]
        for indices, axis, motion in self._moving:
            model.fix(indices, axis, motion, override=True)
        if model.loads:
            model.notes.append("as in Kratos, the acceleration at the start is 0: loads act after t = 0")
        if self._moving:
            model.notes.append(
                "supports that move have the velocity of their function; Kratos takes Newmark's formulas"
            )
        model.notes += self.notes

    def at(self, action: Action, time: float) -> float | None:
        """Return the last time, up to the one given, at which an action acts; None if there is none."""
        if float(time) in action.interval:
            return float(time)
        times = self.context.times
        count = bisect_right(action.steps, bisect_right(times, time) - 1)
        return times[action.steps[count - 1]] if count else None

    # ---- supports and start ----------------------------------------------------------------------------

    def _check(self, values: Variables) -> None:
        for action in self.actions:
            name, expect = action.component, action.settings.expect
            if action.fixed:
                text = (
                    f"{name} cannot be fixed; prescribe DISPLACEMENT as a function of t, or give "
                    '"constrained": false and "interval": [0.0, 0.0] for an initial value'
                )
                expect(not name.startswith(HELD), "variable_name", text)
                text = (
                    f"{name} is held in a part of the run only; hold it from start to end, "
                    '"interval": [0.0, "End"], or give "constrained": false for an initial value'
                )
                expect(not name.startswith("DISPLACEMENT") or self._acts_always(action), "interval", text)
        for name, fixed in values.fixed.items():
            if name.startswith(HELD) and fixed.any():
                raise InputError(f"{values.mesh.source}: {name} is fixed; only DISPLACEMENT can be")

    def _begin(self, values: Variables) -> None:
        """Find displacement and velocity at the start."""
        start, points = values.copy(), values.mesh.points
        for action in self.actions:
            name = action.component
            if action.steps[0] == 0 and action.factors:
                value = action.value(points[action.indices], self.context.times[0])
                start.nodal.put(name, action.indices, value)
                is_still = not name.startswith("ACCELERATION") or not np.any(value)
                text = f"{name} cannot be given; the acceleration at the start is 0"
                action.settings.expect(is_still, "variable_name", text)
            if action.fixed and name.startswith("DISPLACEMENT"):
                start.fix(name, action.indices)
        u, v = start.nodal.vector("DISPLACEMENT"), start.nodal.vector("VELOCITY")
        fixed = [start.fixed.get(f"DISPLACEMENT_{axis}", np.zeros(len(v), bool)) for axis in "XYZ"]
        if v[np.transpose(fixed)].any():
            self.notes.append("VELOCITY of fixed nodes is left out; Kratos keeps it in the first step")
        self.displacement, self.velocity = u if u.any() else None, v if v.any() else None

    def _move(self, i: int, action: Action, values: Variables) -> None:
        """Keep the motion of the supports that an action gives; refuse one of a part of the run."""
        name, expect = action.component, action.settings.expect
        fixed = values.fixed.get(name, np.zeros(values.mesh.n_nodes, dtype=bool))
        indices = action.indices[fixed[action.indices]]
        if not len(indices) or self._acts(action) == 0:
            return
        text = (
            f"{name} of a support changes in a part of the run only; give it as one function of t with the "
        )
        expect(self._acts_always(action), "interval", text + 'interval [0.0, "End"]')
        for later in self.actions[i + 1 :]:
            if later.component == name and later.factors and self._acts_always(later):
                indices = np.setdiff1d(indices, later.indices)
        if not action.mentions("t") or not len(indices):
            return
        text = f"{name}: a support may move with x, y, z or with t, not with both; "
        expect(not action.mentions("xyzXYZ"), "value", text + "give each part a process of its own")
        point = np.zeros((1, 3))
        self._moving.append((indices, name[-1].lower(), lambda t: float(action.value(point, t))))

    def _acts(self, action: Action) -> int:
        """Return the number of steps, without the start, in which an action acts."""
        return len(action.steps) - (action.steps[0] == 0)

    def _acts_always(self, action: Action) -> bool:
        return self._acts(action) == len(self.context.times) - 1


def _begun(time: float) -> float:
    return float(time > 0)


class _LoadInTime:
    """The load of some actions as a function of the time; the same object while nothing changes."""

    def __init__(
        self,
        processes: ProcessesInTime,
        actions: list[Action],
        base: Variables,
        load_of: Callable[[Variables], Load | None],
    ) -> None:
        self.processes, self.actions, self.base, self.load_of = processes, actions, base, load_of
        self.last: tuple[object, Load | None] = (None, None)

    def __call__(self, time: float) -> Load | None:
        if not time > 0:
            return None
        acting = [
            (when, i) for i, a in enumerate(self.actions) if (when := self.processes.at(a, time)) is not None
        ]
        acting.sort()
        key = [(i, when if self.actions[i].mentions("t") else None) for when, i in acting]
        if key != self.last[0]:
            values = self.base.copy()
            points = places_of(values.mesh)
            for when, i in acting:
                self.actions[i].put(values, points, when)
            self.last = (key, self.load_of(values))
        return self.last[1]
