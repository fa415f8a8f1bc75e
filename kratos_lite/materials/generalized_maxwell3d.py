"""GeneralizedMaxwell3D: linear viscoelasticity by a Prony series."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kratos_lite.errors import MaterialError
from kratos_lite.materials.isotropic_law import IsotropicLaw
from kratos_lite.materials.material import GaussState, Response
from kratos_lite.typing import Array


@dataclass(frozen=True)
class GeneralizedMaxwell3D(IsotropicLaw):
    """Elastic at once, and relaxing with time: C(t) = C (1 - Σ w_i (1 - exp(-t / τ_i))).

    Parameters
    ----------
    E, nu : Young's modulus in Pa at once, and Poisson's ratio.
    w1, tau1, w2, tau2, w3, tau3 : fractions of the stiffness that relax, 0 ≤ Σ w ≤ 1, and times in s, > 0.
    density : kg/m³.
    alpha : thermal expansion in 1/K; see `Temperature`.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds.

    Notes
    -----
    Stresses of Maxwell elements h_i, exact for strains that are linear over a step:
    h⁺ = e h + w τ/Δt (1 - e) C Δε with e = exp(-Δt / τ).  Source: Simo & Hughes, Computational Inelasticity
    (1998), section 10.3.

    Examples
    --------
    >>> glue = GeneralizedMaxwell3D(E=1e9, nu=0.3, w1=0.5, tau1=10.0)
    >>> pull = np.array([1e-3, 0, 0, 0, 0, 0])
    >>> stress, _, state = glue.evaluate(pull, glue.initial_state(), 1e-9)
    >>> later, _, _ = glue.evaluate(pull, state, 10.0)
    >>> print(f"{later[0] / stress[0]:.4f}")  # 1 - ½ (1 - 1/e)
    0.6839
    """

    E: float
    nu: float
    w1: float
    tau1: float
    w2: float = 0.0
    tau2: float = 1.0
    w3: float = 0.0
    tau3: float = 1.0
    density: float = 0.0
    alpha: float = 0.0

    rate_dependent: ClassVar[bool] = True
    internal_variables: ClassVar[Mapping[str, int]] = {
        "last_strain": 6,
        "maxwell_stress_1": 6,
        "maxwell_stress_2": 6,
        "maxwell_stress_3": 6,
    }

    def check(self) -> None:
        """Check fractions and times."""
        super().check()
        weights = [w for w, _ in self.terms]
        if min(weights) < 0 or sum(weights) > 1:
            raise MaterialError(f"the fractions w must be ≥ 0, and their sum ≤ 1; got {weights}")
        for i, (_, tau) in enumerate(self.terms, start=1):
            if not tau > 0:
                raise MaterialError(f"tau{i} {tau:g} must be > 0 s")

    @property
    def terms(self) -> tuple[tuple[float, float], ...]:
        """Fraction w and time τ in s of each Maxwell element."""
        return (self.w1, self.tau1), (self.w2, self.tau2), (self.w3, self.tau3)

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return stress, tangent and internal variables; see `Material.response`."""
        C = self.elastic.C
        step = (strain - state["last_strain"]) @ C.T
        kept = 1 - sum(w for w, _ in self.terms)
        stress, new = kept * strain @ C.T, {"last_strain": strain.copy()}
        for i, (w, tau) in enumerate(self.terms, start=1):
            decay = np.exp(-dt / tau)
            rate = w * (-np.expm1(-dt / tau) * tau / dt if dt > 0 else 1.0)
            new[f"maxwell_stress_{i}"] = decay * state[f"maxwell_stress_{i}"] + rate * step
            stress, kept = stress + new[f"maxwell_stress_{i}"], kept + rate
        return stress, kept * C, new

    def energy(self, strain: Array, stress: Array, state: GaussState) -> Array:
        """Return the energy of all springs; see `Material.energy`."""
        S = np.linalg.inv(self.elastic.C)
        total = (1 - sum(w for w, _ in self.terms)) * (strain @ np.linalg.inv(S) * strain).sum(axis=-1) / 2
        for i, (w, _) in enumerate(self.terms, start=1):
            if w:
                h = state[f"maxwell_stress_{i}"]
                total = total + (h @ S * h).sum(axis=-1) / (2 * w)
        return np.asarray(total)
