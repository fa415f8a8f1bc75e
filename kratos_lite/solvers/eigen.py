"""Modes: natural frequencies of K φ = ω² M φ, and complex modes of λ² M + λ C + K with λ nearest to 0.

Small problems are solved whole (LAPACK), larger ones by Lanczos or Arnoldi with shift and invert (ARPACK).
Motions that K and C do not resist are taken out of complex modes first: their eigenvalue 0 stands twice with
one shape, so that rounding would spoil it by its square root.

Source: Tisseur & Meerbergen, SIAM Review 43 (2001) 235-286; Fan, Lin & Van Dooren, SIAM J. Matrix Anal.
Appl. 26 (2004) 252-256, for the scale of λ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.errors import InputError, SolveError
from kratos_lite.solvers import direct
from kratos_lite.solvers.plan import DENSE_MODES
from kratos_lite.typing import Array, Complexes, Progress
from kratos_lite.validation import whole_number

if TYPE_CHECKING:
    from scipy.sparse import csr_array

SHIFTS = (1.0, 1e-2, 1e-4, 1e-6)
"""Factors on the first shift that are tried."""
RESTARTS = 40
"""Restarts of Lanczos after which a lower shift is tried."""
RESIDUAL = 1e-6
"""Fraction of its terms that an equation may miss."""
ROUNDING = 1e-13
"""Fraction of the norms of its matrices that it may miss."""


def modes(
    K: csr_array[Any, Any], M: csr_array[Any, Any], count: int, progress: Progress | None = None
) -> tuple[Array, Array]:
    """Return the lowest ω (count,) in rad/s, ascending, and their shapes (n, count) with φ^T M φ = 1."""
    n = K.shape[0]
    if whole_number(count, "count") > n:
        raise InputError(f"this body has 1 … {n} modes; got {count}")
    if n <= DENSE_MODES or count > n // 4:
        squares, shapes = _dense(K.toarray(), M.toarray(), count)
    else:
        squares, shapes = _by_iteration(K, M, count, progress)
    check_residuals([(np.ones(count), K), (-squares, M)], shapes)
    return np.sqrt(np.maximum(squares, 0.0)), shapes


def _dense(K: Array, M: Array, count: int) -> tuple[Array, Array]:
    """Return the lowest modes by LAPACK, which finds none where the mass is not positive in its rounding."""
    from scipy.linalg import LinAlgError, eigh

    try:
        squares, shapes = eigh(K, M, subset_by_index=[0, count - 1])
    except (LinAlgError, ValueError):
        squares, shapes = np.zeros(0), np.zeros((len(K), 0))
    if len(squares) != count:
        raise SolveError(
            f"{count} modes cannot be found: stiffness or mass is not positive within rounding; look for "
            "lengths or constants in wrong units, and for very thin elements"
        )
    return squares, shapes


def _by_iteration(K: Any, M: Any, count: int, progress: Progress | None) -> tuple[Array, Array]:
    """Return the lowest modes by Lanczos on (K + s M)^-1 M, with a shift s that makes K definite."""
    from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

    n, done, cycle = K.shape[0], 0, max(2 * count + 1, 20)

    def solve(b: Array) -> Array:
        nonlocal done
        done += 1
        if progress:
            progress("modes", done / (done + cycle))  # nobody knows how many cycles it takes
        return factors.solve(b)

    start = np.random.default_rng(0).standard_normal(n)  # the same vector gives the same modes each time
    inverse = LinearOperator((n, n), matvec=solve, dtype=np.float64)
    for factor in SHIFTS:
        shift = factor * first_shift(K, M)
        if progress:
            progress("factorize", 0.0)
        factors = direct.factorize((K + shift * M).tocsr())
        if progress:
            progress("factorize", 1.0)
        try:
            squares, shapes = eigsh(K, count, M, sigma=-shift, OPinv=inverse, v0=start, maxiter=RESTARTS)
        except ArpackNoConvergence:
            continue
        order = np.argsort(squares)
        return squares[order], shapes[:, order]
    raise not_converged(count)


def first_shift(K: Any, M: Any) -> float:
    """Return a square of a frequency in 1/s² that is low among those of a mesh."""
    return max(1e-4 * float(K.diagonal().sum() / M.diagonal().sum()), float(np.finfo(float).tiny))


def not_converged(count: int) -> SolveError:
    """Return the error for modes that an iteration does not find."""
    return SolveError(
        f"{count} modes cannot be found by iteration; ask for fewer, or for more to have repeated ones in "
        "full, and look for nearly free parts"
    )


def check_residuals(terms: list[tuple[Any, Any]], shapes: Any) -> None:
    """Raise SolveError unless the sum of terms, factors and matrices, is 0 for each shape (n, count)."""
    parts = [factor * (A @ shapes) for factor, A in terms]
    norms = sum(np.abs(factor) * float(abs(A).sum(axis=0).max()) for factor, A in terms)
    residual = np.linalg.norm(sum(parts), axis=0)
    size = sum(np.linalg.norm(part, axis=0) for part in parts)
    allowed = RESIDUAL * size + ROUNDING * norms * np.linalg.norm(shapes, axis=0)
    if not (residual <= allowed).all():  # nor if it is NaN
        worst = int(np.argmax(np.nan_to_num(residual / allowed, nan=np.inf)))
        raise SolveError(
            f"mode {worst + 1} misses its equation by {residual[worst] / size[worst]:.1e} of its "
            "terms, which is more than rounding explains; ask for another number of modes, and look for very "
            "thin elements, a large stiffness contrast or nearly free parts"
        )


ROUNDS = 6
"""Shifts that are tried."""
NEUTRAL = 1e-11
"""Fraction of the stiffness up to which a motion is not resisted at all."""


@dataclass(frozen=True)
class Pencil:
    """λ² M + λ C + K, sparse (n, n), and the motions (n, k) that neither C nor K resists.

    M is symmetric positive definite; C and K need not be symmetric.  The motions are columns with
    φ^T M φ = 1, as `neutral_motions` makes them.
    """

    M: csr_array[Any, Any]
    C: csr_array[Any, Any]
    K: csr_array[Any, Any]
    neutral: Array

    def modes(self, count: int) -> tuple[Complexes, Complexes]:
        """Return λ (count,) in 1/s, nearest to 0 first, and shapes (n, count) of length 1."""
        n, zeros = self.K.shape[0], 2 * self.neutral.shape[1]
        if count > 2 * n:
            raise InputError(f"this model has 1 … {2 * n} complex modes; got {count}")
        values = np.zeros(zeros, dtype=complex)
        shapes = np.repeat(self.neutral, 2, axis=1).astype(complex)
        if (further := count - zeros) > 0:
            whole = 2 * n <= DENSE_MODES or further > n // 4
            elastic, vectors = self._all() if whole else self._nearest(further)
            order = np.argsort(np.abs(elastic), kind="stable")[:further]
            values, shapes = np.append(values, elastic[order]), np.hstack([shapes, vectors[:, order]])
        values, shapes = values[:count], shapes[:, :count]
        shapes = shapes / np.linalg.norm(shapes, axis=0)
        self.check(values, shapes)
        return values, shapes

    def check(self, values: Complexes, shapes: Complexes) -> None:
        """Raise SolveError unless all pairs satisfy the equations."""
        terms = [(values**2, self.M), (values, self.C), (np.ones_like(values), self.K)]
        check_residuals(terms, shapes)

    def _all(self) -> tuple[Complexes, Complexes]:
        """Return all eigenvalues but those of the neutral motions, from dense matrices."""
        Q: Array = np.eye(self.K.shape[0])
        if k := self.neutral.shape[1]:
            Q = np.linalg.qr(self.M @ self.neutral, mode="complete")[0][:, k:]
        M, C, K = (Q.T @ (A @ Q) for A in (self.M, self.C, self.K))
        L = np.linalg.cholesky(M)
        C, K = (np.linalg.solve(L, np.linalg.solve(L, A).T).T for A in (C, K))
        scale = max(float(np.abs(K).sum(axis=0).max(initial=0.0)), float(np.finfo(float).tiny)) ** 0.5
        zero, one = np.zeros_like(K), scale * np.eye(len(K))
        values, vectors = np.linalg.eig(np.block([[zero, one], [-K / scale, -C]]))
        shapes = Q @ np.linalg.solve(L.T, vectors[: len(K)])
        return values.astype(complex), np.asarray(shapes, dtype=complex)

    def _nearest(self, count: int) -> tuple[Complexes, Complexes]:
        """Return eigenvalues nearest to 0, from shifts that come ever nearer to it.

        All within some distance of the shift are found, so that those nearest to 0 are known to be among
        them where they lie within this distance less the shift.
        """
        shift, wanted = first_shift(self.K, self.M) ** 0.5, count + 2
        for _ in range(ROUNDS):
            values, vectors = self._beside(shift, wanted)
            size = np.sort(np.abs(values))
            if not len(size):  # all are far nearer to each other than to the shift
                shift /= 30
                continue
            reach = float(np.abs(values - shift).max()) - shift
            last = float(size[min(count, len(size)) - 1])
            if len(size) >= count and last <= reach:
                return values, vectors
            if last > 3 * shift:
                wanted = min(2 * wanted, self.K.shape[0])
            shift = min(shift / 4, max(last / 2, 1e-5 * shift))
        raise not_converged(count)

    def _beside(self, shift: float, wanted: int) -> tuple[Complexes, Complexes]:
        """Return eigenvalues nearest to a shift > 0 by Arnoldi; none if that does not converge.

        With x = (u, λ u / shift) the inverse of the shifted pencil takes (p, q) to (u, u + p / shift), where
        (shift² M + shift C + K) u = -shift M (p + q) - C p.  It is divided by the shift.
        """
        from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs

        n = self.K.shape[0]
        factors = direct.factorize((shift**2 * self.M + shift * self.C + self.K).tocsr(), symmetric=False)

        def inverse(x: Array) -> Array:
            p, q = self._without(x[:n]), self._without(x[n:])
            u = -self._without(factors.solve(shift**2 * (self.M @ (p + q)) + shift * (self.C @ p)))
            return np.concatenate([u, u + p])

        operator = LinearOperator((2 * n, 2 * n), matvec=inverse, dtype=np.float64)
        start = np.random.default_rng(0).standard_normal(2 * n)
        # Pairs are often nearly repeated: room for more of them, no tolerance below rounding.
        room = min(3 * wanted + 20, 2 * n)
        try:
            values, vectors = eigs(
                operator, wanted, which="LM", v0=start, ncv=room, tol=1e-11, maxiter=RESTARTS // 3
            )
        except ArpackNoConvergence:
            return np.zeros(0, dtype=complex), np.zeros((n, 0), dtype=complex)
        return shift * (1 + 1 / values), vectors[:n]

    def _without(self, u: Array) -> Array:
        """Return a motion without its neutral part."""
        if not self.neutral.shape[1]:
            return u
        return np.asarray(u - self.neutral @ (self.neutral.T @ (self.M @ u)))


def neutral_motions(M: Any, C: Any, K: Any, candidates: Array) -> Array:
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
