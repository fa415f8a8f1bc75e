"""Schemes of transient dynamics: one family of implicit ones, and central differences.

The generalized-α method takes M a at t⁺ - αm h, and C v + K u - f at t⁺ - αf h, with Newmark's formulas

    a⁺ = (Δu - h v) / (β h²) - (1/(2β) - 1) a,    v⁺ = v + h ((1 - γ) a + γ a⁺)

Source: Chung & Hulbert, J. Appl. Mech. 60 (1993) 371-375; Hilber, Hughes & Taylor, Earthq. Eng. Struct. Dyn.
5 (1977) 283-292; Wood, Bossak & Zienkiewicz, Int. J. Numer. Meth. Eng. 15 (1980) 1562-1566; Newmark, J. Eng.
Mech. Div. ASCE 85 (1959) 67-94.
"""

from __future__ import annotations

from dataclasses import dataclass

from kratos_lite.errors import InputError
from kratos_lite.validation import number


@dataclass(frozen=True)
class Implicit:
    """A generalized-α method by its four numbers; see `newmark`, `hht`, `bossak` and `generalized_alpha`."""

    name: str
    beta: float
    gamma: float
    alpha_m: float = 0.0
    alpha_f: float = 0.0


@dataclass(frozen=True)
class CentralDifference:
    """Central differences (velocity Verlet) with lumped mass: explicit, stable for steps below 2/ω."""

    name: str = "central_difference"


def newmark(beta: float = 0.25, gamma: float = 0.5) -> Implicit:
    """Return Newmark's method; the trapezoidal rule if nothing is given: order 2, no dissipation.

    >>> newmark().name
    'newmark(0.25, 0.5)'
    """
    beta, gamma = number(beta, "Newmark's β"), number(gamma, "Newmark's γ")
    if not (gamma >= 0.5 and beta > 0 and 2 * beta >= gamma):
        raise InputError(
            f"Newmark's method is stable for γ ≥ 1/2 and β ≥ γ/2; got β = {beta}, γ = {gamma}: "
            "take CentralDifference() for an explicit scheme"
        )
    return Implicit(f"newmark({beta:g}, {gamma:g})", beta, gamma)


def hht(alpha: float = -0.05) -> Implicit:
    """Return the method of Hilber, Hughes and Taylor, -1/3 ≤ α ≤ 0: order 2, high frequencies die out."""
    alpha = number(alpha, "the α of HHT")
    if not -1 / 3 <= alpha <= 0:
        raise InputError(f"the α of HHT lies in -1/3 … 0; got {alpha}")
    return Implicit(f"hht({alpha:g})", (1 - alpha) ** 2 / 4, 0.5 - alpha, 0.0, -alpha)


def bossak(alpha: float = -0.3) -> Implicit:
    """Return the method of Wood, Bossak and Zienkiewicz, -1/3 ≤ α ≤ 0: order 2, high frequencies die out.

    It takes (1 - α) M a⁺ + α M a with γ = 1/2 - α and β = (1 - α)²/4, as Kratos does.

    >>> bossak().gamma
    0.8
    """
    alpha = number(alpha, "the α of Bossak")
    if not -1 / 3 <= alpha <= 0:
        raise InputError(f"the α of Bossak lies in -1/3 … 0; got {alpha}")
    return Implicit(f"bossak({alpha:g})", (1 - alpha) ** 2 / 4, 0.5 - alpha, alpha)


def generalized_alpha(rho_inf: float = 0.8) -> Implicit:
    """Return the generalized-α method whose highest frequencies shrink by ρ∞ (0 … 1) a step: order 2."""
    rho_inf = number(rho_inf, "the ρ∞ of the generalized-α method")
    if not 0 <= rho_inf <= 1:
        raise InputError(f"ρ∞ of the generalized-α method lies in 0 … 1; got {rho_inf}")
    m, f = (2 * rho_inf - 1) / (rho_inf + 1), rho_inf / (rho_inf + 1)
    return Implicit(f"generalized_alpha({rho_inf:g})", (1 - m + f) ** 2 / 4, 0.5 - m + f, m, f)
