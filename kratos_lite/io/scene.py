"""Scene: all that an input says, whichever its format."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.errors import ModelError
from kratos_lite.model.loads import NodalForces, TimeDependentLoad
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Progress
from kratos_lite.validation import flag, positive_step, whole_number

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from kratos_lite.analysis import CentralDifference, Moment, Transient
    from kratos_lite.analysis.schemes import Implicit


@dataclass(frozen=True, eq=False)
class March:
    """How a model marches through time.

    Attributes
    ----------
    dt : step in s.
    steps : number of steps.
    every : a moment is kept after so many steps, and after the last.
    scheme : `newmark()` if not given.
    rayleigh : α in 1/s and β in s of the damping α M + β K.
    lumped : whether the mass stands in the nodes.
    displacement, velocity : (n, 3) at the start; at rest if not given.
    balanced : False lets it start with the acceleration 0 from any displacement and velocity, as Kratos does.
    restart : file of a moment from which to go on, or None.
    """

    dt: float
    steps: int
    every: int = 1
    scheme: Implicit | CentralDifference | None = None
    rayleigh: tuple[float, float] = (0.0, 0.0)
    lumped: bool = False
    displacement: NDArray[np.float64] | None = None
    velocity: NDArray[np.float64] | None = None
    balanced: bool = True
    restart: str | None = None

    def __post_init__(self) -> None:
        positive_step(self.dt)
        whole_number(self.steps, "steps")
        whole_number(self.every, "every")
        flag(self.lumped, "lumped")

    def __str__(self) -> str:
        from kratos_lite.analysis import newmark

        scheme = newmark() if self.scheme is None else self.scheme
        return f"{self.steps} steps of {self.dt:g} s by {scheme.name}"


@dataclass
class Scene:
    """A model with what a run file may say about solving, time, output and expected values.

    Attributes
    ----------
    model : the model; ``model.notes`` tells what was not used.
    solver : ``auto``, ``dense``, ``direct`` or ``amg``.
    tolerance : relative residual at which the iterative solver stops.
    output : paths to write by the keys ``output``, ``json`` and ``picture``.
    checks : comparisons of the end with expected values; each returns a line.
    march : how the model marches through time, or None where it rests.
    """

    model: Model
    solver: str = "auto"
    tolerance: float = 1e-10
    output: dict[str, str] = field(default_factory=dict)
    checks: list[Callable[[Result], str]] = field(default_factory=list)
    march: March | None = None

    def evaluate(self, result: Result) -> list[str]:
        """Return one line for each check, "check passed/failed/not evaluated: …", with the numbers."""
        return [check(result) for check in self.checks]

    def transient(self, progress: Progress | None = None) -> Transient:
        """Return the model ready to march, put to the moment from which it goes on if there is one.

        Raises ModelError where the input says nothing of a march, and the errors of `kratos_lite.Transient`.
        """
        from kratos_lite.analysis import Moment, Transient

        march = self._march()
        names = ("scheme", "rayleigh", "lumped", "displacement", "velocity")
        given = {name: getattr(march, name) for name in names} | {"progress": progress}
        transient = self.model.transient(**given)
        if not march.balanced and not (march.displacement is None and march.velocity is None):
            transient = Transient(_held_at_first(transient), **given)
        if march.restart is not None:
            transient.put(Moment.load(march.restart))
        return transient

    def moments(self, transient: Transient) -> Iterator[Moment]:
        """Return the moments of the march of a transient that `transient` made."""
        march = self._march()
        return transient.march(march.dt, march.steps, every=march.every)

    def _march(self) -> March:
        if self.march is None:
            raise ModelError("the input says nothing of a march; give it a section 'time'")
        return self.march


def _held_at_first(transient: Transient) -> Structure:
    """Return the model of a transient with a load at its start that balances stiffness and damping there."""
    e = transient.equations
    inner = e.times_stiffness(transient.u, 0.0) + e.times_damping(transient.v, 0.0) - e.load(0.0)
    balance = NodalForces(e.system.scatter(inner))
    model = copy(e.model)
    model.loads = [*model.loads, TimeDependentLoad(lambda time: None if time > 0 else balance)]
    return model
