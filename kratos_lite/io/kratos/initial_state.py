"""The set_initial_state_process of Kratos: strain and stress of elements where nothing is displaced."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kratos_lite.analysis.model import Model
from kratos_lite.io.kratos.context import RunContext, interval_of
from kratos_lite.io.kratos.expressions import evaluate
from kratos_lite.io.settings import Settings, is_number, shown
from kratos_lite.typing import Array

MODULE = "set_initial_state_process"
GRADIENT = "imposed_deformation_gradient"
KEYS = ("help", "model_part_name", "dimension", "imposed_strain", "imposed_stress", GRADIENT, "interval")


def initial_state_of(settings: Settings, context: RunContext) -> Callable[[Model], None]:
    """Return what gives a model σ = C (ε - imposed_strain) + imposed_stress on a part of it."""
    settings.check_keys(KEYS)
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
