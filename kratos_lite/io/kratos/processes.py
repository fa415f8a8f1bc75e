"""Processes of a Kratos run file: what they set and fix on nodes, conditions and elements, and when.

Kratos runs all processes before every time step, in order, and takes their supports back after
it; values stay.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.io.kratos.context import Interval, Omission, RunContext, interval_of
from kratos_lite.io.kratos.expressions import evaluate
from kratos_lite.io.kratos.variables import PRESSURES, TEMPERATURE, VECTORS, Variables
from kratos_lite.io.names import nearest_variable
from kratos_lite.io.settings import Settings, is_number, shown
from kratos_lite.typing import Array, Ints

Value = float | str
Factors = tuple[Value, ...] | None
IDLE = ("ROTATION", "VELOCITY", "ACCELERATION", "ANGULAR_VELOCITY", "ANGULAR_ACCELERATION", "REACTION")
"""Vector variables that files set although a static solution of solids does not use them."""
KNOWN_VECTORS = (*VECTORS, *IDLE)
KNOWN_SCALARS = (*(f"{v}_{a}" for v in KNOWN_VECTORS for a in "XYZ"), *PRESSURES, TEMPERATURE)
COMMON = {
    "help": "", "mesh_id": 0, "model_part_name": "", "variable_name": "", "interval": [], "local_axes": {}
}  # fmt: skip
"""Parameters of all processes, with a value of the kind of each."""
NORMALS = ("automatic_inwards_normal", "automatic_outwards_normal")


@dataclass(eq=False)
class Action:
    """One component that a process sets, fixes or both."""

    settings: Settings  # its parameters, for messages.
    indices: Ints  # node or condition indices.
    component: str  # scalar variable, such as ``DISPLACEMENT_X``.
    # the value is their product, each a number or an expression; empty to leave it as it is.
    factors: tuple[Value, ...]
    interval: Interval  # when it acts.
    steps: list[int]  # in which steps that is; step 0 is the start, before the first solution.
    on_conditions: bool = False  # set conditions, not nodes.
    fixed: bool = False  # a Dirichlet condition in the steps in which it acts.

    def mentions(self, names: str) -> bool:
        """Return whether an expression uses one of these names of one letter."""
        return any(isinstance(f, str) and re.search(rf"(?<!\w)[{names}](?!\w)", f) for f in self.factors)

    def value(self, points: Array, time: float) -> Array | float:
        """Return the value at points (m, 3) in m and a time in s."""
        x, y, z = points.T
        X, Y, Z = 0.0 * points.T if self.on_conditions else points.T  # measured against Kratos 10.4.4
        variables = {"x": x, "y": y, "z": z, "t": time, "X": X, "Y": Y, "Z": Z}
        product: Any = 1.0
        try:
            for factor in self.factors:
                with np.errstate(over="ignore"):
                    product = product * (evaluate(factor, variables) if isinstance(factor, str) else factor)
            if not np.isfinite(product).all():
                raise ValueError("modulus × direction is too large for a number")
        except ValueError as error:
            key = "value" if "value" in self.settings else "modulus"
            raise self.settings.error(key, f"{self.component}: {error}") from None
        return product

    def put(self, values: Variables, context: RunContext, time: float) -> None:
        """Set the values that they are at a time in s."""
        value = self.value(context.places[self.on_conditions][self.indices], time)
        fields = values.conditional if self.on_conditions else values.nodal
        fields.put(self.component, self.indices, value)


def _value(settings: Settings, value: Any, key: str) -> Value:
    text = f"must be a number or an expression in x, y, z, t; got {shown(value)}"
    settings.expect(isinstance(value, str) or is_number(value), key, text)
    return value if isinstance(value, str) else float(value)


def _three(settings: Settings, key: str) -> list[Any]:
    value = settings.get(key)
    fits = isinstance(value, list) and len(value) == 3
    settings.expect(fits, key, f"must be a list of three entries; got {shown(value)}")
    return list(value)


def _vector(settings: Settings) -> list[Factors]:
    values = _three(settings, "value")
    return [None if value is None else (_value(settings, value, "value"),) for value in values]


def _scalar(settings: Settings) -> list[Factors]:
    return [(_value(settings, settings.get("value", 0.0), "value"),)]


def _by_direction(settings: Settings) -> list[Factors]:
    """Return modulus × direction; only a direction of numbers is brought to length 1."""
    is_normal = settings.get("direction") in NORMALS
    settings.expect(not is_normal, "direction", "automatic normals are not supported; give three numbers")
    direction = [_value(settings, d, "direction") for d in _three(settings, "direction")]
    if not any(isinstance(d, str) for d in direction):
        length = hypot(*map(float, direction))
        settings.expect(length >= 1e-12, "direction", "direction is zero; give a vector of any other length")
        direction = [float(d) / length for d in direction]
    modulus = _value(settings, settings.get("modulus"), "modulus")
    return [(d, modulus) for d in direction]


@dataclass(frozen=True)
class Process:
    """A kind of process: what it sets, and of what."""

    # the factors of each component from the parameters; None leaves the component alone.
    factors: Callable[[Settings], Sequence[Factors]]
    keys: tuple[str, ...] = ("value",)  # parameters beside the common ones.
    on_conditions: bool = False  # it acts on conditions, and fixes nothing.
    is_vector: bool = True  # it sets three components.


DIRECTION = ("modulus", "direction")
PROCESSES = {
    "assign_vector_variable_process": Process(_vector),
    "assign_scalar_variable_process": Process(_scalar, is_vector=False),
    "assign_vector_by_direction_process": Process(_by_direction, DIRECTION),
    "fix_vector_variable_process": Process(lambda _: [()] * 3, ()),
    "fix_scalar_variable_process": Process(lambda _: [()] * 3, (), is_vector=False),
    "assign_vector_variable_to_conditions_process": Process(_vector, on_conditions=True),
    "assign_scalar_variable_to_conditions_process": Process(_scalar, on_conditions=True, is_vector=False),
    "assign_vector_by_direction_to_condition_process": Process(_by_direction, DIRECTION, on_conditions=True),
}
"""Processes that set or fix values, by Kratos' module name."""


def actions_of(entry: Settings, module: str, context: RunContext) -> list[Action]:
    """Return what a process of the table `PROCESSES` does."""
    process, settings = PROCESSES[module], entry.section("Parameters", required=True)
    refuse_local_axes(settings)
    on_conditions = process.on_conditions
    own: dict[str, Any] = {"entities": []} if on_conditions else {"constrained": None}
    settings.check_keys(COMMON | dict.fromkeys(process.keys) | own)
    name, part = _variable(settings, process), context.part(settings)
    indices, interval = part.conditions if on_conditions else part.nodes, interval_of(settings)
    names = [f"{name}_{axis}" for axis in "XYZ"] if process.is_vector else [name]
    fixed = _fixed(settings, process)
    is_dof = name.startswith(context.dofs)
    text = f'{name} cannot be fixed; give "constrained": false, as Kratos wants it'
    settings.expect(is_dof or not any(fixed), "constrained", text)
    components = zip(names, process.factors(settings), fixed, strict=False)
    steps = [step for step, time in enumerate(context.times) if time in interval]
    later = [step for step in steps if step]
    actions = []
    for component, factors, is_fixed in components:
        if factors or (is_fixed and factors is not None):
            acting = steps if factors and not on_conditions else later
            entries = (settings, indices, component, factors, interval, acting, on_conditions, is_fixed)
            actions.append(Action(*entries))
    return actions


def refuse_local_axes(settings: Settings) -> None:
    """Raise InputError where the parameters of a process name local axes."""
    used = settings.section("local_axes").values
    settings.expect(not used, "local_axes", "local_axes are not supported; give the values along x, y, z")


def _variable(settings: Settings, process: Process) -> str:
    kind, known = ("vector", KNOWN_VECTORS) if process.is_vector else ("scalar", KNOWN_SCALARS)
    name = settings.text("variable_name").rsplit(".", 1)[-1]
    if name not in known:
        text = f"{name!r} is not a {kind} variable of static solids.{nearest_variable(name, known)}"
        raise settings.error("variable_name", f"{text} Known are {', '.join(known[:5])} …")
    return name


def _fixed(settings: Settings, process: Process) -> list[bool]:
    """Return ``constrained`` for each component; one word stands for all."""
    if process.on_conditions:
        return [False] * 3
    value = settings.get("constrained", True)
    by_axis = process.is_vector and process.keys != DIRECTION
    flags = value if by_axis and isinstance(value, list) else [value] * 3
    fits = len(flags) == 3 and all(isinstance(flag, bool) for flag in flags)
    words = "true, false or a list of three of them" if by_axis else "true or false"
    settings.expect(fits, "constrained", f"must be {words}; got {shown(value)}")
    return flags


def run(actions: Sequence[Action], context: RunContext, notes: list[str], values: Variables) -> None:
    """Bring the values and supports to what they are in the last step of a run; add notes."""
    set_values(actions, context, values)
    last = len(context.times) - 1
    for action in actions:
        # what is fixed before the first step is so through it
        if action.fixed and action.steps and max(action.steps[-1], 1) == last:
            values.fix(action.component, action.indices)
    notes += notes_of(actions, context)


def notes_of(actions: Sequence[Action], context: RunContext) -> list[str]:
    """Return notes on actions that never act, and on those that Kratos refuses or evaluates elsewhere."""
    notes = []
    for action in actions:
        where = action.settings.path.removesuffix(".Parameters")
        if not action.steps or (context.mesh.whole and not len(action.indices)):
            why = "its part has none to act on" if action.steps else "its interval holds no step"
            notes.append(f"{where}: {action.component} is never set: {why}")
        elif context.moved and action.steps[-1] > 1 and action.mentions("xyz"):
            # Before the first step nothing has moved yet.
            cure = '"move_mesh_flag": false' if action.on_conditions else "write X, Y, Z"
            time = context.times[action.steps[-1]]
            text = (
                f"{where}: Kratos evaluates x, y, z at time {time:g} s on the mesh as the steps before moved "
                f"it, kratos_lite on the undeformed one; {cure} to mean the same"
            )
            notes.append(Omission(text))
        if len(action.factors) > 1 and any(" if " in str(factor) for factor in action.factors):
            cure = "Kratos refuses 'if' in a modulus or a direction; give 'value' of a vector process"
            notes.append(Omission(f"{where}: {cure}"))
        if action.on_conditions and action.mentions("XYZ"):
            notes.append(f"{where}: X, Y, Z are 0 on conditions, as in Kratos; write x, y, z")
    return list(dict.fromkeys(notes))


def set_values(actions: Sequence[Action], context: RunContext, values: Variables) -> None:
    """Set what actions set, each at its last step."""
    for action in sorted((a for a in actions if a.steps and a.factors), key=lambda a: a.steps[-1]):
        action.put(values, context, context.times[action.steps[-1]])


# ---- strain and stress of elements where nothing is displaced --------------------------------------------

INITIAL_STATE = "set_initial_state_process"
GRADIENT = "imposed_deformation_gradient"
OF_STATE = ("help", "model_part_name", "dimension", "imposed_strain", "imposed_stress", GRADIENT, "interval")


def initial_state_of(settings: Settings, context: RunContext) -> Callable[[Model], None]:
    """Return what gives a model σ = C (ε - imposed_strain) + imposed_stress on a part of it."""
    settings.check_keys(OF_STATE)
    part, interval = context.part(settings).elements, interval_of(settings)
    times = [time for time in context.times[1:] if time in interval]
    in_steps = len(context.times) > 2
    text = "must hold all steps, as the state stays"
    settings.expect(len(times) == len(context.times) - 1 or (times and not in_steps), "interval", text)
    strain, stress = (_six(settings, key, np.array(times)) for key in ("imposed_strain", "imposed_stress"))
    gradient = settings.get(GRADIENT, np.eye(3).tolist())
    text = "is not supported; give imposed_strain and the unit matrix"
    settings.expect(gradient == np.eye(3).tolist(), GRADIENT, text)

    def apply(model: Model) -> None:
        for group in model.element_groups():
            rows, law = np.intersect1d(group.rows, part), group.material
            text = f"{type(law).__name__} has no initial state here; take a law of small strains"
            settings.expect(not len(rows) or law.strain_measure == "small", "model_part_name", text)
            if len(rows):
                model.add_prestress(stress - law.C @ strain, rows)

    return apply


def _six(settings: Settings, key: str, times: Array) -> Array:
    """Return six components, numbers or expressions in t that are the same in all steps."""
    values = settings.get(key, [0.0] * 6)
    fits = isinstance(values, list) and len(values) == 6
    fits = fits and all(is_number(value) or isinstance(value, str) for value in values)
    text = f"must be six numbers or expressions in t, xx yy zz xy yz xz; got {shown(values)}"
    settings.expect(fits, key, text)
    try:
        found = np.array([evaluate(str(value), {"t": times}) + 0.0 * times for value in values])
    except ValueError as error:
        raise settings.error(key, str(error)) from None
    settings.expect((found == found[:, :1]).all(), key, "changes with t, which an initial state cannot here")
    return found[:, 0]
