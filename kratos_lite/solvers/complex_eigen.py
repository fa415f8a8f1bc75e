"""Complex modes: eigenvalues of λ² M + λ C + K nearest to 0, from a space that begins with real modes.

Motions that K and C do not resist are taken out first: their eigenvalue 0 stands twice with one shape, so
that rounding would spoil it by its square root.

Sources: Tisseur & Meerbergen, SIAM Review 43 (2001) 235-286; Fan, Lin & Van Dooren, SIAM J. Matrix Anal.
Appl. 26 (2004) 252-256, for the scale of λ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.solvers.eigen import (
    EPS,
    TOLERANCE,
    check_residuals,
    first_shift,
    lengths_of,
    not_converged,
    orthonormal,
)
from kratos_lite.solvers.plan import DENSE_MODES
from kratos_lite.typing import Array, Complexes, Csr

EXPANSIONS = 60
"""Times that the space of complex modes grows; more do not converge."""
ROUNDED = 1e-8
"""Length that a vector of length 1 has left without the span of others, below which it is rounding."""
SMALL = 1e-6
"""Fraction of the largest |λ| requested below which one counts as 0."""
NEUTRAL = 1e-11
"""Fraction of the stiffness up to which a motion is not resisted at all."""


@dataclass(frozen=True)
class Pencil:
    """λ² M + λ C + K, sparse (n, n), and the motions (n, k) that neither C nor K resists.

    M is symmetric positive definite; C and K need not be symmetric.  The motions are columns with
    φ^T M φ = 1, as `unresisted_modes` makes them.
    """

    M: Csr
    C: Csr
    K: Csr
    rigid: Array
    start: Callable[[int], Array]  # makes of a number so many real modes (k, n), and rigid motions
    precondition: Callable[[Array], Array]  # about K⁻¹, of vectors (k, n)

    def modes(self, count: int) -> tuple[Complexes, Complexes]:
        """Return λ (count,) in 1/s, nearest to 0 first, and shapes (n, count) of length 1."""
        n, zeros = self.K.shape[0], 2 * self.rigid.shape[1]
        if count > 2 * n:
            raise InputError(f"this model has 1 … {2 * n} complex modes; got {count}")
        values = np.zeros(zeros, dtype=complex)
        shapes = np.repeat(self.rigid, 2, axis=1).astype(complex)
        whole = True
        if (further := count - zeros) > 0:
            whole = 2 * n <= DENSE_MODES or further > n // 4
            elastic, vectors = self._all() if whole else self._nearest(further)
            order = np.argsort(np.abs(elastic), kind="stable")[:further]
            values, shapes = np.append(values, elastic[order]), np.hstack([shapes, vectors[:, order]])
        values, shapes = values[:count], shapes[:, :count]
        shapes = shapes / np.linalg.norm(shapes, axis=0)
        self.check(values, shapes, energies=not whole)
        return values, shapes

    def check(self, values: Complexes, shapes: Complexes, energies: bool = False) -> None:
        """Raise SolveError unless all pairs satisfy the equations, or their products with the shapes."""
        terms = [(values**2, self.M), (values, self.C), (np.ones_like(values), self.K)]
        check_residuals(terms, shapes, energies)

    def _all(self) -> tuple[Complexes, Complexes]:
        """Return all eigenvalues but those of the rigid modes, from dense matrices."""
        Q: Array = np.eye(self.K.shape[0])
        if k := self.rigid.shape[1]:
            Q = np.linalg.qr(self.M @ self.rigid, mode="complete")[0][:, k:]
        values, vectors = _all_values(*(Q.T @ (A @ Q) for A in (self.M, self.C, self.K)))
        return values, Q @ vectors

    def _nearest(self, count: int) -> tuple[Complexes, Complexes]:
        """Return eigenvalues nearest to 0, from a space that grows by what the residuals miss."""
        # It begins with real modes, two for each pair of complex ones.
        V = self._independent(self.start(count), np.zeros((0, self.K.shape[0])))
        roundoff = 10 * EPS * float(abs(self.K).sum(axis=0).max())
        for _ in range(EXPANSIONS):
            products = [(A @ V.T).T for A in (self.M, self.C, self.K)]
            values, Y = _all_values(*(V @ AV.T for AV in products))
            chosen = np.argsort(np.abs(values), kind="stable")[:count]
            values, Y = values[chosen], Y[:, chosen].T
            MV, CV, KV = products
            residual = values[:, None] ** 2 * (Y @ MV) + values[:, None] * (Y @ CV) + Y @ KV
            W = [self.precondition(part) for part in (residual.real, residual.imag)]
            energies = (residual.real * W[0] + residual.imag * W[1]).sum(axis=1)
            sizes = (np.abs(values) + SMALL * np.abs(values).max()) ** 2
            errors = np.abs(energies) / (sizes * (np.abs(Y) ** 2).sum(axis=1))
            errors[np.linalg.norm(residual, axis=1) <= roundoff * np.linalg.norm(Y @ V, axis=1)] = 0.0
            wrong = (errors > TOLERANCE**1.5) & (values.imag >= 0)  # conjugates span the same
            if not wrong.any():
                return values, (Y @ V).T
            V = np.vstack([V, self._independent(np.vstack([part[wrong] for part in W]), V)])
        raise not_converged(count)

    def _independent(self, W: Array, V: Array) -> Array:
        """Return vectors (k, n) without the rigid ones and V, orthonormal in M."""
        known = np.vstack([self.rigid.T, V])
        for _ in range(2):
            W = W / np.maximum(lengths_of(W), np.finfo(float).tiny)[:, None]
            W = W - (W @ (self.M @ known.T)) @ known
            W = W[lengths_of(W) > ROUNDED]
        return orthonormal(W @ (self.M @ W.T)).T @ W


def _all_values(M: Array, C: Array, K: Array) -> tuple[Complexes, Complexes]:
    """Return all λ (2n,) of λ² M + λ C + K, full matrices, and vectors (n, 2n)."""
    L = np.linalg.cholesky(M)
    C, K = (np.linalg.solve(L, np.linalg.solve(L, A).T).T for A in (C, K))
    scale = max(float(np.abs(K).sum(axis=0).max(initial=0.0)), float(np.finfo(float).tiny)) ** 0.5
    zero, one = np.zeros_like(K), scale * np.eye(len(K))
    values, vectors = np.linalg.eig(np.block([[zero, one], [-K / scale, -C]]))
    return values.astype(complex), np.asarray(np.linalg.solve(L.T, vectors[: len(K)]), dtype=complex)


def unresisted_modes(M: Any, C: Any, K: Any, candidates: Array) -> Array:
    """Return the span (n, k) of those candidates (n, m) that C, K and their transposes take to 0.

    φ^T M φ = 1 of each, and 0 of two.
    """
    if not candidates.shape[1]:
        return candidates
    L = np.linalg.cholesky(candidates.T @ (M @ candidates))
    phi = np.linalg.solve(L, candidates.T).T
    speed = first_shift(K, M) ** 0.5
    pushed = [
        np.asarray(A @ phi) / factor for A, factor in ((K, 1.0), (K.T, 1.0), (C, 1 / speed), (C.T, 1 / speed))
    ]
    size = np.abs(K).sum(axis=0).max() * np.linalg.norm(phi, axis=0).max()
    _, values, directions = np.linalg.svd(np.vstack(pushed), full_matrices=False)
    return np.asarray(phi @ directions[values <= NEUTRAL * size].T)
