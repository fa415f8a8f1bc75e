"""Natural frequencies of models."""

from __future__ import annotations

from math import pi

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.io.case import Case
from kratos_lite.io.runners.outcome import Outcome
from kratos_lite.typing import Progress


def check(case: Case) -> list[str]:
    """Return the warnings of the model, checked as the search for its frequencies does."""
    return EquationsOfMotion(case.model, steady=case.model.motion is not None).warnings


def run(case: Case, progress: Progress | None = None) -> Outcome:
    """Find the lowest natural frequencies; with a motion of the material the eigenvalues λ.

    Frequency is Im λ, of conjugate pairs once, and growth Re λ, which is not positive where motion is stable.
    """
    model, count = case.model, case.modes
    head = f"{'mode':>4}  {'frequency Hz':>14}  {'rad/s':>14}"
    if model.motion is None:
        omega = model.modes(count, progress=progress)[0].tolist()
        rows = [f"{i:>4}  {w / (2 * pi):>14.8g}  {w:>14.8g}" for i, w in enumerate(omega, 1)]
        return Outcome(case, [], lines=[head, *rows])
    values = [z for z in model.complex_modes(2 * count, progress=progress)[0].tolist() if z.imag >= 0][:count]
    rows = [
        f"{i:>4}  {z.imag / (2 * pi):>14.8g}  {z.imag:>14.8g}  {z.real:>14.3g}"
        for i, z in enumerate(values, 1)
    ]
    return Outcome(case, [], lines=[f"{head}  {'growth 1/s':>14}", *rows])
