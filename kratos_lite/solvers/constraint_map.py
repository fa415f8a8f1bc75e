"""Constraint map: prescribed displacements and multi-point constraints as u = T q + c, by elimination.

q are the free degrees of freedom.  T^T K T q = T^T (f - K c) stays symmetric and holds the constraints
exactly, without a penalty.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from kratos_lite.errors import ModelError
from kratos_lite.typing import Array, Ints, Mask

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.sparse import csr_array

Dependents: TypeAlias = "dict[int, tuple[dict[int, float], float]]"
"""For each dependent the weights of free degrees of freedom, and a constant."""


@dataclass(frozen=True)
class MultiPointConstraint:
    """One linear multi-point constraint: u[dependent] = Σ weights · u[independents] + constant (dofs)."""

    dependent: int
    independents: tuple[int, ...]
    weights: tuple[float, ...]
    constant: float = 0.0
    symmetric: bool = False  # a tie: where supports hold the dependent, the independent follows


@dataclass(eq=False)
class ConstraintMap:
    """The map u = T q + c from the free degrees of freedom q to all."""

    free: Ints  # (q,) int, the free degrees of freedom
    c: Array  # (N,) float, the displacement at q = 0 in m
    # (N, q) sparse; None without dependent dofs, where q is added to the free components of c
    T: csr_array[Any, Any] | None = None

    def holding(self, constrained: Mask) -> ConstraintMap:
        """Return the map with some of the free ones (N,) constrained, too, where they are at q = 0."""
        keep = ~constrained.ravel()[self.free]
        if keep.all():
            return self
        return ConstraintMap(self.free[keep], self.c, None if self.T is None else self.T[:, keep])

    def transform(self, q: NDArray[Any]) -> NDArray[Any]:
        """Return T q, (N, ...), of the free degrees of freedom (q, ...): without what is prescribed."""
        if self.T is not None:
            return np.asarray(self.T @ q)
        u = np.zeros((len(self.c), *q.shape[1:]), dtype=q.dtype)
        u[self.free] = q
        return u

    def transform_matrix(self) -> csr_array[Any, Any]:
        """Return T (N, q) as a sparse matrix, whether or not there are dependents."""
        from scipy.sparse import csr_array

        if self.T is not None:
            return self.T
        q = len(self.free)
        return csr_array((np.ones(q), (self.free, np.arange(q))), shape=(len(self.c), q))

    def expand(self, q: Array, c: Array | None = None) -> Array:
        """Return all displacements T q + c, (N,); `c` replaces that of the map."""
        u = self.transform(q)
        u += self.c if c is None else c
        return u

    def reduce(self, r: Array) -> Array:
        """Return T^T r of forces (N,)."""
        return np.asarray(self.T.T @ r) if self.T is not None else r[self.free]

    def reduce_matrix(self, A: Any) -> Any:
        """Return T^T A T of a sparse matrix (N, N) as CSR."""
        if self.T is not None:
            return (self.T.T @ A @ self.T).tocsr()
        return A if len(self.free) == A.shape[0] else A[self.free][:, self.free]


def constraint_map(fixed: Mask, values: Array, dependents: Dependents | None = None) -> ConstraintMap:
    """Return the map of nodes with prescribed displacements and dependents.

    Where all supports displace the nodes alike along an axis, c carries the free ones along: what remains to
    be solved for is the strain alone, and its error does not grow with the displacement.
    """
    constrained, c = fixed.ravel(), values.ravel() * fixed.ravel()
    if dependents is None:
        for axis in range(3):
            at_axis, along = constrained[axis::3], c[axis::3]
            if at_axis.any() and np.ptp(along[at_axis]) == 0 and along[at_axis][0] != 0:
                along[:] = along[at_axis][0]
        return ConstraintMap(np.flatnonzero(~constrained), c)
    is_free = ~constrained
    is_free[list(dependents)] = False
    free = np.flatnonzero(is_free)
    column = np.full(len(constrained), -1)
    column[free] = np.arange(len(free))
    rows, columns, weights = [free], [column[free]], [np.ones(len(free))]
    for dependent, (terms, constant) in sorted(dependents.items()):
        c[dependent] = constant
        rows.append(np.full(len(terms), dependent))
        columns.append(column[list(terms)])
        weights.append(np.array(list(terms.values()), dtype=float))
    from scipy.sparse import csr_array

    entries = (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns)))
    return ConstraintMap(free, c, csr_array(entries, shape=(len(constrained), len(free))))


def eliminate(
    constraints: Iterable[MultiPointConstraint], fixed: Mask, values: Array, name: Callable[[int], str]
) -> Dependents:
    """Express every dependent dof by free ones; ModelError for cycles and dofs constrained twice."""
    by_dependent: dict[int, MultiPointConstraint] = {}
    for constraint in constraints:
        dependent = constraint.dependent
        if dependent in by_dependent:
            raise ModelError(f"{name(dependent)} depends on others by two constraints; remove one of them")
        if fixed.flat[dependent]:
            raise ModelError(
                f"{name(dependent)} is both fixed and dependent by a constraint; do one of the two"
            )
        by_dependent[dependent] = constraint
    done: Dependents = {}
    for start in by_dependent:
        stack, open_ = [start], set()  # no recursion: chains of constraints may be long
        while stack:
            dependent = stack[-1]
            waiting = [m for m in by_dependent[dependent].independents if m in by_dependent and m not in done]
            if dependent in done or not waiting:
                stack.pop()
                open_.discard(dependent)
                done.setdefault(dependent, _substitute(by_dependent[dependent], done, fixed, values))
            elif dependent in open_:
                raise ModelError(f"the constraints of {name(dependent)} form a cycle; remove one of them")
            else:
                open_.add(dependent)
                stack += waiting
    return done


def _substitute(
    constraint: MultiPointConstraint, done: Dependents, fixed: Mask, values: Array
) -> tuple[dict[int, float], float]:
    """Return the weights of free independents and the constant of a constraint."""
    terms: dict[int, float] = {}
    constant = constraint.constant
    for independent, weight in zip(constraint.independents, constraint.weights, strict=True):
        if fixed.flat[independent]:
            constant += weight * values.flat[independent]
            continue
        inner, offset = done.get(independent, ({independent: 1.0}, 0.0))
        constant += weight * offset
        for dof, factor in inner.items():
            terms[dof] = terms.get(dof, 0.0) + weight * factor
    return terms, constant


def rigid_modes(points: Array, center: ArrayLike | None = None) -> Array:
    """Return the six rigid-body modes (3n, 6) of points (n, 3).

    They are translations along x y z and rotations about x y z through `center`, the mean of the points if
    not given.
    """
    X = points - (points.mean(axis=0) if center is None else np.asarray(center))
    R = np.zeros((len(points), 3, 6))
    R[:, range(3), range(3)] = 1
    x, y, z = X.T
    R[:, 1, 3], R[:, 2, 3] = -z, y
    R[:, 0, 4], R[:, 2, 4] = z, -x
    R[:, 0, 5], R[:, 1, 5] = -y, x
    return R.reshape(-1, 6)
