"""Estimates of the error of a result, in the energy norm and of a quantity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from kratos_lite.model.loads import Load
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array


class Origin(Protocol):
    """What a result is the solution of."""

    @property
    def model(self) -> Structure:
        """The structure, as it was solved."""

    @property
    def loads(self) -> Sequence[Load]:
        """Its loads."""

    def adjoint(self, load: Array, motion: Array) -> Array:
        """Return the displacement (n, 3) under a load alone, with supports displaced by a motion alone."""


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """How far a result is from the exact solution, in the energy norm ‖e‖² = ∫ e : C : e dV.

    `Result.error` makes it.

    Attributes
    ----------
    absolute : ‖e‖ of the whole model in √J.
    relative : ‖e‖ / ‖u‖, with ‖u‖ of the exact solution as the estimate has it.
    per_element : (m,) ‖e‖ of each element in √J; the root of the sum of their squares is `absolute`.
    method : how it was found: ``"recovery"`` or ``"equilibrated"``.
    warnings : why it cannot be trusted; empty where nothing speaks against it.
    """

    absolute: float
    relative: float
    per_element: Array
    method: str = "recovery"
    warnings: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return f"{self.relative:.2%} ({self.absolute:.4e} √J, {self.method})"


@dataclass(frozen=True, eq=False)
class QuantityError:
    """How far a quantity of a result is from that of the exact solution: Q(u) - Q(u_h).

    `Result.error` makes it.

    Attributes
    ----------
    value : Q(u_h), in its unit.
    signed : the best guess of Q(u) - Q(u_h); value + signed is a better value.
    bound : the sum of the sizes of what the elements contribute: what the error is if nothing cancels.  No
        proof makes it an upper bound.
    per_element : (m,) what each element contributes to `signed`.
    unit : of all these.
    warnings : why it cannot be trusted; empty where nothing speaks against it.
    """

    value: float
    signed: float
    bound: float
    per_element: Array
    unit: str
    warnings: list[str] = field(default_factory=list)

    @property
    def absolute(self) -> float:
        """Size of the best guess."""
        return abs(self.signed)

    @property
    def relative(self) -> float:
        """Size of the best guess over that of the better value; 0 where both are 0."""
        return self.absolute / abs(self.value + self.signed) if self.signed else 0.0

    def __str__(self) -> str:
        return f"{self.signed:+.3e} {self.unit}, at most about ±{self.bound:.1e} (value {self.value:.6e})"
