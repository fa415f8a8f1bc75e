"""IsotropicDamage3D: brittle softening whose dissipated energy does not depend on the mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kratos_lite.errors import MaterialError
from kratos_lite.materials.isotropic_law import ELASTIC, IsotropicLaw
from kratos_lite.materials.material import GaussState, Response
from kratos_lite.typing import Array


@dataclass(frozen=True)
class IsotropicDamage3D(IsotropicLaw):
    """σ = (1 - d) C ε; damage d grows with the largest √(ε:C:ε) so far, exponentially or linearly.

    Each element dissipates the fracture energy over its length, the cube root of its volume.

    Parameters
    ----------
    E, nu : Young's modulus in Pa and Poisson's ratio.
    strength : stress in Pa at which a bar begins to soften, > 0.
    fracture_energy : J/m², > 0.
    linear : 1 for linear softening, 0 for exponential one.
    density : kg/m³.
    alpha : thermal expansion in 1/K; see `Temperature`.

    Raises
    ------
    MaterialError
        If a constant lies outside its bounds, or an element is longer than 2 E G_f / strength².

    Notes
    -----
    Sources: Simo & Ju, Int. J. Solids Struct. 23 (1987) 821; Oliver, Cervera, Oller & Lubliner, 2nd Int.
    Conf. Computer Aided Analysis and Design of Concrete Structures (1990) 945.

    Examples
    --------
    >>> concrete = IsotropicDamage3D(E=30e9, nu=0.2, strength=3e6, fracture_energy=100.0)
    >>> start = concrete.initial_state()
    >>> start["element_length"][:] = 0.1
    >>> stress, _, state = concrete.evaluate(np.array([2e-4, 0, 0, 0, 0, 0]), start, 1.0)
    >>> bool(0 < state["damage"][0] < 1)
    True
    """

    E: float
    nu: float
    strength: float
    fracture_energy: float
    linear: float = 0.0
    density: float = 0.0
    alpha: float = 0.0

    positive: ClassVar[Mapping[str, str]] = {"strength": "Pa", "fracture_energy": "J/m²"}
    variables: ClassVar[dict[str, str]] = ELASTIC | {
        "strength": "YIELD_STRESS",
        "fracture_energy": "FRACTURE_ENERGY",
    }
    internal_variables: ClassVar[Mapping[str, int]] = {"damage": 1, "threshold": 1, "element_length": 1}

    def check(self) -> None:
        """Check that softening is linear or exponential."""
        super().check()
        if self.linear not in (0, 1):
            text = "linear is 1 for linear softening or 0 for exponential one"
            raise MaterialError(f"{text}; got {self.linear:g}")

    def response(self, strain: Array, state: GaussState, dt: float) -> Response:
        """Return stress, tangent and internal variables; see `Material.response`."""
        effective = strain @ self.elastic.C.T
        norm, gradient, first = self._equivalent(strain, effective)
        old = np.maximum(state["threshold"][..., 0], first)
        r, (size,) = np.maximum(norm, old), self.internal_variables.keys() - {"damage", "threshold"}
        d, slope = self._damage(r / first, state[size][..., 0])
        growing = (norm > old) & (d > 0)
        rate = np.where(growing, slope / first, 0.0)
        D = (1 - d)[..., None, None] * self.elastic.C
        D = D - rate[..., None, None] * effective[..., :, None] * gradient[..., None, :]
        new = {"damage": d[..., None], "threshold": r[..., None], size: state[size].copy()}
        return (1 - d)[..., None] * effective, D, new

    def energy(self, strain: Array, stress: Array, state: GaussState) -> Array:
        """Return ½ σ:ε; see `Material.energy`."""
        return np.asarray((strain * stress).sum(axis=-1) / 2)

    def _equivalent(self, strain: Array, effective: Array) -> tuple[Array, Array, float]:
        """Return what damages (...), its derivative by the strain (..., 6), and where a bar softens."""
        norm = np.sqrt((strain * effective).sum(axis=-1))
        return norm, effective / np.where(norm > 0, norm, 1.0)[..., None], self.strength / self.E**0.5

    def _damage(self, x: Array, length: Array) -> tuple[Array, Array]:
        """Return d and its slope at thresholds x ≥ 1 relative to the first one, of elements of a length."""
        ductility = self.fracture_energy * self.E / self.strength**2 / np.where(length > 0, length, np.inf)
        ductility = np.where(length > 0, ductility, np.inf)  # without a length: no softening, as at a point
        brittle = ductility <= 0.5
        if brittle.any():
            longest = 2 * self.fracture_energy * self.E / self.strength**2
            raise MaterialError(
                f"{type(self).__name__}: an element of {float(length.max()):.3g} m is longer than 2 E G_f / "
                f"strength² = {longest:.3g} m, and would snap back; take a finer mesh there"
            )
        if self.linear:
            end = 2 * ductility  # x at which no stress is left
            left = np.where(np.isinf(end), 1.0, (end - x) / np.where(np.isinf(end), 1.0, end - 1))
            d = np.where(left > 0, 1 - np.maximum(left, 0.0) / x, 1.0)
            drop = np.where(np.isinf(end), 0.0, 1 / np.where(np.isinf(end), 1.0, end - 1))
            return d, np.where(left > 0, left / x**2 + drop / x, 0.0)
        A = 1 / (ductility - 0.5)
        kept = np.exp(A * (1 - x)) / x
        return 1 - kept, kept * (1 / x + A)
