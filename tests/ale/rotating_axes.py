"""An annulus in plane strain in axes that turn with its material: references for rotors, without ALE.

In these axes the displacement w has Coriolis and centrifugal terms, and a load fixed in space travels around:

    M (w'' + 2 Ω A w' + (Ω' A + Ω² A²) w) + K w = f

With n waves around, w = ŵ(r) e^{i n φ} in polar components, and polynomials stand for ŵ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss, legval, legvander

from kratos_lite.materials import LinearMaterial
from kratos_lite.typing import Array, Complexes

INNER, OUTER = 0.3, 1.0
DEGREE = 10
TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
"""A in polar components: the material turns clockwise."""


@dataclass
class Waves:
    """The matrices of n waves around a rotor whose hub is clamped, per radian and meter of thickness.

    Attributes
    ----------
    n : number of waves.
    K, M, MA : stiffness, mass and mass times A (2m, 2m), all radial unknowns before all tangential ones.
    rim : (m,) values of the polynomials on the rim.
    """

    n: int
    K: Complexes
    M: Array
    MA: Array
    rim: Array

    def push(self, pressure: float) -> Array:
        """Return the load (2m,) of an inward pressure on the rim."""
        return np.concatenate([-pressure * OUTER * self.rim, 0 * self.rim])

    def on_rim(self, w: Complexes) -> tuple[complex, complex]:
        """Return the radial and tangential amplitude on the rim."""
        m = len(self.rim)
        return complex(self.rim @ w[:m]), complex(self.rim @ w[m:])

    def frequencies(self, rate: float) -> Array:
        """Return those in space: λ in space = λ in the axes + i n rate, ascending."""
        left = self.K - rate**2 * self.M
        zero, unit = np.zeros_like(self.M), np.eye(len(self.M))
        own = np.linalg.solve(self.M, np.hstack([-left, -2 * rate * self.MA]))
        values = np.linalg.eigvals(np.vstack([np.hstack([zero, unit]), own]))
        return np.sort(values.imag + self.n * rate)

    def steady(self, rate: float, pressure: float, damping: float) -> tuple[complex, complex]:
        """Return the answer on the rim to a pressure fixed in space, which travels with -i n rate."""
        value = -1j * self.n * rate
        left = (value**2 - rate**2 + damping * value) * self.M + (2 * value + damping) * rate * self.MA
        return self.on_rim(np.asarray(np.linalg.solve(left + self.K, self.push(pressure)), dtype=complex))


def waves(n: int, material: LinearMaterial) -> Waves:
    """Return the matrices of n waves around in a material, by polynomials that vanish on the hub."""
    s, weights = leggauss(DEGREE + 4)
    half = (OUTER - INNER) / 2
    r, weights = INNER + half * (s + 1), weights * half
    V = legvander(s, DEGREE - 1)
    slopes = np.array([legval(s, np.polynomial.legendre.legder(row)) for row in np.eye(DEGREE)]).T
    N, dN = V * (1 + s)[:, None], (V + slopes * (1 + s)[:, None]) / half
    around, zero = 1j * n * N / r[:, None], np.zeros_like(N)
    radial = np.stack([dN, N / r[:, None], around], axis=1)
    tangential = np.stack([zero, around, dN - N / r[:, None]], axis=1)
    B, weights = np.concatenate([radial, tangential], axis=2), weights * r
    C = material.C[np.ix_([0, 1, 3], [0, 1, 3])]
    mass = material.density * (N.T * weights) @ N
    return Waves(
        n=n,
        K=np.einsum("gai,ab,gbj,g->ij", B.conj(), C, B, weights),
        M=np.asarray(np.kron(np.eye(2), mass), dtype=float),
        MA=np.asarray(np.kron(TURN, mass), dtype=float),
        rim=np.full(DEGREE, 2.0),
    )
