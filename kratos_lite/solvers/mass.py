"""Mass: the mass matrix of a mesh, one number for each pair of nodes, as it is the same for x, y and z."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from kratos_lite.assembly import mass_and_convection
from kratos_lite.assembly.block_matrix import rows_of_numbers, times_numbers
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.mass_and_convection import inertia_matrices
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.errors import SolveError
from kratos_lite.solvers import direct
from kratos_lite.solvers.constraints import ConstraintMap
from kratos_lite.solvers.iteration import conjugate_gradients
from kratos_lite.typing import Array, Csr

TOLERANCE = 1e-14
"""Relative residual of accelerations."""


class Mass:
    """The mass matrix of elements: consistent, or lumped at the nodes."""

    def __init__(
        self,
        points: Array,
        groups: Sequence[ElementGroup],
        pattern: Pattern,
        lumped: bool,
        attached: Csr | None = None,
    ) -> None:
        self.attached = attached  # (3n, 3n) kg beside the elements, not in `scalar`, `nodal` and `data`
        self._points, self._groups = points, groups
        self.lumped, self.pattern = lumped, pattern

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: factors live outside of Python, and are made anew."""
        return {name: value for name, value in vars(self).items() if name != "_factors"}

    @cached_property
    def scalar(self) -> Csr:
        """Mass for each pair of nodes, (n, n) sparse in kg; a diagonal for lumped mass."""
        from scipy.sparse import csr_array, diags_array

        if self.lumped:
            return diags_array(self.nodal, format="csr")
        M = inertia_matrices(self._points, self._groups, self.pattern, "M")["M"]
        n = self.pattern.n_nodes
        return csr_array((M, self.pattern.indices, self.pattern.indptr), shape=(n, n))

    @cached_property
    def nodal(self) -> Array:
        """Row sums (n,) in kg."""
        if self.lumped:
            return mass_and_convection.lumped_mass(self._points, self._groups)
        return np.asarray(self.scalar @ np.ones(len(self._points)))

    def times(self, v: Array) -> Array:
        """Return M v of a nodal vector (3n,), or of several (k, 3n), which read the matrix together."""
        product = times_numbers(self.scalar, v)
        return product if self.attached is None else product + (self.attached @ v.T).T

    def solve(self, b: Array) -> Array:
        """Return M^-1 b of nodal vectors (3n,) or columns of them (3n, k)."""
        nodal = b.reshape(len(self.nodal), -1)
        x = nodal / self.nodal[:, None] if self.lumped else self._factors.solve(nodal)
        return np.asarray(x).reshape(b.shape)

    def solve_constrained(self, f: Array, constraint_map: ConstraintMap, c: Array) -> Array:
        """Return x = T q + c with T^T (M x - f) = 0, (3n,), by conjugate gradients: M is well-conditioned."""
        diagonal, T = np.repeat(self.scalar.diagonal(), 3), constraint_map.T
        if self.attached is not None:
            diagonal += self.attached.diagonal()
        D = diagonal[constraint_map.free] if T is None else T.multiply(T).T @ diagonal
        b = constraint_map.reduce(f - self.times(c))

        def times(q: Array) -> Array:
            return constraint_map.reduce(self.times(constraint_map.transform(q)))

        q, _, converged = conjugate_gradients(times, b, lambda r: r / D, TOLERANCE, 0.0)
        if not converged:
            raise SolveError("accelerations cannot be found: the mass is not positive within rounding")
        return constraint_map.expand(q, c)

    @cached_property
    def data(self) -> Array:
        """Mass for each pair of nodes of the pattern, (nnz,) in kg."""
        if not self.lumped:
            return np.asarray(self.scalar.data)
        data = np.zeros(len(self.pattern.indices))
        data[self.pattern.diagonal] = self.nodal
        return data

    def norm(self) -> float:
        """Return the largest row sum of |M|, or what it does not exceed."""
        of = [abs(A).sum(axis=1).max() for A in (self.scalar, self.attached) if A is not None]
        return float(sum(of))

    def matrix(self) -> Csr:
        """Return the mass matrix of all components, (3n, 3n) in kg."""
        M = rows_of_numbers(self.scalar)
        return M if self.attached is None else M + self.attached

    @cached_property
    def _factors(self) -> direct.Factorization:
        return direct.factorize(self.scalar)
