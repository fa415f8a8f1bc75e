"""Constraints of degrees of freedom, and the map u = T q + c from the free ones to all.

Multi-point constraints are u[dependent] = Σ weight · u[independent] + constant.  T^T K T q = T^T (f - K c)
stays symmetric and holds them exactly, without a penalty.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from kratos_lite.typing import Array, ArrayLike, Csr, Ints, Mask, Numbers


@dataclass(frozen=True, eq=False)
class Constraints:
    """Linear constraints of degrees of freedom, 3·node + axis.

    The independents of constraint i stand at ``start[i]`` to ``start[i + 1]``.
    """

    dependents: Ints  # (c,)
    start: Ints  # (c + 1,)
    independents: Ints  # (k,)
    weights: Array  # (k,)
    constants: Array  # (c,) m

    @classmethod
    def of(cls, dependents: Ints, independents: Ints, weights: Array, constants: Array) -> Constraints:
        """Return constraints (c,) with as many independents (c, k) each."""
        c, k = independents.shape
        start = np.arange(c + 1) * k
        return cls(dependents, start, independents.ravel(), weights.ravel(), constants)

    @classmethod
    def of_rows(cls, dependents: Ints, W: Any, constants: Array) -> Constraints:
        """Return u[dependents] = W u + constants, by a sparse W (c, n)."""
        W.sort_indices()
        start, independents = W.indptr.astype(np.int64), W.indices.astype(np.int64)
        return cls(dependents, start, independents, W.data, constants)

    @classmethod
    def none(cls) -> Constraints:
        """Return no constraints."""
        empty = np.zeros(0, dtype=np.int64)
        return cls.of(empty, empty.reshape(0, 1), np.zeros(0), np.zeros(0))

    def __len__(self) -> int:
        return len(self.dependents)

    def __iter__(self) -> Iterator[tuple[int, Ints, Array, float]]:
        for i, (first, last) in enumerate(pairwise(self.start.tolist())):
            entries = self.independents[first:last], self.weights[first:last]
            yield int(self.dependents[i]), *entries, float(self.constants[i])

    @property
    def owner(self) -> Ints:
        """The constraint of each independent, (k,)."""
        return np.repeat(np.arange(len(self)), np.diff(self.start))

    def __add__(self, other: Constraints) -> Constraints:
        start = np.concatenate([self.start, self.start[-1] + other.start[1:]])
        names = ("independents", "weights", "constants")
        both = [np.concatenate([getattr(self, name), getattr(other, name)]) for name in names]
        return Constraints(np.concatenate([self.dependents, other.dependents]), start, *both)

    def matrix(self, size: int) -> Any:
        """Return W (c, size) of u[dependents] = W u + constants."""
        from scipy.sparse import csr_array

        return csr_array((self.weights, self.independents, self.start), shape=(len(self), size))

    def following(self, size: int) -> Any:
        """Return P (size, size): all displacements are P u of those that are no dependents."""
        from scipy.sparse import csr_array, diags_array

        stays, entries = np.ones(size), (self.dependents[self.owner], self.independents)
        stays[self.dependents] = 0.0
        return diags_array(stays) + csr_array((self.weights, entries), shape=(size, size))

    def take(self, keep: Mask) -> Constraints:
        """Return those of a mask (c,)."""
        entries = keep[self.owner]
        start = np.concatenate([[0], np.cumsum(np.diff(self.start)[keep])])
        of_each = self.independents[entries], self.weights[entries]
        return Constraints(self.dependents[keep], start, *of_each, self.constants[keep])

    def renumbered(self, dof_of: Ints) -> Constraints:
        """Return those whose dependents have a new number, by the new numbers of all dofs, or -1."""
        kept = self.take(dof_of[self.dependents] >= 0)
        dofs = dof_of[kept.dependents], kept.start, dof_of[kept.independents]
        return Constraints(*dofs, kept.weights, kept.constants)


@dataclass(eq=False)
class ConstraintMap:
    """The map u = T q + c from the free degrees of freedom q to all."""

    free: Ints  # (q,) int, the free degrees of freedom
    c: Array  # (N,) float, the displacement at q = 0 in m
    # (N, q) sparse; None without dependent dofs, where q is added to the free components of c
    T: Csr | None = None

    @property
    def is_free(self) -> Mask:
        """Which degrees of freedom (N,) are free."""
        is_free = np.zeros(len(self.c), dtype=bool)
        is_free[self.free] = True
        return is_free

    @cached_property
    def constrained(self) -> Ints:
        """The degrees of freedom that are not free, ascending."""
        return np.flatnonzero(~self.is_free)

    @property
    def norm(self) -> float:
        """The largest sum of the sizes of the weights of T in a row, by which rounding of q grows in u."""
        return 1.0 if self.T is None else float(max(abs(self.T).sum(axis=1).max(initial=0.0), 1.0))

    def holding(self, constrained: Mask) -> ConstraintMap:
        """Return the map with some of the free ones (N,) constrained, too, where they are at q = 0."""
        keep = ~constrained.ravel()[self.free]
        if keep.all():
            return self
        return ConstraintMap(self.free[keep], self.c, None if self.T is None else self.T[:, keep])

    def at(self, nodes: Ints) -> ConstraintMap:
        """Return the map of some nodes whose free components, alone, are free, and the others 0."""
        is_free = self.is_free.reshape(-1, 3)[nodes]
        return ConstraintMap(np.flatnonzero(is_free), np.zeros(is_free.size))

    def transform(self, q: Numbers) -> Numbers:
        """Return T q, (N, ...), of the free degrees of freedom (q, ...): without what is prescribed."""
        if self.T is not None:
            return np.asarray(self.T @ q)
        u = np.zeros((len(self.c), *q.shape[1:]), dtype=q.dtype)
        u[self.free] = q
        return u

    def transform_matrix(self) -> Csr:
        """Return T (N, q) as a sparse matrix, whether or not there are dependents."""
        from scipy.sparse import csr_array

        if self.T is not None:
            return self.T
        q, before = len(self.free), np.cumsum(np.append(False, self.is_free))
        return csr_array((np.ones(q), np.arange(q), before), shape=(len(self.c), q))

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


def constraint_map(fixed: Mask, values: Array, dependents: Constraints | None = None) -> ConstraintMap:
    """Return the map of nodes with prescribed displacements and dependents."""
    # Where all supports displace the nodes alike along an axis, c carries the free ones along: what remains
    # to be solved for is the strain alone, and its error does not grow with the displacement.
    constrained, c = fixed.ravel(), values.ravel() * fixed.ravel()
    if dependents is None:
        for axis in range(3):
            at_axis, along = constrained[axis::3], c[axis::3]
            if at_axis.any() and np.ptp(along[at_axis]) == 0 and along[at_axis][0] != 0:
                along[:] = along[at_axis][0]
        return ConstraintMap(np.flatnonzero(~constrained), c)
    is_free = ~constrained
    is_free[dependents.dependents] = False
    free = np.flatnonzero(is_free)
    column = np.full(len(constrained), -1)
    column[free] = np.arange(len(free))
    c[dependents.dependents] = dependents.constants
    row = np.concatenate([free, dependents.dependents[dependents.owner]])
    columns = column[np.concatenate([free, dependents.independents])]
    weights = np.concatenate([np.ones(len(free)), dependents.weights])
    from scipy.sparse import csr_array

    return ConstraintMap(free, c, csr_array((weights, (row, columns)), shape=(len(constrained), len(free))))


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


def independent_rows(A: Array) -> Ints:
    """Return as many rows of A (m, k) as span all of them, each the largest beside those before it."""
    from scipy.linalg import qr

    if not A.size:
        return np.zeros(0, dtype=np.int64)
    R, order = qr(A.T, mode="r", pivoting=True)
    size = np.abs(np.diagonal(R))
    return np.asarray(order[: np.count_nonzero(size > 1e-9 * size.max())], dtype=np.int64)
