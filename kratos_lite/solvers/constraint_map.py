"""Constraint map: prescribed displacements and multi-point constraints as u = T q + c, by elimination.

q are the free degrees of freedom.  T^T K T q = T^T (f - K c) stays symmetric and holds the constraints
exactly, without a penalty.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.solvers.constraints import Constraints
from kratos_lite.typing import Array, Ints, Mask

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.sparse import csr_array


@dataclass(eq=False)
class ConstraintMap:
    """The map u = T q + c from the free degrees of freedom q to all."""

    free: Ints  # (q,) int, the free degrees of freedom
    c: Array  # (N,) float, the displacement at q = 0 in m
    # (N, q) sparse; None without dependent dofs, where q is added to the free components of c
    T: csr_array[Any, Any] | None = None

    @property
    def is_free(self) -> Mask:
        """Which degrees of freedom (N,) are free."""
        is_free = np.zeros(len(self.c), dtype=bool)
        is_free[self.free] = True
        return is_free

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


def constraint_map(fixed: Mask, values: Array, dependents: Constraints | None = None) -> ConstraintMap:
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
