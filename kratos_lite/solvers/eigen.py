"""Modes: eigenvalues of K x = λ M x, both symmetric, nearest to 0.

Small problems are solved whole (LAPACK).  Of larger ones a block of vectors comes down to the lowest
energies: each step takes the best of the span of the vectors X, their last step P, and what an approximate
inverse of K (a cycle of multigrid, or factors) makes of their residuals, W.  Vectors beyond those wanted
speed these up where they are known roughly: no more is spent on them.  The modes of a coarse level, as rough,
are the start, if there is one.

Sources: Knyazev, SIAM J. Sci. Comput. 23 (2001) 517-541 (LOBPCG); Hetmaniuk & Lehoucq, J. Comput. Phys. 218
(2006) 324-332 (its basis); Stathopoulos & Wu, SIAM J. Sci. Comput. 23 (2002) 2165-2182 (dependent vectors).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.errors import InputError, SolveError
from kratos_lite.solvers import direct
from kratos_lite.solvers.plan import DENSE_MODES
from kratos_lite.typing import Array, Csr, Ints, Progress
from kratos_lite.validation import whole_number

Operator: TypeAlias = Callable[[Array], Array]
"""Takes vectors (k, n) to vectors (k, n)."""
Done: TypeAlias = Callable[[Array, Array], bool]
"""Says from eigenvalues and their relative errors whether they will do."""
TOLERANCE = 2e-9
"""Relative error of an eigenvalue, twice that of its frequency; that of its vector is the root of it."""
GUARDS = 2
"""Vectors beyond those wanted, and one more for every six of these: what is next to the last comes along."""
ROUGH = 0.05
"""Relative error to which those beyond, and the modes of a coarse level, are found."""
STEPS = 200
"""Steps after which the iteration does not converge."""
PATIENCE = 40
"""Steps without a smaller error after which it does not either."""
DEPENDENT = 1e-11
"""Squared size of what a vector adds to the span of others, as a fraction, up to which it is rounding."""
RESTARTS = 12
"""Times that Lanczos' method for modes near a frequency begins again before it does not converge."""
SECOND, NEAR = 2, 1e-3
"""Vectors of the second start, and the error up to which its eigenvalues tell whether one was missed."""
CANCELLED = 0.01
"""Length that a vector of length 1 has left without the span of others, below which rounding tells."""
RESIDUAL = 1e-6
"""Fraction of its terms that an equation may miss."""
EPS, ROUNDING = 1e-15, 1e-12
"""Fraction of the norms of its matrices that it may miss, and where an iteration comes no nearer."""
COLUMNS = 1 << 11
"""Components of vectors that are combined at once: they stay in the cache."""


def modes(K: Csr, M: Csr, count: int, progress: Progress | None = None) -> tuple[Array, Array]:
    """Return the lowest ω (count,) in rad/s, ascending, and their shapes (n, count) with φ^T M φ = 1."""
    n = K.shape[0]
    if is_small(n, count):
        return dense_modes(K.toarray(), M.toarray(), count)
    shift = 1e-2 * first_shift(K, M)  # motions that nothing holds have λ = 0
    A = (K + shift * M).tocsr()
    norms = float(abs(A).sum(axis=1).max()), float(abs(M).sum(axis=1).max())
    factors = direct.factorize(A)
    problem = Problem(n, lambda X: (A @ X.T).T, lambda X: (M @ X.T).T, factors.rows, norms, progress=progress)
    squares, shapes = problem.lowest(count)
    return np.sqrt(np.maximum(squares - shift, 0.0)), shapes.T


def modes_near(K: Csr, M: Csr, count: int, near: float) -> tuple[Array, Array]:
    """Return the ω (count,) nearest to one in rad/s, ascending, and their shapes (n, count)."""
    # Lanczos' method with factors of K - σ M finds what lies nearest in ω² to σ. Then it looks beside the
    # modes known, from another vector at random, until all that it finds is farther in ω than those chosen.
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    n = K.shape[0]
    if is_small(n, count):
        return dense_modes(K.toarray(), M.toarray(), count, near)
    shift = near**2 + 1e-2 * first_shift(K, M)  # neither at a mode nor at 0, where those of free bodies are
    factors = direct.factorize((K - shift * M).tocsr(), symmetric=False)
    squares, X, complete = np.zeros(0), np.zeros((n, 0)), False
    while not complete:

        def inverse(f: Array) -> Array:
            x = factors.solve(f)
            return np.asarray(x - X @ ((M @ X).T @ x))  # noqa: B023

        operator, start = LinearOperator((n, n), inverse, dtype=float), at_random(1 + len(squares), n)[0]
        try:
            options = {"ncv": min(n, 4 * count + 40), "maxiter": RESTARTS, "v0": inverse(M @ start)}
            found, Y = eigsh(K, count + GUARDS, M, shift, OPinv=operator, **options)
        except ArpackError:
            raise SolveError(
                f"{count} modes near {near:g} rad/s cannot be found by iteration; ask for more or for fewer, "
                "and look whether the model has modes at such frequencies"
            ) from None
        first, radius = not len(squares), np.abs(found - shift).min()  # in ω², within which are no others
        squares, X = np.append(squares, found), np.hstack([X, Y])
        omega = np.sqrt(np.maximum(squares, 0.0))
        chosen = _nearest(omega, near, count)
        far = np.abs(omega[chosen] - near).max()
        low, high = max(near - far, 0.0) ** 2, (near + far) ** 2
        complete = not first and shift - radius <= low and high <= shift + radius
    return _once_more(factors.solve, K, M, X[:, chosen])


def _once_more(solve: Operator, K: Any, M: Any, X: Array) -> tuple[Array, Array]:
    """Return ω and shapes (n, count) one inverse iteration after X: high modes, of most rounding, leave."""
    Y = solve(M @ X)
    Y /= np.linalg.norm(Y, axis=0)
    squares, C = _ritz(Y.T @ (K @ Y), Y.T @ (M @ Y), X.shape[1])
    _check_dense(K, M, squares, Y @ C)
    return np.sqrt(np.maximum(squares, 0.0)), Y @ C


def _nearest(omega: Array, near: float, count: int) -> Ints:
    """Return the places (count,) of the frequencies nearest to one, by frequency."""
    chosen = np.argsort(np.abs(omega - near), kind="stable")[:count]
    return chosen[np.argsort(omega[chosen], kind="stable")]


def is_small(n: int, count: int) -> bool:
    """Return whether a problem is solved whole; InputError unless it has so many modes."""
    if whole_number(count, "count") > n:
        raise InputError(f"this body has 1 … {n} modes; got {count}")
    return n <= DENSE_MODES or count > n // 4


def dense_modes(K: Array, M: Array, count: int, near: float = 0.0) -> tuple[Array, Array]:
    """Return the ω (count,) nearest to one in rad/s, and shapes (n, count), by LAPACK."""
    # It finds none where the mass is not positive in its rounding. Half of the modes one by one take as long
    # as all at once, by divide and conquer, and all of them one by one five times as long.
    from scipy.linalg import LinAlgError, eigh

    some = None if near or 2 * count > len(K) else [0, count - 1]
    try:
        squares, shapes = eigh(K, M, subset_by_index=some)
    except (LinAlgError, ValueError):
        squares, shapes = np.zeros(0), np.zeros((len(K), 0))
    if len(squares) < count:
        raise SolveError(
            f"{count} modes cannot be found: stiffness or mass is not positive within rounding; look for "
            "lengths or constants in wrong units, and for very thin elements"
        )
    chosen = _nearest(np.sqrt(np.maximum(squares, 0.0)), near, count)
    shift = 1e-2 * first_shift(K, M)  # motions that nothing holds have λ = 0
    A = K - (near**2 + shift) * M if near else K + shift * M
    return _once_more(partial(np.linalg.solve, A), K, M, shapes[:, chosen])


@dataclass(frozen=True)
class Problem:
    """K x = λ M x of n components, K positive beside the span of known vectors, where λ is 0.

    Vectors are rows of arrays (k, n), 0 at constrained components, so that products need no copies.
    """

    n: int
    K: Operator
    M: Operator
    precondition: Operator  # about K⁻¹
    norms: tuple[float, float]  # largest row sums of |K| and |M|
    known: tuple[Array, Array] | None = None  # R (k, n) with R M R^T = 1, and R M
    progress: Progress | None = None
    power: int = 1  # of λ in its error; 2 where `precondition` is about M⁻¹
    coarse: tuple[Problem, Operator] | None = None  # equations of fewer components, and from these to all
    wanted: int = 1  # vectors of a block that are found to `tolerance`, the others to ROUGH
    tolerance: float = TOLERANCE  # relative error of λ
    constrained: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))  # components that are 0

    def lowest(self, count: int) -> tuple[Array, Array]:
        """Return the lowest λ (count,) beside the known ones, ascending, and x (count, n), x M x^T = 1."""
        # After them a few vectors at random look for one that was missed.
        smallest = 1.0

        def converged(squares: Array, errors: Array) -> bool:
            nonlocal smallest
            largest = float(errors[:count].max())
            smallest = min(smallest, max(largest, self.tolerance))
            if self.progress:
                self.progress("modes", 0.99 * float(np.log(smallest) / np.log(self.tolerance)))
            return largest <= self.tolerance

        X, problem = self.roughly(count + GUARDS + count // 6), replace(self, wanted=count)
        while True:
            squares, X, MX = problem._descend(X, converged)
            last = squares[count - 1]
            R, MR = self.known or (X[:0], MX[:0])
            known = np.vstack([R, X[:count]]), np.vstack([MR, MX[:count]])

            def decided(squares: Array, errors: Array) -> bool:
                lower = squares[0] - errors[0] * abs(squares[0])
                return bool(squares[0] < last or lower > last or errors[0] <= NEAR)  # noqa: B023

            others, Y, _ = replace(self, known=known)._descend(self.start(SECOND), decided)
            if others[0] > last - self.tolerance * abs(last):
                self._check(squares[:count], X[:count])
                return squares[:count], X[:count]
            X = np.vstack([X, Y])

    def start(self, count: int) -> Array:
        """Return vectors (count, n) in which low modes are large, the same each time."""
        return self.precondition(self.M(self.at_random(count)))

    def at_random(self, count: int) -> Array:
        """Return vectors (count, n), the same each time."""
        X = np.zeros((count, self.n))
        X[:, self.free] = at_random(count, len(self.free))
        return X

    @property
    def free(self) -> Ints:
        """The components (q,) that are not constrained."""
        return np.delete(np.arange(self.n), self.constrained)

    def roughly(self, count: int) -> Array:
        """Return vectors (count, n) near the lowest modes, those of the coarse level if there is one."""
        if self.coarse is None or len(self.coarse[0].free) < 4 * count:
            return self.start(count)
        problem, onto_all = self.coarse
        problem = replace(problem, wanted=0)

        def enough(squares: Array, errors: Array) -> bool:
            return bool(errors[:-GUARDS].max() <= ROUGH)

        return onto_all(problem._descend(problem.start(count), enough)[1])

    def _descend(self, X: Array, done: Done) -> tuple[Array, Array, Array]:
        """Return λ, x and M x of as many vectors as X has, from these, when `done`."""
        m = len(X)
        S, KS, MS = (np.empty((3 * m, self.n)) for _ in range(3))
        S[:m] = X
        k, MS[:m] = self.independent(S[:m])
        while k < m:  # thin bodies: one cycle leaves little but their softest motions
            S[k:m] = self.at_random(m - k)
            k, MS[:m] = self.independent(S[:m])
        squares, errors, A = np.full(m, np.inf), np.full(m, np.inf), np.zeros((0, 0))
        limits = np.where(np.arange(m) < self.wanted, self.tolerance, ROUGH)
        used, allowed, best, best_at = 0, EPS, np.inf, 0
        for step in range(STEPS):
            new = slice(used, used + k)
            KS[new] = self.K(S[new])
            used, before = new.stop, squares
            A = _bordered(A, KS[new] @ S[:used].T)
            old = slice(0, new.start)
            # whole: where M is stiff, what rounding leaves of it counts
            G = _bordered(MS[old] @ S[old].T, MS[new] @ S[:used].T)
            squares, C = _ritz(A, G, m)
            active = np.flatnonzero((errors > limits) | (squares < before - limits * np.abs(squares)))
            last = C[:, active]
            last[:m] = 0.0
            last -= C @ (C.T @ (G @ last))
            both = np.hstack([C, last @ orthonormal(last.T @ G @ last)]) if step else C
            for V in (S, KS, MS):
                combine(V, both)
            A = both.T @ A @ both
            residual = np.empty((len(active), self.n))
            for r, i in enumerate(active):
                np.multiply(MS[i], -squares[i], out=residual[r])
                residual[r] += KS[i]
            W = self.precondition(residual)
            gaps = (squares[-1] - squares[active]) / np.abs(squares[-1])  # beyond which others mix in
            errors[active] = self.errors(residual, W, lengths_of(S[:m])[active], squares[active], allowed)
            errors[active] /= np.where(active < self.wanted, np.clip(gaps, NEAR, 1.0), 1.0)
            if done(squares, errors):
                return squares, S[:m], MS[:m]
            if np.log(errors + EPS).sum() < best - 0.1:
                best, best_at = float(np.log(errors + EPS).sum()), step
            elif step - best_at > PATIENCE:
                if allowed == ROUNDING:
                    break
                allowed, best_at = ROUNDING, step
            used, W = both.shape[1], W[errors[active] > limits[active]]
            new = slice(used, used + len(W))
            S[new] = W
            del W, residual  # room for others
            k, MS[new] = self.independent(S[new], S[:used], MS[:used])
        raise not_converged(m)

    def independent(self, W: Array, *basis: Array) -> tuple[int, Array]:
        """Make vectors W independent of what is known and of a basis S, given with S M.

        Return the number of those left, which stand first in W, orthonormal in M, and M W.
        """
        spans = [span for span in (self.known, basis) if span]
        cancelled = True
        while cancelled:  # again where much has gone: what is left is rounded, then
            W /= np.maximum(lengths_of(W), np.finfo(float).tiny)[:, None]
            for S, MS in spans:
                C = W @ MS.T
                for some in parts(self.n):
                    W[:, some] -= C @ S[:, some]
            cancelled = bool((lengths_of(W) < CANCELLED).any())
        MW = self.M(W)
        Q = orthonormal(W @ MW.T)
        combine(W, Q)
        combine(MW, Q)
        return Q.shape[1], MW

    def _check(self, squares: Array, X: Array) -> None:
        """Raise SolveError unless the energies of vectors are as they should be: x K x^T = λ, x M x^T = 1."""
        energies, sizes = (np.einsum("ij,ij->i", X, A(X)) for A in (self.K, self.M))
        off = np.maximum(np.abs(energies - squares) / np.abs(squares), np.abs(sizes - 1))
        check(off, RESIDUAL + ROUNDING * self.norms[0] * lengths_of(X) ** 2 / np.abs(squares))

    def errors(self, residual: Array, W: Array, lengths: Array, squares: Array, allowed: float) -> Array:
        """Return the relative errors of λ, r K⁻¹ r^T / λ or r M⁻¹ r^T / λ²; 0 where r is rounding.

        The `lengths` are those of x.
        """
        norm_K, norm_M = self.norms
        rounding = allowed * (norm_K + squares * norm_M) * lengths
        energies = np.abs(np.einsum("ij,ij->i", residual, W)) / np.abs(squares) ** self.power
        return np.where(lengths_of(residual) <= rounding, 0.0, energies)


def at_random(count: int, n: int) -> Array:
    """Return vectors (count, n), the same each time."""
    return np.random.default_rng(count).standard_normal((count, n))


def lengths_of(X: Array) -> Array:
    """Return the lengths (k,) of vectors (k, n)."""
    return np.sqrt(np.einsum("ij,ij->i", X, X))


def orthonormal(G: Array) -> Array:
    """Return combinations (n, k) that are orthonormal in G, without those that are rounding."""
    scale = 1 / np.sqrt(np.maximum(np.diag(G), np.finfo(float).tiny))
    sizes, U = np.linalg.eigh(scale[:, None] * G * scale)
    keep = sizes > DEPENDENT
    return np.asarray(scale[:, None] * (U[:, keep] / np.sqrt(sizes[keep])))


def _ritz(A: Array, G: Array, count: int) -> tuple[Array, Array]:
    """Return the lowest λ of A c = λ G c, and c (n, count)."""
    Q = orthonormal(G)
    values, C = np.linalg.eigh(Q.T @ A @ Q)
    return values[:count], Q @ C[:, :count]


def _bordered(A: Array, rows: Array) -> Array:
    """Return a symmetric matrix A with further rows, and columns that equal them."""
    return np.vstack([np.hstack([A, rows[:, : len(A)].T]), rows])


def combine(V: Array, C: Array) -> None:
    """Put combinations C (k, m) of the first k vectors of V in the places of the first m."""
    k, m = C.shape
    for some in parts(V.shape[1]):
        V[:m, some] = C.T @ V[:k, some]


def parts(n: int) -> Iterator[slice]:
    """Yield n components in parts that are worked on at once."""
    yield from (slice(start, start + COLUMNS) for start in range(0, n, COLUMNS))


def first_shift(K: Any, M: Any) -> float:
    """Return a square of a frequency in 1/s² that is low among those of a mesh."""
    return max(1e-4 * float(K.diagonal().sum() / M.diagonal().sum()), float(np.finfo(float).tiny))


def not_converged(count: int) -> SolveError:
    """Return the error for modes that an iteration does not find."""
    return SolveError(
        f"{count} modes cannot be found by iteration; ask for fewer, or for more to have repeated ones in "
        "full, and look for nearly free parts"
    )


def check_residuals(parts: list[Any], norms: Any, shapes: Any, energies: bool = False) -> None:
    """Raise SolveError unless the sum of parts, products of matrices, is 0 for each shape (n, count).

    Of `energies` it is the product with the shape that has to be 0, which is known more exactly than that.
    The `norms` are those of the sum of matrices.
    """
    lengths = np.linalg.norm(shapes, axis=0)
    if energies:
        parts = [(shapes.conj() * part).sum(axis=0, keepdims=True) / lengths for part in parts]
    residual = np.linalg.norm(sum(parts), axis=0)
    size = sum(np.linalg.norm(part, axis=0) for part in parts)
    allowed = RESIDUAL * size + 0.1 * ROUNDING * norms * lengths
    check(residual / size, allowed / size)


def _check_dense(K: Any, M: Any, squares: Array, X: Array) -> None:
    """Raise SolveError unless K x = λ M x of matrices and vectors (n, count)."""
    norm_K, norm_M = (float(abs(A).sum(axis=0).max()) for A in (K, M))
    check_residuals([K @ X, -squares * (M @ X)], norm_K + squares * norm_M, X)


def check(errors: Array, allowed: Array) -> None:
    """Raise SolveError where relative errors of modes (n,) exceed what is allowed."""
    if not (errors <= allowed).all():  # nor if one is NaN
        worst = int(np.argmax(np.nan_to_num(errors / allowed, nan=np.inf)))
        raise SolveError(
            f"mode {worst + 1} has a residual of {errors[worst]:.1e} of its "
            "terms, which is more than rounding explains; ask for another number of modes, and look for very "
            "thin elements, a large stiffness contrast or nearly free parts"
        )
