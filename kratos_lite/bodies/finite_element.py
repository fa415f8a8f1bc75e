"""FiniteElementBody: a body that deforms as its mesh lets it.

Source: Solfec-1.0 theory, finite-element bodies.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.bodies.body import Deformable
from kratos_lite.bodies.constraint_projection import unconstrained_motions
from kratos_lite.bodies.formulations import FORMULATIONS
from kratos_lite.bodies.linear_algebra import Entries, Solve
from kratos_lite.bodies.rotations import check_rotation
from kratos_lite.bodies.validation import Material, elements_of, fitting, one_point, points_of, vector_of
from kratos_lite.elements.tables import tabulate
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.mesh.locate import Located
from kratos_lite.model.mass_properties import MassProperties
from kratos_lite.solvers.eigen import modes
from kratos_lite.solvers.mass import Mass
from kratos_lite.typing import Array, Csr, Ints
from kratos_lite.validation import finite

LOCATED_MAX = 64
"""Sets of points whose places in the mesh a body keeps."""


class FiniteElementBody(Deformable):
    """A body of solid elements, all kinds mixed freely.

    q (3n,): nodal displacements (q1x q1y q1z q2x …) in m.  u (3n,): nodal velocities in m/s.
    x = Σ N_a (X_a + q_a); n nodes of the mesh.

    Parameters
    ----------
    mesh : the shape.
    material : one material, or materials by part name or property id.
    formulation : ``total_lagrangian`` (Saint Venant–Kirchhoff), ``corotational`` (small strains relative
        to one rotation of the body), ``modal`` (the same with the lowest modes only); Solfec's acronyms
        ``TL``, ``BC`` and ``BC-MODAL`` are aliases.
    modes : number of modes for ``modal``.
    lumped : whether the mass is lumped at the nodes; the consistent mass is exact for rigid motions.
    integrator : one of `Deformable.integrators`; ``energy_momentum`` for ``total_lagrangian`` and
        ``linearly_implicit`` for the others if not given.
    damping : η in s.
    tolerance : relative size of the last Newton step of an implicit integrator.

    Raises
    ------
    MeshError, ModelError, InputError
        If the mesh is inverted, nodes hang or belong to no element, or there is no mass.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> body = FiniteElementBody(kl.box((0.4, 0.6, 1.0)), kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0))
    >>> body.set_velocity(angular=(0, 10, 0))
    >>> print(f"{body.q.size} displacements, {body.kinetic_energy():.0f} J")
    24 displacements, 1160 J
    """

    kind = "finite-element"
    mesh: Mesh

    def __init__(
        self,
        mesh: Mesh,
        material: Material,
        *,
        formulation: str = "total_lagrangian",
        modes: int | None = None,
        lumped: bool = False,
        integrator: str | None = None,
        damping: float = 0.0,
        tolerance: float = 1e-16,
    ) -> None:
        kind = FORMULATIONS[formulation]
        self.groups = elements_of(mesh, material, kind.unnamed)
        if mesh.hanging is not None:
            raise ModelError(
                f"the mesh of a body has {len(mesh.hanging)} hanging nodes, whose constraints a body does "
                "not take; give it a mesh that is as fine everywhere, or take a model"
            )
        lost = mesh.node_ids[~mesh.used_nodes()]
        if len(lost):
            raise ModelError(
                f"node {lost[0]} belongs to no element, so it has no mass; leave it out of the mesh"
            )
        self.points, self.tolerance, self.dofs = mesh.points, tolerance, 3 * mesh.n_nodes
        mass_properties = MassProperties.of(mesh.points, self.groups)
        pattern = Pattern(mesh.n_nodes, [group.nodes for group in self.groups])
        self.lumped = lumped
        self._mass = Mass(mesh.points, self.groups, pattern, lumped)
        self.formulation = kind(self.points, self.groups, self._mass, modes)
        self._modes = modes
        self.integrators = {  # type: ignore[misc]
            word: alias for word, alias in self.integrators.items() if word not in self.formulation.without
        }
        self._located: dict[bytes, tuple[Located, Csr]] = {}
        self._known: dict[bytes, tuple[Ints, Array]] = {}
        super().__init__(
            mesh, material, mass_properties, np.zeros(self.dofs), np.zeros(self.dofs), integrator, damping
        )

    # ---- motion ----------------------------------------------------------------------------------

    @property
    def displacement(self) -> Array:
        """Nodal displacements (n, 3) in m."""
        return self.q.reshape(-1, 3)

    def position(self, X: ArrayLike, q: Array | None = None) -> Array:
        """Return x = X + Σ N_a q_a of points X (m, 3) or (3,) in m."""
        q = (self.q if q is None else q).reshape(-1, 3)
        return self.points + q if X is self.points else points_of(X) + self._interpolated(X, q)

    def velocity(self, X: ArrayLike, q: Array | None = None, u: Array | None = None) -> Array:
        """Return v = Σ N_a u_a of points X (m, 3) or (3,) in m/s."""
        return self._interpolated(X, (self.u if u is None else u).reshape(-1, 3))

    def _interpolated(self, X: ArrayLike, nodal: Array) -> Array:
        if X is self.points:
            return nodal.copy()
        points = points_of(X)
        return np.asarray((self._in_mesh(np.atleast_2d(points))[1] @ nodal).reshape(points.shape))

    def set_configuration(self, q: ArrayLike) -> None:
        """Set the displacements (3n,) or (n, 3); see `Body.set_configuration`.

        Raises
        ------
        InputError
            It has another shape, is not finite, or inverts an element.
        """
        q = finite(q, "a configuration")
        if q.shape not in ((self.dofs,), self.points.shape):
            raise InputError(f"a configuration of this body has shape ({self.dofs},); got {q.shape}")
        moved = self.points + q.reshape(-1, 3)
        for group in self.groups:
            for chunk in group.chunks():
                _, dN = tabulate(group.element.shape, group.rule)
                lowest = group.at(moved, chunk).determinants(dN).min(axis=1)
                if (lowest <= 0).any():
                    element = self.mesh.element_ids[group.rows[chunk][int(np.argmin(lowest))]]
                    raise InputError(f"these displacements invert element {element}: det J ≤ 0")
        self.q = q.ravel().copy()

    def rotate(self, rotation: ArrayLike) -> None:
        """Set q = (Λ - 1)(X - X̄) and leave the mass center where it is; see `Body.rotate`."""
        R = fitting(check_rotation(rotation), (), 2, "a rotation")
        arms = self.points - self._center
        self.q = (arms @ R.T - arms + self._fractions @ self.displacement).ravel()

    def set_velocity(self, linear: ArrayLike = (0, 0, 0), angular: ArrayLike = (0, 0, 0)) -> None:
        """Set v + ω × (x - x̄) at the nodes; see `Body.set_velocity`."""
        arms = self.points + self.displacement - self.mass_center()
        w = vector_of(angular, (), "an angular velocity")
        self.u = (vector_of(linear, (), "a velocity") + np.cross(w, arms)).ravel()

    def translation(self, v: Array) -> Array:
        """Return v at every node; see `Body.translation`."""
        return np.tile(v, len(self.points))

    def affine_motion(self) -> tuple[Array, Array, Array]:
        """Return F and Ḟ nearest with respect to mass, and the place of X̄; see `Body.affine_motion`."""
        arms = self.points - self._center
        weighted = self.times_mass(arms.ravel()).reshape(-1, 3)
        inverse = np.linalg.inv(weighted.T @ arms)
        q, u = (v.reshape(-1, 3) - v.reshape(-1, 3).mean(axis=0) for v in (self.q, self.u))
        F = np.eye(3) + q.T @ weighted @ inverse
        return F, u.T @ weighted @ inverse, self.mass_center() + F @ (self.center - self._center)

    def set_affine_motion(self, F: Array, rate: Array, center: Array, velocity: Array) -> None:
        """Move the nodes along; see `Body.set_affine_motion`."""
        self.set_configuration((self.points - self.center) @ F.T + center - self.points)
        self.u = ((self.points - self._center) @ rate.T + velocity).ravel()

    def settings(self) -> dict[str, Any]:
        """Return those of all bodies, formulation, modes and kind of mass; see `Body.settings`."""
        own = {"formulation": self.formulation.name, "modes": self._modes, "lumped": self.lumped}
        return {**super().settings(), **own}

    def elements(self) -> list[ElementGroup]:
        """Return the elements; see `Body.elements`."""
        return self.groups

    def locate(self, X: Array) -> None:
        """Note where points X (3,) or (m, 3) lie in the mesh; MeshError if one lies outside."""
        points = np.atleast_2d(X)
        weights = self._in_mesh(points)[1]
        for point, start, end in zip(points, weights.indptr, weights.indptr[1:], strict=False):
            nodes = weights.indices[start:end].astype(np.int64)
            self._known[point.tobytes()] = nodes, weights.data[start:end]

    def _in_mesh(self, points: Array) -> tuple[Located, Csr]:
        """Return where points (m, 3) lie in the mesh, and N (m, n); the last sets are kept."""
        key = points.tobytes()
        if key not in self._located:
            if len(self._located) >= LOCATED_MAX:
                self._located.pop(next(iter(self._located)))
            located = self.mesh.locate(points)
            self._located[key] = located, located.weights()
        return self._located[key]

    def _at(self, X: Array) -> tuple[Ints, Array]:
        """Return nodes (k,) and shape functions N (k,) at one point X (3,) of the body."""
        if X.tobytes() not in self._known:
            self.locate(X)
        return self._known[X.tobytes()]

    # ---- forces ----------------------------------------------------------------------------------

    def jacobian(self, X: Array, q: Array) -> tuple[Ints, Array]:
        """Return dofs of the nodes around X and H = N(X) 1; see `Body.jacobian`."""
        nodes, N = self._at(X)
        return (3 * nodes[:, None] + np.arange(3)).ravel(), (np.eye(3)[:, None] * N[:, None]).reshape(3, -1)

    def generalized_nodal_force(self, forces: Array, q: Array) -> Array:
        """Return the nodal forces as (3n,); see `Body.generalized_nodal_force`."""
        return forces.ravel()

    def generalized_nodal_tangent(self, entries: Entries) -> Entries:
        """Return the entries as they are; see `FreeBody.generalized_nodal_tangent`."""
        return entries

    def push_forward(self, vector: Array, X: Array, q: Array) -> Array:
        """Return F(X) times the vector; see `FreeBody.push_forward`."""
        located = self._in_mesh(X[None])[0]
        block, nodes = self.mesh.blocks[int(located.block[0])], self._at(X)[0]
        assert block.shape is not None
        dN = block.shape.dN(located.xi[0])
        gradient = dN @ np.linalg.inv(self.points[nodes].T @ dN)
        return np.asarray(vector + q.reshape(-1, 3)[nodes].T @ (gradient @ vector))

    def times_mass(self, v: Array) -> Array:
        """Return M v (3n,); see `Body.times_mass`."""
        return self._mass.times(v)

    # ---- deformation -----------------------------------------------------------------------------

    def internal_force(self, q: Array | None = None) -> Array:
        """Return the internal force vector of the formulation, (3n,) in N."""
        return self.formulation.load(self.q if q is None else q)

    def internal_energy(self) -> float:
        """Return the strain energy in J."""
        return self.formulation.energy(self.q)

    def stiffness(self, q: Array | None = None) -> BlockMatrix:
        """Return the tangent (3n, 3n) of the internal force vector in N/m."""
        return self.formulation.stiffness(self.q if q is None else q)

    def mass_solver(self) -> Solve:
        """Return what solves M x = b, for motions that the formulation has."""
        return self.formulation.mass_solver(self.q)

    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c K(q)) x = b."""
        return self.formulation.solver(q, c)

    def extent(self) -> float:
        """Return the largest side of the undeformed body in m."""
        return float(np.ptp(self.points, axis=0).max())

    def highest_frequency(self) -> float:
        """Return an upper bound of the angular frequencies in rad/s: that of the worst element alone."""
        return self.formulation.highest_frequency(self.q)

    def modes(self, count: int = 12) -> tuple[Array, Array]:
        """Return the lowest natural frequencies of the undeformed body as its constraints allow.

        Parameters
        ----------
        count : number of frequencies.

        Returns
        -------
        frequencies (count,) in rad/s, ascending; shapes (3n, count) with φ^T M φ = 1.  A body that nothing
        holds has its six rigid motions first.
        """
        K, M = self.formulation.K0.scipy().tocsr(), self._mass.matrix()
        constrained = [c.jacobian(self, np.zeros(self.dofs)) for c in self.constraints]
        if not constrained:
            return modes(K, M, count)
        T = unconstrained_motions(np.concatenate(constrained))
        omega, shapes = modes((T.T @ K @ T).tocsr(), (T.T @ M @ T).tocsr(), count)
        return omega, np.asarray(T @ shapes)

    # ---- momenta ---------------------------------------------------------------------------------

    @cached_property
    def _fractions(self) -> Array:
        """The fraction (n,) of the mass at each node."""
        return np.asarray(self._mass.nodal / self._mass.nodal.sum())

    @cached_property
    def _center(self) -> Array:
        """The mass center (3,) of the undeformed body; lumped mass may shift it from `center`."""
        return np.asarray(self._fractions @ self.points)

    def mass_center(self, q: Array | None = None) -> Array:
        """Return x̄ (3,) in m."""
        return np.asarray(self._fractions @ (self.points + (self.q if q is None else q).reshape(-1, 3)))

    def linear_momentum(self) -> Array:
        """Return Σ (M u)_a, (3,) in kg m/s."""
        return np.asarray(self._mass.nodal @ self.u.reshape(-1, 3))

    def angular_momentum(self, about: ArrayLike | None = None) -> Array:
        """Return Σ (x_a - about) × (M u)_a, (3,) in kg m²/s; see `Body`."""
        origin = self.mass_center() if about is None else one_point(about)
        arms = self.points + self.displacement - origin
        return np.asarray(np.cross(arms, self.times_mass(self.u).reshape(-1, 3)).sum(axis=0))
