"""Problem: a question with a known answer; Row: what one element answers, and its grade."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from math import inf, isfinite
from typing import Any

from kratos_lite.analysis.model import Model
from kratos_lite.analysis.result import Result
from kratos_lite.errors import InputError, KratosLiteError
from kratos_lite.verification.meshes import kind_of, nearest, short
from kratos_lite.verification.scenes import Scene

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
Models = Callable[[str], "Model | tuple[Model, ...]"]
"""Returns one or several models of an element, by its name."""
Point = tuple[float, float, float]


def every(kind: str) -> bool:
    """Return True: something holds for every element."""
    return True


@dataclass(frozen=True)
class Problem:
    """A quantity with a known value, of one or several models at rest, or of an element alone."""

    name: str  # family/problem
    quantity: str  # with its unit
    source: str  # a key of SOURCES, and where it stands in there
    reference: float  # errors are relative to it, or absolute where it is 0
    models: Models | None  # problems with the same ones share their results
    measure: Callable[..., float]  # takes these results to the value; without models the name of an element
    tolerance: float | None = None  # up to which a row passes; all are graded without
    exact: Of = every  # elements that have to pass; others are graded
    takes: Of = every  # elements that it is for

    @property
    def cited(self) -> str:
        """The word of the source in `SOURCES`."""
        return self.source.replace(":", ",").partition(",")[0]

    def value(self, element: str) -> float:
        """Return the value for an element."""
        return self.measure(*(solved(self.models, element) if self.models else (element,)))

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
            return Row(self, element, float(self.value(element)))
        except KratosLiteError as error:
            return Row(self, element, float("nan"), note=str(error))
        except Exception as error:
            if element in ELEMENTS:
                raise
            raise InputError(
                f"{element} raises {type(error).__name__}: {error}, in {self.name}; "
                "'kratos-lite check' of its file says where"
            ) from error


def models_of(scene: Callable[..., Scene], *words: Any, **options: Any) -> Models:
    """Return what makes the model of a scene, given all but its element."""
    return lambda element: scene(element, *words, **options).model


def as_tuple(models: Model | tuple[Model, ...]) -> tuple[Model, ...]:
    """Return one or several models as a tuple."""
    return models if isinstance(models, tuple) else (models,)


@lru_cache(maxsize=1)
def solved(models: Models, element: str) -> tuple[Result, ...]:
    """Return the results of the models of a problem; others that have the same models share them."""
    return tuple(model.solve("direct") for model in as_tuple(models(element)))


def displacement_at(place: Point, axis: int, scale: float = 1.0) -> Callable[[Result], float]:
    """Return what measures a displacement at the node at a place, times a scale."""
    return lambda result: scale * float(result.u[nearest(result.mesh, place), axis])


def stress_at(place: Point, component: int, scale: float = 1.0) -> Callable[[Result], float]:
    """Return what measures a stress at the node at a place, a mean over the elements around it."""
    return lambda result: scale * float(result.stress("averaged")[nearest(result.mesh, place), component])


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
