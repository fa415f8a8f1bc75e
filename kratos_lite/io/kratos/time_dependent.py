"""Kratos run files in time: integrator, damping and steps; what processes fix, set and load on the way.

Kratos runs all processes before every time step, in order; values stay until they are set again.  It starts
motions with the acceleration 0, as if nothing acted at the start: so loads act here from the first step on.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.errors import InputError
from kratos_lite.io.case import TimeIntegration
from kratos_lite.io.kratos.context import Omission, RunContext
from kratos_lite.io.kratos.processes import Action, notes_of, set_values
from kratos_lite.io.kratos.variables import LOADING, TEMPERATURE, Variables
from kratos_lite.io.settings import Settings
from kratos_lite.mesh.blocks import mask_of
from kratos_lite.model.loads import Load, ScaledLoad, TimeDependentLoad
from kratos_lite.typing import Array, Ints, Mask

if TYPE_CHECKING:
    from kratos_lite.analysis.integrators import ModelIntegrator

LoadOf = Callable[[Variables], "Load | None"]
Motion = Callable[[float], "Array | float | None"]
DYNAMIC = ("Dynamic", "dynamic")
"""Kratos' solver_type of what moves."""
RAYLEIGH = ("rayleigh_alpha", "rayleigh_beta")
GRAVITY = frozenset(f"VOLUME_ACCELERATION_{axis}" for axis in "XYZ")
HEAT = frozenset({TEMPERATURE})
SURFACE = frozenset(n for n in LOADING - GRAVITY - HEAT if not n.startswith("DISPLACEMENT"))
UNPRESCRIBED = ("VELOCITY", "ACCELERATION")
"""Variables that cannot be prescribed here."""


class ProcessesInTime:
    """The processes of a run file as supports, loads and initial state of a transient, or of static steps."""

    def __init__(self, actions: Sequence[Action], context: RunContext, dynamic: bool = True) -> None:
        self.context, self.dynamic = context, dynamic
        self.notes = notes_of(actions, context)
        self.actions = [action for action in actions if action.steps and len(action.indices)]
        self._later: list[Load] = []
        self._moving: list[tuple[Ints, str, Motion]] = []

    def prepare(self, values: Variables) -> None:
        """Bring values and supports to what stays in time, and keep what changes for `finish`."""
        self._check(values)
        values.moves = self.context.moved
        if self.dynamic:
            self._begin(values)
        base = values.copy()
        set_values(self.actions, self.context, values)
        for action in self.actions:
            if action.fixed:
                values.fix(action.component, action.indices)
        for axis in "XYZ":
            self._hold(f"DISPLACEMENT_{axis}", base)
        heated = filter(values.temperature, values.expanding)
        loads: list[tuple[frozenset[str], LoadOf]] = [
            (GRAVITY, Variables.gravity),
            (SURFACE, Variables.condition_loads),
            *((HEAT, partial(Variables.temperature, properties=p)) for p in heated),
        ]
        for group, load_of in loads:
            actions = [action for action in self.actions if action.component in group]
            if any(action.mentions("t") or not self._acts_always(action) for action in actions):
                if group is SURFACE:
                    values.note_idle(self.notes)
                if group is HEAT:
                    values.note_means(self.notes)
                values.drop(group)
                function = _load_in_time(actions, self.context, base, load_of)
                self._later.append(TimeDependentLoad(function, group is SURFACE and values.follows))
        values.drop({f"{name}_{axis}" for name in UNPRESCRIBED for axis in "XYZ"})

    def finish(self, model: Model) -> None:
        """Give a model the loads and supports that change, and let all loads begin with the first step."""
        loads: list[Load] = list(model.loads)
        if self.dynamic:
            loads = [ScaledLoad(load, lambda time: float(time > 0)) for load in loads]
        model.loads[:] = [*loads, *self._later]
        for indices, axis, motion in self._moving:
            model.fix(indices, axis, motion, override=True)
        if self.dynamic and model.loads:
            model.notes.append("as in Kratos, the acceleration at the start is 0: loads act after t = 0")
        if self.dynamic and self._moving:
            text = "supports that move have the velocity of their function"
            model.notes.append(Omission(f"{text}; Kratos takes Newmark's formulas"))
        model.notes += self.notes

    # ---- supports and start ----------------------------------------------------------------------------

    def _check(self, values: Variables) -> None:
        for action in self.actions:
            name, expect = action.component, action.settings.expect
            text = (
                f"{name} cannot be fixed; prescribe DISPLACEMENT as a function of t, or give "
                '"constrained": false and "interval": [0.0, 0.0] for an initial value'
            )
            prescribed = self.dynamic and action.fixed and name.startswith(UNPRESCRIBED)
            expect(not prescribed, "variable_name", text)
        for name, fixed in values.fixed.items() if self.dynamic else ():
            if name.startswith(UNPRESCRIBED) and fixed.any():
                raise InputError(f"{values.mesh.source}: {name} is fixed; only DISPLACEMENT can be")

    def _begin(self, values: Variables) -> None:
        """Find displacement and velocity at the start."""
        start = values.copy()
        for action in self.actions:
            name = action.component
            if action.steps[0] == 0 and action.factors:
                action.put(start, self.context, self.context.times[0])
                accelerated = start.nodal.scalar(name)[action.indices].any()
                is_still = not (name.startswith("ACCELERATION") and accelerated)
                text = f"{name} cannot be given; the acceleration at the start is 0"
                action.settings.expect(is_still, "variable_name", text)
            if action.fixed and name.startswith("DISPLACEMENT"):
                start.fix(name, action.indices)
        u, v = start.nodal.vector("DISPLACEMENT"), start.nodal.vector("VELOCITY")
        fixed = {
            f"VELOCITY{name[-2:]}": mask for name, mask in start.fixed.items() if name[:-2] == "DISPLACEMENT"
        }
        if any(start.nodal.scalar(name)[mask].any() for name, mask in fixed.items()):
            text = "VELOCITY of fixed nodes is omitted; Kratos keeps it in the first step"
            self.notes.append(Omission(text))
        self.displacement, self.velocity = u if u.any() else None, v if v.any() else None

    def _hold(self, name: str, base: Variables) -> None:
        """Keep how the supports of a component move, come and go."""
        n, actions = base.mesh.n_nodes, [each for each in self.actions if each.component == name]
        held = base.fixed.get(name, np.zeros(n, dtype=bool))
        touched = np.stack([held, *(mask_of(each.indices, n) for each in actions)])
        nodes = np.flatnonzero(touched[[True, *(each.fixed for each in actions)]].any(axis=0))
        kinds, of = np.unique(touched[:, nodes], axis=1, return_inverse=True)
        for k, (is_held, *acts) in enumerate(kinds.T):
            turns = [each for each, does in zip(actions, acts, strict=True) if does]
            if turns:
                values = base.nodal.scalar(name)
                self._take_turns(nodes[of.ravel() == k], name, turns, bool(is_held), values)

    def _take_turns(self, nodes: Ints, name: str, turns: list[Action], held: bool, given: Array) -> None:
        """Keep how nodes move that some actions hold in turn; refuse what only a solution would tell."""
        fixed, when, last = _timeline(turns, held, len(self.context.times))
        used = [turns[i - 1] if i else None for i in np.unique(last[1:][fixed[1:]])]
        place = next((each for each in turns if each.fixed), turns[0]).settings
        text = (
            f"{name} is fixed in a part of the run only; fix it from start to end, "
            '"interval": [0.0, "End"], or give "constrained": false for an initial value'
        )
        place.expect(not self.dynamic or bool(fixed[1:].all()), "interval", text)
        begins = np.flatnonzero(fixed[2:] & ~fixed[1:-1]) + 2
        text = f"{name} is fixed only from a later step on, at the value solved before; assign one there"
        place.expect(bool((when[begins] == begins).all()), "interval", text)
        if fixed[1:].all() and len(used) == 1 and not (used[0] and used[0].mentions("t")):
            return
        text = f"{name} of a support changes in a part of the run only; give it as one function of t"
        in_turn = sum(self._acts(each) for each in used if each) == len(fixed) - 1
        place.expect(not self.dynamic or in_turn, "interval", text + ' with the interval [0.0, "End"]')
        self._moving.append((nodes, name[-1].lower(), self._motion(used, fixed, given)))

    def _motion(self, used: list[Action | None], fixed: Mask, given: Array) -> Motion:
        """Return the displacement by the time that actions, or None for the mesh file, give in turn."""
        points, times = self.context.mesh.points, self.context.times
        varies = any(each is None or each.mentions("xyzXYZ") for each in used)
        first = times[int(fixed[1:].argmax()) + 1]

        def motion(time: float) -> Array | float | None:
            time = self.context.rounded(time)
            if not self.dynamic:
                time = time if time > times[0] else first
                if not fixed[min(bisect_left(times, time), len(times) - 1)]:
                    return None
            acting = [(times[0] if each is None else _last_time(each, times, time)) for each in used]
            t, i = max(((t, i) for i, t in enumerate(acting) if t is not None), default=(time, 0))
            action = used[i]
            value = given if action is None else action.value(points if varies else points[:1], t)
            return np.broadcast_to(value, len(points)) if varies else float(np.ravel(value)[0])

        return motion

    def _acts(self, action: Action) -> int:
        """Return the number of steps, without the start, in which an action acts."""
        return len(action.steps) - (action.steps[0] == 0)

    def _acts_always(self, action: Action) -> bool:
        return self._acts(action) == len(self.context.times) - 1


def _timeline(turns: Sequence[Action], held: bool, count: int) -> tuple[Mask, Ints, Ints]:
    """Return for each step whether nodes are fixed, when their value was set, and by which action, from 1.

    0 stands for the mesh file, which sets values at the start, and may hold the nodes all the time.
    """
    fixed, at = np.full(count, held), np.full((len(turns) + 1, count), -1)
    at[0] = 0
    for each, row in zip(turns, at[1:], strict=True):
        if each.factors:
            row[each.steps] = each.steps
        if each.fixed:
            fixed[each.steps] = True
            fixed[1] |= each.steps[0] == 0  # what is fixed before the first step is so through it
    at = np.maximum.accumulate(at, axis=1)
    when = at.max(axis=0)
    return fixed, when, len(turns) - (at[::-1] == when).argmax(axis=0)


def _load_in_time(
    actions: Sequence[Action], context: RunContext, base: Variables, load_of: LoadOf
) -> Callable[[float], Load | None]:
    """Return the load of some actions as a function of the time; the same object while nothing changes."""
    times = context.times

    @lru_cache(maxsize=1)
    def load(acting: tuple[tuple[int, float], ...]) -> Load | None:
        values = base.copy()
        for i, when in acting:
            actions[i].put(values, context, when)
        return load_of(values)

    def at(time: float) -> Load | None:
        if not time > times[0]:
            return None
        last = [_last_time(action, times, context.rounded(time)) for action in actions]
        acting = sorted((when, i) for i, when in enumerate(last) if when is not None)
        return load(tuple((i, when if actions[i].mentions("t") else 0.0) for when, i in acting))

    return at


def _last_time(action: Action, times: Sequence[float], time: float) -> float | None:
    """Return the last time, up to the one stated, at which an action acts; None if there is none."""
    if time in action.interval:
        return time
    count = bisect_right(action.steps, bisect_right(times, time) - 1)
    return times[action.steps[count - 1]] if count else None


def time_integration_of(settings: Settings, processes: ProcessesInTime) -> TimeIntegration:
    """Return the time integration of a dynamic run file; InputError with the place of what is wrong."""
    solver, problem = settings.section("solver_settings"), settings.section("problem_data")
    times = processes.context.times
    text = f"must be 0 for dynamic solutions; got {times[0]:g}: shift the times"
    problem.expect(times[0] == 0, "start_time", text)
    alpha, beta = (solver.number(key, 0.0) for key in RAYLEIGH)
    for key, value in zip(RAYLEIGH, (alpha, beta), strict=True):
        solver.expect(value >= 0, key, f"must be ≥ 0; got {value:g}")
    return TimeIntegration(
        solver.section("time_stepping").number("time_step"),
        len(times) - 1,
        integrator=_integrator(solver),
        rayleigh=(alpha, beta),
        displacement=processes.displacement,
        velocity=processes.velocity,
        balanced=False,
    )


def _integrator(solver: Settings) -> ModelIntegrator:
    """Return the integrator that Kratos would take."""
    from kratos_lite.analysis.integrators import Bossak, Newmark

    method = solver.text("time_integration_method", "implicit")
    text = (
        f"time_integration_method {method!r} is not supported: take 'implicit' with 'newmark'; "
        "the option --integrator central_difference then integrates explicitly"
    )
    solver.expect(method == "implicit", "time_integration_method", text)
    scheme, beta = solver.text("scheme_type", "bossak"), solver.number("newmark_beta", 0.25)
    solver.expect(beta == 0.25, "newmark_beta", f"must be 0.25, which is stable; got {beta:g}")
    text = f"scheme_type {scheme!r} is not supported; take 'newmark' or 'bossak' (Kratos' default)"
    solver.expect(scheme in ("newmark", "bossak"), "scheme_type", text)
    if scheme == "newmark":
        return Newmark()
    return solver.placed("damp_factor_m", Bossak, solver.number("damp_factor_m", -0.3))
