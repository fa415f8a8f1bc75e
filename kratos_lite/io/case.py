"""Case: what an input means, whichever its format."""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.errors import InputError, ModelError
from kratos_lite.model.structure import Structure
from kratos_lite.model.supports import Supports
from kratos_lite.typing import Array
from kratos_lite.validation import flag, positive_step, whole_number

if TYPE_CHECKING:
    from kratos_lite.analysis.integrators import ModelIntegrator
    from kratos_lite.analysis.model import Model
    from kratos_lite.analysis.result import Result
    from kratos_lite.analysis.state import State
    from kratos_lite.bodies import Body


MOST_STEPS = 1_000_000_000
"""Steps of one run; more take weeks; the step is probably mistyped."""


@dataclass(frozen=True, eq=False)
class TimeIntegration:
    """How a model or body moves through time.

    Attributes
    ----------
    step : in s.
    steps : number of steps.
    every : a state is kept after so many steps, and after the last.
    substeps : of bodies: parts of each step, or ``"auto"``.
    integrator : of models, the trapezoidal rule if not given; bodies have their own.
    rayleigh : of models: α in 1/s and β in s of the damping α M + β K.
    lumped : of models: whether the mass stands in the nodes.
    displacement, velocity : of models: (n, 3) at the start; at rest if not given.
    balanced : False lets a model start with the acceleration 0 from any displacement and velocity, as Kratos
        does.
    restart : file of a state from which to go on, or None.
    place : of the step in its file, for messages.
    quasi_static : of models: options of `Model.quasi_static`, whose steps are taken; None for a transient.
    start : s, of quasi-static steps.
    sizes : s, of quasi-static steps that are not alike, in place of `step`; further ones are as the last.

    Raises
    ------
    InputError
        A step is not > 0 s, or there are no steps or absurdly many.
    """

    step: float
    steps: int
    every: int = 1
    substeps: int | str = 1
    integrator: ModelIntegrator | None = None
    rayleigh: tuple[float, float] = (0.0, 0.0)
    lumped: bool = False
    displacement: Array | None = None
    velocity: Array | None = None
    balanced: bool = True
    restart: str | None = None
    place: str = ""
    quasi_static: dict[str, Any] | None = None
    start: float = 0.0
    sizes: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        positive_step(self.step)
        if whole_number(self.steps, "steps") > MOST_STEPS:
            raise InputError(
                f"{self.steps} steps are more than {MOST_STEPS}; take longer ones, or go on with restart"
            )
        whole_number(self.every, "every")
        flag(self.lumped, "lumped")

    def starting_from(self, supports: Supports, displacement: Array | None) -> TimeIntegration:
        """Return the integration from an initial displacement, unless it has one of its own.

        Parameters
        ----------
        supports : the values at supports count there.
        displacement : (n, 3) m, or None.

        Returns
        -------
        TimeIntegration
        """
        if displacement is None or self.displacement is not None:
            return self
        return replace(self, displacement=np.where(supports.fixed, supports.values, displacement))

    @property
    def end(self) -> float:
        """The time after all steps in s."""
        own = self.sizes[: self.steps]
        return self.start + sum(own) + (self.steps - len(own)) * (own[-1] if own else self.step)

    def __str__(self) -> str:
        by = f" by {self.integrator}" if self.integrator else ""
        by = by if self.quasi_static is None else ", quasi-static"
        own = sorted({*self.sizes[: self.steps]} or {self.step})
        size = " … ".join(dict.fromkeys([f"{own[0]:g}", f"{own[-1]:g}"]))
        return f"{self.steps} steps of {size} s{by}"


@dataclass
class Outputs:
    """Files to write.

    Attributes
    ----------
    results : results by their endings: at rest .vtu, .vtk, .json, .html, .csv or .frd, over many processes
        .pvtu (which .vtu becomes) or .json; in time .pvd, .html, .csv, .npz or .frd.
    json : summary, displacements and reactions of a model at its end.
    picture : of the end of a model, or of the path of a body; a film with the ending .gif or .mp4.
    state : the last state, from which another run goes on.
    mode : how .vtu files store their numbers: ``binary`` if not given, ``compressed`` or ``ascii``.
    sections : where and part, as for `Result.section`, of cuts for the summary and json of a model.
    in_steps : files of a model in the steps that a run file of Kratos asks for.
    """

    results: list[str] = field(default_factory=list)
    json: str | None = None
    picture: str | None = None
    state: str | None = None
    mode: str | None = None
    sections: list[Any] = field(default_factory=list)
    in_steps: list[StepOutput] = field(default_factory=list)

    def paths(self) -> list[str]:
        """Return all files.

        Returns
        -------
        list of str
            Results, json, picture, state; without those of `in_steps`.
        """
        single = (self.json, self.picture, self.state)
        return [*self.results, *(path for path in single if path is not None)]


class AfterSteps:
    """What is done after some steps, or at the end of a model without steps."""

    times: Sequence[float]  # s, of these steps
    end: float  # s, of a model without steps

    def is_due(self, time: float) -> bool:
        """Return whether it is done after a step to a time."""
        slack = 1e-9 * abs(time)
        k = bisect_left(self.times, time - slack)
        return k < len(self.times) and self.times[k] <= time + slack


class StepOutput(AfterSteps, ABC):
    """Files with the results of some steps, as output processes of Kratos write them."""

    @abstractmethod
    def paths(self) -> list[str]:
        """Return all files."""

    @abstractmethod
    def check(self, case: Case) -> None:
        """Raise InputError for values that the results of a case do not have."""

    @abstractmethod
    def add(self, result: Result, time: float, state: State | None = None) -> None:
        """Take the result of a step to a time in s; a state of a motion has its velocities too."""

    def close(self) -> None:
        """Write what all steps together make."""

    @abstractmethod
    def summary(self) -> list[str]:
        """Return the files that are written, in few lines."""


@dataclass(frozen=True, eq=False)
class Comparison(AfterSteps):
    """A comparison with expected values after some steps, or at the end of a model."""

    what: str
    times: Sequence[float]
    end: float
    # by how much a result at a time exceeds the tolerance at worst, and the numbers; ValueError says why not
    compare: Callable[[Result, float], tuple[float, str]]

    def __call__(self, result: Result) -> str:
        """Return the line of a result at the end."""
        return self.line([self.found(result, self.end)])

    def found(self, result: Result, time: float) -> tuple[float, str]:
        """Return by how much a result exceeds the tolerance, and the words for it."""
        try:
            excess, text = self.compare(result, time)
        except ValueError as error:
            return np.inf, f"not evaluated: {error}"
        return excess, f"{'passed' if excess <= 0 else 'failed'} ({text})"

    def line(self, found: Sequence[tuple[float, str]]) -> str:
        """Return a line of the worst that was found."""
        steps = f" after {len(found)} steps" if len(found) > 1 else ""
        return f"check {self.what} {max(found, key=lambda pair: pair[0])[1]}{steps}"


@dataclass
class Case:
    """A model or body with all that an input says about its analysis, outputs and expected values.

    Every input becomes one: model files, run files of Kratos, Python scripts, and what the options of the
    command line add.

    Attributes
    ----------
    subject : the model, whose `notes` tell what was not used; or the body, which may hold many.
    time : how it moves through time, or None where it rests.
    modes : number of requested natural frequencies, or 0.
    above : rad/s, the frequency from which on the modes are, or None for the lowest ones.
    buckling : whether the modes are shapes of buckling, with factors of the loads.
    preload : whether the stress of the loads stiffens or softens in natural frequencies.
    after : a case of the same mesh at whose end this one begins: natural frequencies about its state, a
        transient from its displacements; it is run first.
    harmonic : options of `Model.harmonic` for the response to loads that swing, or None; its frequencies may
        also be a function of the model.
    solver, tolerance, error, most_unknowns, backend, petsc : of a model at rest, as for `Model.solve`.
    outputs : files to write.
    expected : comparisons of the end of a model with expected values, each of which returns a line, or a
        `Comparison` after some steps; of modes, each takes their frequencies.
    files : files that were read.
    then : further analyses that the input asks for, run after this one.
    """

    subject: Model | Body
    time: TimeIntegration | None = None
    modes: int = 0
    above: float | None = None
    buckling: bool = False
    preload: bool = False
    after: Case | None = None
    harmonic: dict[str, Any] | None = None
    solver: str = "auto"
    tolerance: float = 1e-10
    error: float | None = None
    most_unknowns: int | None = None
    backend: str | None = None
    petsc: str | None = None
    outputs: Outputs = field(default_factory=Outputs)
    expected: list[Callable[[Result], str]] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    then: list[Case] = field(default_factory=list)
    end: Result | None = field(default=None, init=False, repr=False)  # once it was run

    @property
    def analysis(self) -> str:
        """``static``, ``steady``, ``quasi_static``, ``transient``, ``modal``, ``harmonic`` or ``bodies``."""
        if not self.is_of_model:
            return "bodies"
        if self.modes:
            return "modal"
        if self.harmonic is not None:
            return "harmonic"
        if self.time is not None:
            return "transient" if self.time.quasi_static is None else "quasi_static"
        return "static" if self.model.motion is None else "steady"

    @property
    def is_of_model(self) -> bool:
        """Whether the subject is a model, not a body."""
        return isinstance(self.subject, Structure)

    @property
    def model(self) -> Model:
        """The model.

        Raises
        ------
        ModelError
            The subject is a body.
        """
        if not self.is_of_model:
            raise ModelError("this is a case of bodies; it has no model")
        return self.subject  # type: ignore[return-value]

    @property
    def body(self) -> Body:
        """The body.

        Raises
        ------
        ModelError
            The subject is a model.
        """
        if self.is_of_model:
            raise ModelError("this is a case of a model; it has no body")
        return self.subject  # type: ignore[return-value]

    def compare(
        self, result: Result, found: Mapping[int, list[tuple[float, str]]] | None = None
    ) -> list[str]:
        """Return a line for each expected value: passed, failed or not evaluated, with the numbers.

        Parameters
        ----------
        result : of the model, at its end.
        found : what was found after steps, by the numbers of comparisons.

        Returns
        -------
        list of str
            Such as ``check … passed (…)``.
        """
        steps = found or {}
        return [
            each.line(steps[i]) if isinstance(each, Comparison) and i in steps else each(result)
            for i, each in enumerate(self.expected)
        ]
