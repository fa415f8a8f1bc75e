"""Natural frequencies on the command line."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kratos_lite.analysis.model import Model


def modes_table(model: Model, count: int) -> str:
    """Return the lowest natural frequencies as lines; with a motion of the material the eigenvalues λ.

    Frequency is Im λ, of conjugate pairs once, and growth Re λ, which is not positive where motion is stable.
    """
    head = f"{'mode':>4}  {'frequency Hz':>14}  {'rad/s':>14}"
    if model.motion is None:
        omega, _ = model.modes(count)
        return "\n".join(
            [head, *(f"{i:>4}  {w / (2 * pi):>14.8g}  {w:>14.8g}" for i, w in enumerate(omega.tolist(), 1))]
        )
    values = [z for z in model.complex_modes(2 * count)[0].tolist() if z.imag >= 0]
    rows = (
        f"{i:>4}  {z.imag / (2 * pi):>14.8g}  {z.imag:>14.8g}  {z.real:>14.3g}"
        for i, z in enumerate(values[:count], 1)
    )
    return "\n".join([f"{head}  {'growth 1/s':>14}", *rows])
