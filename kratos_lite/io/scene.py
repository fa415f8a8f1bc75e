"""Scene: all that an input says, whichever its format."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from kratos_lite.model import Model
from kratos_lite.result import Result


@dataclass
class Scene:
    """A model with what a run file may say about solving, output and expected values.

    Attributes
    ----------
    model : the model; ``model.notes`` tells what was not used.
    solver : ``auto``, ``dense``, ``direct`` or ``amg``.
    tolerance : relative residual at which the iterative solver stops.
    output : paths to write by the keys ``output``, ``json`` and ``picture``.
    checks : comparisons of the result with expected values; each returns a line.
    """

    model: Model
    solver: str = "auto"
    tolerance: float = 1e-10
    output: dict[str, str] = field(default_factory=dict)
    checks: list[Callable[[Result], str]] = field(default_factory=list)

    def evaluate(self, result: Result) -> list[str]:
        """Return one line for each check, "check passed/failed/not evaluated: …", with the numbers."""
        return [check(result) for check in self.checks]
