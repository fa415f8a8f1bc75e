"""The generalized-α family: Newmark, Hilber–Hughes–Taylor, Wood–Bossak–Zienkiewicz and Chung–Hulbert.

It takes M a at t⁺ - αm h, and C v + K u - f at t⁺ - αf h, with Newmark's formulas

    a⁺ = (Δu - h v) / (β h²) - (1/(2β) - 1) a,    v⁺ = v + h ((1 - γ) a + γ a⁺)

Source: Chung & Hulbert, J. Appl. Mech. 60 (1993) 371-375; Hilber, Hughes & Taylor, Earthq. Eng. Struct. Dyn.
5 (1977) 283-292; Wood, Bossak & Zienkiewicz, Int. J. Numer. Meth. Eng. 15 (1980) 1562-1566; Newmark, J. Eng.
Mech. Div. ASCE 85 (1959) 67-94.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.integrators.base import ModelIntegrator
from kratos_lite.analysis.prescribed_motion import Kinematics
from kratos_lite.errors import InputError
from kratos_lite.typing import Array
from kratos_lite.validation import number


class NewmarkNumbers(NamedTuple):
    """The numbers β, γ, αm and αf of a generalized-α method."""

    beta: float
    gamma: float
    alpha_m: float
    alpha_f: float


class _Implicit(ModelIntegrator):
    """A generalized-α method by its four numbers."""

    @abstractmethod
    def numbers(self) -> NewmarkNumbers:
        """Return β, γ, αm and αf."""

    @property
    def balanced(self) -> bool:
        """Whether it is the trapezoidal rule."""
        return self.numbers() == (0.25, 0.5, 0.0, 0.0)

    def step(self, e: EquationsOfMotion, now: Kinematics, start: float, h: float) -> Kinematics:
        """Take a step, for the increment of the displacement."""
        s = self.numbers()
        (u, v, a), end, f = now, start + h, 1 - s.alpha_f
        v_new, a_new = _newmark(s, h, 0.0, v, a)
        at_start, more_a = e.prescribed.part(u), 0.0 * a
        if e.model.supports.motions:
            g_end, v_end, a_end = e.prescribed.at_end(end, h)
            by_newmark = _newmark(s, h, g_end - at_start, e.prescribed.part(v), e.prescribed.part(a))
            more_a = a_end - by_newmark[1]
            v_new, a_new = v_new + v_end - by_newmark[0], a_new + more_a
        middle = start + f * h
        force = e.load(middle) - e.times_stiffness(u, middle)
        force -= e.times_damping(f * v_new + s.alpha_f * v, middle)
        if self.balanced:  # M a is known from the balance at the start, so no rounding is handed on
            force += e.mass.times(4 / h * v - more_a) + e.load(start)
            force -= e.times_stiffness(u, start) + e.times_damping(v, start)
        else:
            force += e.mass.times(-(1 - s.alpha_m) * a_new - s.alpha_m * a)
        solve = e.solver(middle, (1 - s.alpha_m) / (s.beta * h * h), f * s.gamma / (s.beta * h), f, h)
        du = solve(force, e.prescribed(end) - at_start, h * v + h * h / 2 * a)
        return u + du, s.gamma / (s.beta * h) * du + v_new, du / (s.beta * h * h) + a_new


@dataclass(frozen=True)
class Newmark(_Implicit):
    """Newmark's method; the trapezoidal rule if nothing is given: order 2, no dissipation.

    Parameters
    ----------
    beta, gamma : stable for any step where γ ≥ 1/2 and β ≥ γ/2.

    Raises
    ------
    InputError
        It is not stable for any step.

    Examples
    --------
    >>> str(Newmark())
    'newmark(0.25, 0.5)'
    """

    beta: float = 0.25
    gamma: float = 0.5
    name = "newmark"

    def __post_init__(self) -> None:
        beta, gamma = number(self.beta, "Newmark's β"), number(self.gamma, "Newmark's γ")
        if not (gamma >= 0.5 and beta > 0 and 2 * beta >= gamma):
            swapped = beta >= 0.5 and beta <= 2 * gamma
            cure = "are they swapped?" if swapped else "take CentralDifference() for an explicit integrator"
            raise InputError(
                f"Newmark's method is stable for γ ≥ 1/2 and β ≥ γ/2; got β = {beta}, γ = {gamma}: {cure}"
            )

    def numbers(self) -> NewmarkNumbers:
        """Return β, γ, 0 and 0."""
        return NewmarkNumbers(float(self.beta), float(self.gamma), 0.0, 0.0)


@dataclass(frozen=True)
class HHT(_Implicit):
    """The method of Hilber, Hughes and Taylor: order 2, high frequencies die out.

    Parameters
    ----------
    alpha : -1/3 ≤ α ≤ 0; 0 is the trapezoidal rule.

    Raises
    ------
    InputError
        α lies beyond its bounds.
    """

    alpha: float = -0.05
    name = "hht"

    def __post_init__(self) -> None:
        _check_alpha(self.alpha, "HHT")

    def numbers(self) -> NewmarkNumbers:
        """Return (1 - α)²/4, 1/2 - α, 0 and -α."""
        return NewmarkNumbers((1 - self.alpha) ** 2 / 4, 0.5 - self.alpha, 0.0, -self.alpha)


@dataclass(frozen=True)
class Bossak(_Implicit):
    """The method of Wood, Bossak and Zienkiewicz: order 2, high frequencies die out.

    It takes (1 - α) M a⁺ + α M a with γ = 1/2 - α and β = (1 - α)²/4, as Kratos does.

    Parameters
    ----------
    alpha : -1/3 ≤ α ≤ 0; 0 is the trapezoidal rule.

    Raises
    ------
    InputError
        α lies beyond its bounds.

    Examples
    --------
    >>> Bossak().numbers().gamma
    0.8
    """

    alpha: float = -0.3
    name = "bossak"

    def __post_init__(self) -> None:
        _check_alpha(self.alpha, "Bossak")

    def numbers(self) -> NewmarkNumbers:
        """Return (1 - α)²/4, 1/2 - α, α and 0."""
        return NewmarkNumbers((1 - self.alpha) ** 2 / 4, 0.5 - self.alpha, self.alpha, 0.0)


@dataclass(frozen=True)
class GeneralizedAlpha(_Implicit):
    """The method of Chung and Hulbert: order 2, the highest frequencies shrink by ρ∞ a step.

    Parameters
    ----------
    rho_inf : 0 ≤ ρ∞ ≤ 1; 1 has no dissipation.

    Raises
    ------
    InputError
        ρ∞ lies beyond its bounds.
    """

    rho_inf: float = 0.8
    name = "generalized_alpha"

    def __post_init__(self) -> None:
        if not 0 <= number(self.rho_inf, "the ρ∞ of the generalized-α method") <= 1:
            raise InputError(f"ρ∞ of the generalized-α method lies in 0 … 1; got {self.rho_inf}")

    def numbers(self) -> NewmarkNumbers:
        """Return the four numbers of order 2 with the dissipation ρ∞."""
        m, f = (2 * self.rho_inf - 1) / (self.rho_inf + 1), self.rho_inf / (self.rho_inf + 1)
        return NewmarkNumbers((1 - m + f) ** 2 / 4, 0.5 - m + f, m, f)


def _check_alpha(alpha: float, name: str) -> None:
    if not -1 / 3 <= number(alpha, f"the α of {name}") <= 0:
        raise InputError(f"the α of {name} lies in -1/3 … 0; got {alpha}")


def _newmark(s: NewmarkNumbers, h: float, du: Array | float, v: Array, a: Array) -> tuple[Array, Array]:
    """Return v⁺ and a⁺ by Newmark's formulas, (3a,)."""
    v_new = (1 - s.gamma / s.beta) * v + h * (1 - s.gamma / (2 * s.beta)) * a
    a_new = -v / (s.beta * h) - (1 / (2 * s.beta) - 1) * a
    return v_new + s.gamma / (s.beta * h) * du, a_new + du / (s.beta * h * h)
