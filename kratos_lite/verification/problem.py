"""Problem: a question with a known answer; Row: what one element answers, and its grade."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from math import inf, isfinite

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.errors import InputError, KratosLiteError
from kratos_lite.verification.meshes import kind_of, nearest, short

ELEMENTS = (
    *(f"KinematicLinear3D{n}N" for n in (4, 5, 6, 8)), "EnhancedStrain3D8N", "BBar3D8N",
    *(f"KinematicLinear3D{n}N" for n in (10, 13, 15, 20, 27)), "Reduced3D20N",
    *(f"BBar3D{n}N" for n in (10, 13, 15, 20, 27)),
)  # fmt: skip
"""The elements of the library, in the order of the table."""
GRADES = ((0.02, "A"), (0.1, "B"), (0.2, "C"), (0.5, "D"))
"""Largest relative error of each grade, after MacNeal & Harder 1985; beyond the last it is F."""
PASS, FAIL, REFUSED = "pass", "FAIL", "refused"
Of = Callable[[str], bool]
"""Whether something holds for an element, by its name."""
Models = Callable[[str], Model | tuple[Model, ...]]
"""Returns one or several models of an element, by its name."""


def every(kind: str) -> bool:
    """Return True: the problem is for every element."""
    return True


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A quantity with a known value."""

    name: str  # family/problem
    quantity: str  # with its unit
    source: str  # a key of SOURCES, and where it stands in there
    reference: float  # errors are relative to it, or absolute where it is 0
    of: Callable[[str], float]  # takes the name of an element to the value
    tolerance: float | None = None  # up to which a row passes; all are graded without
    exact: Of = every  # elements that have to pass; others are graded
    takes: Of = every  # elements that it is for
    models: Models | None = None  # of a static problem: rows of the same ones share their results
    measure: Callable[..., float] | None = None  # takes these results to the value

    @property
    def cited(self) -> str:
        """The word of the source in `SOURCES`."""
        return self.source.replace(":", ",").partition(",")[0]

    def error(self, value: float) -> float:
        """Return how far a value is from the reference."""
        off = abs(value - self.reference) / (abs(self.reference) or 1.0)
        return off if isfinite(off) else inf

    def grade(self, value: float, element: str) -> str:
        """Return ``pass`` or ``FAIL`` where a tolerance holds, a letter elsewhere."""
        error = self.error(value)
        if self.tolerance is not None and self.exact(element):
            return PASS if error <= self.tolerance else FAIL
        return next((letter for limit, letter in GRADES if error <= limit * (1 + 1e-9)), "F")

    def elements(self, wanted: tuple[str, ...] = ELEMENTS) -> tuple[str, ...]:
        """Return those of some elements that the problem is for."""
        return tuple(filter(self.takes, wanted))

    def row(self, element: str) -> Row:
        """Find the value for an element; an error of the library becomes a row that fails."""
        try:
            value, note = float(self.of(element)), ""
        except KratosLiteError as error:
            value, note = float("nan"), str(error)
        except Exception as error:
            if element in ELEMENTS:
                raise
            raise InputError(
                f"{element} raises {type(error).__name__}: {error}, in {self.name}; "
                "'kratos-lite check' of its file says where"
            ) from error
        return Row(self, element, value, note=note)


def static(name: str, quantity: str, source: str, reference: float, models: Models,
           measure: Callable[..., float], tolerance: float | None = None,
           exact: Of = every, takes: Of = every) -> Problem:  # fmt: skip
    """Return a problem whose answer follows from the displacements of one or several models at rest."""
    return Problem(
        name=name, quantity=quantity, source=source, reference=reference, models=models, measure=measure,
        of=lambda element: measure(*solved(models, element)), tolerance=tolerance, exact=exact, takes=takes,
    )  # fmt: skip


def models_of(models: Models, element: str) -> tuple[Model, ...]:
    """Return the models of a problem for an element, one or several, as a tuple."""
    made = models(element)
    return (made,) if isinstance(made, Model) else made


@lru_cache(maxsize=1)
def solved(models: Models, element: str) -> tuple[Result, ...]:
    """Return the results of the models of a problem; others that have the same models share them."""
    return tuple(model.solve("direct") for model in models_of(models, element))


def stress_at(place: tuple[float, float, float], component: int) -> Callable[[Result], float]:
    """Return a function: a stress at the node at a place, a mean over the elements around it."""
    return lambda result: float(result.stress("averaged")[nearest(result.mesh, place), component])


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    problem: Problem
    element: str
    value: float
    others: dict[str, float] = field(default_factory=dict)  # what other programs find, by their names
    note: str = ""  # why there is no value

    @property
    def error(self) -> float:
        """How far the value is from the reference."""
        return self.problem.error(self.value)

    @property
    def grade(self) -> str:
        """``pass``, ``FAIL`` or a letter; ``refused`` where spurious modes of the element may spoil it."""
        if self.note:
            return REFUSED if kind_of(self.element).spurious_modes else FAIL
        return self.problem.grade(self.value, self.element)

    @property
    def failed(self) -> bool:
        """Whether a row that has to pass does not."""
        return self.grade == FAIL

    @property
    def kind(self) -> str:
        """Short name of the element, such as ``8N``."""
        return short(self.element)


def cell_is(*cells: str) -> Of:
    """Return whether an element has one of these cells."""
    return lambda kind: kind_of(kind).shape.cell in cells
