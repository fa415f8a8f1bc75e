"""Complex modes: eigenvalues of λ² M + λ C + K nearest to 0, from a space that begins with real modes.

A space of real vectors grows by what a cycle of multigrid of the body at rest makes of residuals; when it is
large, what is nearest to 0 stays, with what that was a step before.  Motions that K and C do not resist are
taken out first: their eigenvalue 0 stands twice with one shape, so that rounding would spoil it by its square
root.

Sources: Tisseur & Meerbergen, SIAM Review 43 (2001) 235-286; Stathopoulos & Saad, Electron. Trans. Numer.
Anal. 7 (1998) 163-181, for what stays; Fan, Lin & Van Dooren, SIAM J. Matrix Anal. Appl. 26 (2004) 252-256,
for the scale of λ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kratos_lite.errors import InputError
from kratos_lite.solvers.eigen import (
    EPS,
    GUARDS,
    NEAR,
    SECOND,
    STEPS,
    TOLERANCE,
    Operator,
    Problem,
    check_residuals,
    combine,
    lengths_of,
    not_converged,
)
from kratos_lite.solvers.plan import DENSE_MODES
from kratos_lite.typing import Array, Complexes

LIMIT = TOLERANCE**1.5
"""Squared error of a shape, in the energy of the body at rest, where it will do."""
SMALL = 1e-6
"""Fraction of the largest |λ| requested below which one counts as 0."""
NEUTRAL = 1e-11
"""Fraction of the stiffness up to which a motion is not resisted at all."""


@dataclass(frozen=True)
class Pencil:
    """λ² M + λ C + K of n components, as products with vectors, rows of arrays (k, n).

    `rest` has M, the stiffness at rest, about its inverse, and the rigid motions that are free.  C and K need
    not be symmetric.
    """

    rest: Problem
    C: Operator
    K: Operator

    def modes(self, count: int) -> tuple[Complexes, Complexes]:
        """Return λ (count,) in 1/s, nearest to 0 first, and shapes (n, count) of length 1."""
        n, rigid = len(self.rest.free), self._rigid[0]
        if count > 2 * n:
            raise InputError(f"this model has 1 … {2 * n} complex modes; got {count}")
        values = np.zeros(2 * len(rigid), dtype=complex)
        shapes = np.repeat(rigid, 2, axis=0).astype(complex)
        whole = True
        if (further := count - len(values)) > 0:
            whole = 8 * n <= DENSE_MODES or further > n // 4
            elastic, vectors = self._all() if whole else self._nearest(further)
            order = np.argsort(np.abs(elastic), kind="stable")[:further]
            values, shapes = np.append(values, elastic[order]), np.vstack([shapes, vectors[order]])
        values, shapes = values[:count], shapes[:count]
        shapes = shapes / np.linalg.norm(shapes, axis=1)[:, None]
        self._check(values, shapes, energies=not whole)
        return values, shapes.T

    def _check(self, values: Complexes, shapes: Complexes, energies: bool) -> None:
        """Raise SolveError unless all pairs satisfy the equations, or their products with the shapes."""
        squares, (norm_K, norm_M) = values**2, self.rest.norms
        M, C, K = ((A(shapes.real) + 1j * A(shapes.imag)).T for A in (self.rest.M, self.C, self.K))
        norms = norm_K + np.abs(squares) * norm_M
        check_residuals([squares * M, values * C, K], norms, shapes.T, energies)

    @cached_property
    def _rigid(self) -> tuple[Array, Array]:
        """The rigid motions (k, n) that C, K and their transposes take to 0, and the others."""
        if self.rest.known is None:
            return (np.zeros((0, self.rest.n)),) * 2
        R, (norm_K, norm_M) = self.rest.known[0], self.rest.norms
        rate = 1e-2 * (norm_K / norm_M) ** 0.5  # low among those of a mesh
        products, Z = ((1.0, self.K), (rate, self.C)), self.rest.at_random(SECOND)
        # of transposes, products with vectors at random tell
        pushed = np.hstack([rate * part for rate, A in products for part in (A(R), R @ A(Z).T)])
        ways, sizes, _ = np.linalg.svd(pushed, full_matrices=False)
        neutral = sizes <= NEUTRAL * norm_K * lengths_of(R).max()
        return ways[:, neutral].T @ R, ways[:, ~neutral].T @ R

    def _all(self) -> tuple[Complexes, Complexes]:
        """Return all eigenvalues but those of the rigid modes, from dense matrices."""
        free, rigid = self.rest.free, self._rigid[0]
        others = np.eye(len(free))
        if len(rigid):
            others = np.linalg.qr(self.rest.M(rigid)[:, free].T, mode="complete")[0][:, len(rigid) :]
        Q = np.zeros((others.shape[1], self.rest.n))
        Q[:, free] = others.T
        values, vectors = _all_values(*(Q @ A(Q).T for A in (self.rest.M, self.C, self.K)))
        return values, vectors.T @ Q

    def _nearest(self, count: int) -> tuple[Complexes, Complexes]:
        """Return eigenvalues nearest to 0, and shapes: `count` and their conjugates."""
        # It begins with real modes, two for each pair of complex ones.  After them vectors at random look for
        # one that was missed.
        rigid, others = self._rigid
        rest = replace(self.rest, known=(rigid, self.rest.M(rigid)) if len(rigid) else None)

        def sizes(values: Complexes) -> Array:
            return np.asarray(np.abs(np.repeat(values, 1 + (values.imag > 0)))[:count])

        values, X = self._search(rest, np.vstack([others, self.rest.roughly(count + GUARDS)]), count)
        last = np.full(count, np.inf)
        while (sizes(values) < last - SMALL * sizes(values).max()).any():
            last, X = sizes(values), np.vstack([X, rest.start(SECOND)])
            values, X = self._search(rest, X, count, SECOND)
        shapes, pairs = X[: len(values)] + 1j * X[len(values) :], values.imag > 0
        return np.append(values, values[pairs].conj()), np.vstack([shapes, shapes[pairs].conj()])

    def _search(self, rest: Problem, X: Array, count: int, beside: int = 0) -> tuple[Complexes, Array]:
        """Return the λ (p,) with Im λ ≥ 0 among `count`, and the parts (2p, n) of their shapes.

        Those `beside` them are followed until they are known roughly, or as farther from 0.
        """
        number, smallest, before = count + beside, 1.0, np.zeros((0, 0))
        room = min(3 * number + 12, len(rest.free))
        space = _Space(np.empty((4, room, rest.n)), np.zeros((3, 0, 0)))
        W = X[lengths_of(X) > 0]
        k, MW = rest.independent(W)
        for _ in range(STEPS):
            space.add(W[:k], MW[:k], self.C(W[:k]), self.K(W[:k]))
            values, Y = _all_values(*space.A)
            order = np.argsort(np.abs(values), kind="stable")[: number + GUARDS]
            is_upper = values[order].imag >= 0  # conjugates span the same
            wanted, p = int(is_upper[:count].sum()), int(is_upper[:number].sum())
            Y = (Y / np.linalg.norm(Y, axis=0)).T[order[is_upper]]
            values, y = values[order[is_upper]][:p], Y[:p]
            residual, X = space.residual(values, y), _parts(y) @ space.V
            W, squares = rest.precondition(residual), (np.abs(values) + SMALL * np.abs(values).max()) ** 2
            of_parts = rest.errors(residual, W, lengths_of(X), np.tile(squares, 2), 10 * EPS)
            errors, limits = of_parts[:p] + of_parts[p:], np.where(np.arange(p) < wanted, LIMIT, NEAR)
            is_far = np.abs(values) * (1 - np.sqrt(errors)) > np.abs(values[wanted - 1])
            wrong = (errors > limits) & ~is_far
            smallest = min(smallest, max(float(errors[:wanted].max()), LIMIT))
            if rest.progress:
                rest.progress("modes", 0.99 * float(np.log(smallest) / np.log(LIMIT)))
            if not wrong.any():
                return values[:wanted], X.reshape(2, p, -1)[:, :wanted].reshape(2 * wanted, -1)
            W, size = W[np.tile(wrong, 2) & (of_parts > np.tile(limits, 2) / 2)], Y.shape[1]
            # without room only the lowest stay, which these are not before all squares are positive
            if size + len(W) > room and space.lowest > -SMALL * squares.max():
                kept = [_parts(Y), np.pad(before, ((0, 0), (0, size - before.shape[1])))]
                y = y @ space.keep(np.vstack(kept))
            before = _parts(y)
            k, MW = rest.independent(W, space.V, space.S[1, : len(space.V)])
        raise not_converged(count)


@dataclass
class _Space:
    """Vectors V (k, n), orthonormal in M, and the projections A (3, k, k) of M, C and K on them."""

    S: Array  # V, M V, C V and K V, in the first k places
    A: Array

    @property
    def V(self) -> Array:
        """The vectors (k, n)."""
        return self.S[0, : self.A.shape[1]]

    @property
    def lowest(self) -> float:
        """The lowest eigenvalue of K and its transpose on the vectors, in 1/s²."""
        return float(np.linalg.eigvalsh(self.A[2] + self.A[2].T)[0])

    def add(self, *new: Array) -> None:
        """Add vectors W (m, n), given with M W, C W and K W."""
        k = len(self.V)
        size = k + len(new[0])
        if size > self.S.shape[1]:
            self.S = np.concatenate([self.S, np.empty_like(self.S)], axis=1)
        self.S[:, k:size] = new
        V, *products = self.S[:, :size]
        both = zip(self.A, products, strict=True)
        self.A = np.stack([np.block([[A, V[:k] @ Z[k:].T], [V[k:] @ Z.T]]) for A, Z in both])

    def keep(self, rows: Array) -> Array:
        """Leave the span of combinations (m, k) of the vectors; return the new ones in the old (k, m)."""
        Q = np.linalg.qr(rows[lengths_of(rows) > 0].T)[0]
        for Z in self.S:
            combine(Z, Q)
        self.A = Q.T @ self.A @ Q
        return Q

    def residual(self, values: Complexes, y: Complexes) -> Array:
        """Return what combinations (p, k) of the vectors miss with λ (p,), in parts (2p, n)."""
        powers, products = (values**2, values, np.ones_like(values)), self.S[1:, : y.shape[1]]
        return np.asarray(sum(_parts(f[:, None] * y) @ Z for f, Z in zip(powers, products, strict=True)))


def _parts(A: Complexes) -> Array:
    """Return the real parts of rows, and after them their imaginary parts."""
    return np.vstack([A.real, A.imag])


def _all_values(M: Array, C: Array, K: Array) -> tuple[Complexes, Complexes]:
    """Return all λ (2n,) of λ² M + λ C + K, full matrices, and vectors (n, 2n)."""
    L = np.linalg.cholesky(M)
    C, K = (np.linalg.solve(L, np.linalg.solve(L, A).T).T for A in (C, K))
    scale = max(float(np.abs(K).sum(axis=0).max(initial=0.0)), float(np.finfo(float).tiny)) ** 0.5
    zero, one = np.zeros_like(K), scale * np.eye(len(K))
    values, vectors = np.linalg.eig(np.block([[zero, one], [-K / scale, -C]]))
    return values.astype(complex), np.asarray(np.linalg.solve(L.T, vectors[: len(K)]), dtype=complex)
