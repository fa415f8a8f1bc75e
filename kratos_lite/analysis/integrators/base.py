"""What the stepping loop asks of an integrator; each kind is found by its name, so a new one is one file.

An integrator of models is a class that registers itself by its `name`.  One of bodies registers itself by the
word that a body holds (`body.integrator`) and the class of bodies that it advances.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager, nullcontext
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.prescribed_motion import Kinematics
from kratos_lite.bodies.body import Body
from kratos_lite.errors import InputError
from kratos_lite.registry import Registry
from kratos_lite.tabular import names_of
from kratos_lite.typing import Array

INTEGRATORS: Registry[type[ModelIntegrator]] = Registry("integrator")
"""Integrators of models by name."""
BODY_INTEGRATORS: dict[tuple[type[Body], str], type[BodyIntegrator[Any]]] = {}
"""Integrators of bodies by class of bodies and word."""

B = TypeVar("B", bound=Body)


class ModelIntegrator(ABC):
    """A way to take one step of the equations of motion of a model.

    Subclasses are frozen dataclasses whose fields are their numbers.
    """

    name: ClassVar[str]  # the word under which files find it
    lumps_mass: ClassVar[bool] = False  # whether it needs the mass in the nodes

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "name" in cls.__dict__:
            INTEGRATORS.add(cls.name, cls)

    @property
    def balanced(self) -> bool:
        """Whether M a + C v + K u = f holds at the end of each step."""
        return False

    def check(self, e: EquationsOfMotion) -> None:  # noqa: B027 (most take all models)
        """Raise ModelError for a model with something that the integrator does not take."""

    def critical_step(self, e: EquationsOfMotion) -> float:
        """Return the longest stable step in s, infinite if any step is stable."""
        return np.inf

    @abstractmethod
    def step(self, e: EquationsOfMotion, now: Kinematics, start: float, h: float) -> Kinematics:
        """Return displacement, velocity and acceleration (3a,) h s after those at the time `start` in s."""

    def __str__(self) -> str:
        numbers = [f"{getattr(self, name):g}" for name in names_of(type(self))]
        return f"{self.name}({', '.join(numbers)})" if numbers else self.name


class BodyIntegrator(ABC, Generic[B]):
    """A way to take one step of a body."""

    name: ClassVar[str]  # the word that bodies hold
    bodies: ClassVar[type[Body]]  # that it advances

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "name" in cls.__dict__:
            BODY_INTEGRATORS[cls.bodies, cls.name] = cls
            if cls.name not in cls.bodies.integrators:
                cls.bodies.integrators = {**cls.bodies.integrators, cls.name: ""}

    def critical_step(self, body: B) -> float:
        """Return the longest stable step in s at the configuration of a body."""
        return np.inf

    def check(self, body: B, h: float) -> None:
        """Log what may go wrong with steps of h s."""

    def check_stable(self, body: B, h: float) -> None:
        """Raise InputError if steps of h s are longer than the critical one."""
        check_stable(f"the {self.name} integrator", h, self.critical_step(body), "an implicit integrator")

    def running(self) -> AbstractContextManager[Any]:
        """Return the context in which steps are taken."""
        return nullcontext()

    def free_steps(self, body: B, h: float, count: int) -> bool:
        """Take steps under constant loads, without constraints, all at once; False if it cannot."""
        return False

    @abstractmethod
    def step(self, body: B, h: float, v: Array) -> Array:
        """Advance a body by h s, loaded as by the velocity v; return the load (..., dofs) at the middle."""

    def finish(self, body: B) -> None:
        """Bring the end of a step to what the body can represent."""


def body_integrator(body: Body) -> BodyIntegrator[Any]:
    """Return the integrator that a body names.

    >>> import kratos_lite as kl
    >>> body_integrator(kl.FixedBody(kl.box())).name
    'uniform'
    """
    for kind in type(body).__mro__:
        if (kind, body.integrator) in BODY_INTEGRATORS:
            return BODY_INTEGRATORS[kind, body.integrator]()
    raise InputError(f"no integrator {body.integrator!r} is registered for {type(body).__name__}")


def check_stable(what: str, h: float, critical: float, cure: str) -> None:
    """Raise InputError if steps of h s are longer than the critical one."""
    if h > critical * (1 + 1e-9):
        raise InputError(
            f"{what} is not stable with steps of {h:g} s: the critical step is {critical:.4g} s; "
            f"take a shorter step, substeps='auto', or {cure}"
        )
