"""The scalar matrices of a motion: one number for each pair of nodes, alike for x, y and z."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite.ale.motion import Motion
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import at_gauss
from kratos_lite.assembly.mass_and_convection import inertia_matrices
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import stress_stiffness
from kratos_lite.solvers.constrained_system import select
from kratos_lite.solvers.mass import Mass
from kratos_lite.typing import Array, Ints, Mask

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class MotionMatrices:
    """What a motion adds to the equations of elements, for unit rates; each is made when it is requested.

    All are data (nnz,) on one pattern.  Loads come from `mass`, which is consistent also where that of the
    equations is lumped.

    Parameters
    ----------
    motion : of the material.
    points : (n, 3) nodes in m.
    groups : the elements.
    pattern : of the matrices.
    mass : of the same elements.
    moving : (n,) nodes of the elements that move, which share none with others; all if not given.

    Attributes
    ----------
    G : ∫ ρ N_i c·grad N_j, row i of the test function.
    S : its skew part.
    H : ∫ ρ (c·grad N_i)(c·grad N_j), symmetric, ≥ 0.
    stiffening : ∫ σ0 : (grad N_i ⊗ grad N_j), σ0 the stress of the centrifugal load.
    """

    def __init__(
        self,
        motion: Motion,
        points: Array,
        groups: Sequence[ElementGroup],
        pattern: Pattern,
        mass: Mass,
        moving: Mask | None = None,
    ) -> None:
        self.motion, self.points = motion, points
        self.pattern, self.mass = pattern, mass
        self.moving = np.ones(len(points), dtype=bool) if moving is None else moving
        self.groups = select(groups, self.moving)

    @property
    def moving_points(self) -> Array:
        """The nodes that move, (k, 3) in m."""
        return self.points[self.moving]

    @cached_property
    def _own(self) -> tuple[Pattern, Ints | None]:
        """The pattern of the elements that move, and where its entries stand in the whole one."""
        if self.moving.all():
            return self.pattern, None
        own, n = Pattern(len(self.points), [group.nodes for group in self.groups]), len(self.points)
        keys, wanted = (p.rows().astype(np.int64) * n + p.indices for p in (self.pattern, own))
        return own, np.searchsorted(keys, wanted)

    def _spread(self, own: Array) -> Array:
        """Return data on the pattern of what moves on the whole pattern."""
        places = self._own[1]
        if places is None:
            return own
        data = np.zeros(len(self.pattern.indices))
        data[places] = own
        return data

    def of_moving(self, data: Array) -> Array:
        """Return the entries of what moves of a matrix, and 0 for the others.

        Parameters
        ----------
        data : (nnz,) on the pattern.

        Returns
        -------
        (nnz,).
        """
        return data if self.moving.all() else np.where(self.moving[self.pattern.rows()], data, 0.0)

    def _inertia_matrix(self, name: str) -> Array:
        motion = self.motion  # points from the center on, where no digits are lost
        velocity = np.column_stack([motion.A, motion.field(motion.center)])
        points = self.points - motion.center
        return self._spread(inertia_matrices(points, self.groups, self._own[0], name, velocity)[name])

    @cached_property
    def G(self) -> Array:
        """∫ ρ N_i c·grad N_j in kg/s for the rate 1."""
        return self._inertia_matrix("G")

    @cached_property
    def H(self) -> Array:
        """∫ ρ (c·grad N_i)(c·grad N_j) in kg/s² for the rate 1."""
        return self._inertia_matrix("H")

    @cached_property
    def S(self) -> Array:
        """The skew part (G - G^T) / 2."""
        transposed = self._sparse(self.G).T.tocsr()
        transposed.sort_indices()
        return np.asarray((self.G - transposed.data) / 2)

    @property
    def gyroscopic(self) -> Array:
        """What 2 rate multiplies in the damping: S, or G where that is requested."""
        return self.S if self.motion.skew else self.G

    @property
    def circulatory(self) -> Array:
        """What the acceleration multiplies in the stiffness; G where material passes through open faces."""
        return self.G if self.motion.is_open else self.gyroscopic

    def _sparse(self, data: Array) -> csr_array[Any, Any]:
        from scipy.sparse import csr_array

        n = self.pattern.n_nodes
        return csr_array((data, self.pattern.indices, self.pattern.indptr), shape=(n, n))

    def times(self, data: Array, v: Array) -> Array:
        """Return a product with nodal vectors.

        Parameters
        ----------
        data : (nnz,) of a matrix on the pattern.
        v : (n, 3).

        Returns
        -------
        (n, 3).
        """
        return np.asarray(self._sparse(data) @ v)

    # ---- loads for unit rates --------------------------------------------------------------------

    @cached_property
    def centrifugal(self) -> Array:
        """-∫ ρ N A² (X - X0), outward, as nodal forces (n, 3) for the rate 1; 0 for a translation."""
        return self._inertia(-self.motion.A @ self.motion.A)

    @cached_property
    def euler(self) -> Array:
        """-∫ ρ N A (X - X0) as nodal forces (n, 3) for the acceleration 1; 0 for a translation."""
        return self._inertia(-self.motion.A)

    @cached_property
    def nodal_mass(self) -> Array:
        """∫ ρ N of what moves, (n,) in kg: minus the load of the acceleration 1 of the center."""
        return np.where(self.moving, self.mass.nodal, 0.0)

    def _inertia(self, A: Array) -> Array:
        along = np.where(self.moving[:, None], (self.points - self.motion.center) @ A.T, 0.0)
        return np.asarray(self.mass.scalar @ along)

    # ---- centrifugal stiffening ---------------------------------------------------------------------

    def stiffening(self, u0: Array) -> Array:
        """Return the stiffness of the centrifugal stress, ∫ σ(u0) : (grad N_i ⊗ grad N_j).

        Parameters
        ----------
        u0 : (n, 3) displacements in m.

        Returns
        -------
        (nnz,) in N/m.
        """
        return self._spread(
            stress_stiffness(self.points, self.groups, self._own[0], lambda g: at_gauss(self.points, g, u0))
        )
