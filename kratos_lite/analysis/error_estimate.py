"""Estimate of the error of a result in the energy norm."""

from __future__ import annotations

from dataclasses import dataclass, field

from kratos_lite.typing import Array


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """How far a result is from the exact solution, in the energy norm ‖e‖² = ∫ e : C : e dV.

    `Result.error` makes it.

    Attributes
    ----------
    absolute : ‖e‖ of the whole model in √J.
    relative : ‖e‖ / ‖u‖, with ‖u‖ of the exact solution as the estimate has it.
    per_element : (m,) ‖e‖ of each element in √J; the root of the sum of their squares is `absolute`.
    method : how it was found: ``"recovery"``.
    warnings : why it cannot be trusted; empty where nothing speaks against it.
    """

    absolute: float
    relative: float
    per_element: Array
    method: str = "recovery"
    warnings: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return f"{self.relative:.2%} ({self.absolute:.4e} √J, {self.method})"
