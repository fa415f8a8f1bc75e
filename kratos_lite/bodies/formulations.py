"""Formulations: how the deformation of a finite-element body becomes an internal force vector.

`TotalLagrangian`: Green's strain at every Gauss point.  `Corotational`: one rotation for the whole body, and
small strains seen from it.  `Modal`: the same, with the lowest modes only.  A new one is a class here.

Source: Solfec-1.0 theory, finite-element formulations.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from kratos_lite.assembly import finite_strain
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.assembly.stiffness import assemble_stiffness
from kratos_lite.bodies.linear_algebra import Solve
from kratos_lite.bodies.rotations import polar
from kratos_lite.elements.formulations import NON_LOCKING
from kratos_lite.errors import InputError, ModelError
from kratos_lite.registry import Registry
from kratos_lite.solvers import plan
from kratos_lite.solvers.constraints import ConstraintMap
from kratos_lite.solvers.direct import Factorizer
from kratos_lite.solvers.eigen import modes as natural_modes
from kratos_lite.solvers.linear_solver import LinearSolver
from kratos_lite.solvers.mass import Mass
from kratos_lite.typing import Array
from kratos_lite.validation import whole_number

RESIDUAL = 1e-13
"""Relative residual at which an iteration stops: momentum is as exact."""


@dataclass
class Iterated:
    """What solves A x = b, (n,) or (n, k), by iterations down to a relative residual."""

    equations: LinearSolver  # of A / c
    c: float

    def __call__(self, b: Array, residual: float = RESIDUAL) -> Array:
        """Return x."""
        columns = np.ascontiguousarray((b / self.c).reshape(len(b), -1).T)
        x = [self.equations.solve(column, residual, reduction=residual).x for column in columns]
        return np.stack(x, axis=1).reshape(b.shape)


@dataclass
class Turned:
    """What solves R A R^T x = b, R (3, 3) at each node, by what solves A x = b."""

    solve: Solve
    R: Array

    def __call__(self, b: Array, residual: float = RESIDUAL) -> Array:
        """Return x of b (3n,) or (3n, k); see `Iterated`."""
        columns = b.reshape(len(b) // 3, 3, -1)
        x = correction(self.solve, np.einsum("nik,ij->njk", columns, self.R).reshape(b.shape), residual)
        return np.asarray(np.einsum("njk,ij->nik", x.reshape(columns.shape), self.R).reshape(b.shape))


def correction(solve: Solve, b: Array, residual: float) -> Array:
    """Return x of A x = b; where iterations solve, down to a relative residual."""
    return solve(b, residual) if isinstance(solve, Iterated | Turned) else solve(b)


FORMULATIONS: Registry[type[Formulation]] = Registry("formulation of a finite-element body")
"""Every formulation by its class name and by its `name`."""


class Formulation(ABC):
    """Internal force vector of nodal displacements q (3n,), and solutions with its tangent."""

    name: ClassVar[str]
    aliases: ClassVar[tuple[str, ...]] = ()
    without: ClassVar[tuple[str, ...]] = ()
    """Integrators of deformable bodies that it does not have."""
    unnamed: ClassVar[str] = NON_LOCKING
    """Formulation of elements whose names in the mesh say none."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        FORMULATIONS.add(cls.__name__, cls, [cls.name, *cls.aliases])

    def __init__(
        self, points: Array, groups: Sequence[ElementGroup], mass: Mass, modes: int | None = None
    ) -> None:
        if modes is not None:
            raise InputError(f"modes are for formulation='modal'; got formulation={self.name!r}")
        self.points, self.groups, self.mass = points, groups, mass
        self._Z = points - points.mean(axis=0)
        self._is_large = points.size > plan.STEPPED_LIMIT  # and iterates
        self._solver: tuple[float, Solve] | None = None
        self._turned = np.full(points.size, np.nan), np.eye(3)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: what solves is made anew."""
        return {**vars(self), "_solver": None}

    @cached_property
    def pattern(self) -> Pattern:
        """The sparsity of matrices on the nodes."""
        return self.mass.pattern

    @cached_property
    def _factorizer(self) -> Factorizer:
        return Factorizer(self.pattern)

    @cached_property
    def _factorizer_unsymmetric(self) -> Factorizer:
        return Factorizer(self.pattern, symmetric=False)

    @cached_property
    def K0(self) -> BlockMatrix:
        """Stiffness matrix (3n, 3n) of small strains in N/m."""
        return assemble_stiffness(self.points, self.groups, self.pattern)

    @cached_property
    def norm(self) -> float:
        """The largest row sum of |K0|."""
        return self.K0.norm()

    def _inverse_with(
        self, K: BlockMatrix, c: float, symmetric: bool = True, moved: Array | None = None
    ) -> Solve:
        """Return what solves (M + c K) x = b by a factorization, or by multigrid of `moved` points (n, 3)."""
        if moved is not None:
            A = BlockMatrix(K.data.copy(), K.indices, K.indptr)
            A.add_scalar(self.mass.data / c)
            every = ConstraintMap(np.arange(self.points.size), np.zeros(self.points.size))
            method, mass = plan.Plan("amg", "a matrix for each step"), self.mass.nodal / c
            return Iterated(LinearSolver(A, every, moved, method, groups=self.groups, mass=mass), c)
        A = BlockMatrix(c * K.data, K.indices, K.indptr)
        A.add_scalar(self.mass.data)
        factorizer = self._factorizer if symmetric else self._factorizer_unsymmetric
        return factorizer.factorize(A)

    @abstractmethod
    def load(self, q: Array) -> Array:
        """Return the internal force vector (3n,) in N."""

    @abstractmethod
    def energy(self, q: Array) -> float:
        """Return the strain energy in J."""

    @abstractmethod
    def stiffness(self, q: Array) -> BlockMatrix:
        """Return the tangent of the load (3n, 3n) in N/m."""

    @abstractmethod
    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c K(q)) x = b."""

    @cached_property
    def _gradients(self) -> Array:
        gradients, volume = finite_strain.nodal_gradients(self.points, self.groups)
        return np.ascontiguousarray(gradients.T / volume)

    def rotation(self, q: Array) -> Array:
        """Return R (3, 3), the polar rotation of the mean deformation gradient."""
        if not np.array_equal(q, self._turned[0]):  # a step asks several times for the same one
            self._turned = q.copy(), polar(np.eye(3) + (self._gradients @ q.reshape(-1, 3)).T)
        return self._turned[1]

    def solver_at_rest(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c R K0 R^T) x = b, by one matrix of the body at rest for the same c."""
        if self._solver is None or self._solver[0] != c:
            self._solver = c, self._inverse(c)
        return Turned(self._solver[1], self.rotation(q))

    def _inverse(self, c: float) -> Solve:
        return self._inverse_with(self.K0, c, moved=self.points if self._is_large else None)

    def mass_solver(self, q: Array) -> Solve:
        """Return what solves M x = b, for motions that the formulation has."""
        return self.mass.solve

    def damping_load(self, q: Array, u: Array) -> Array:
        """Return K(q) u, (3n,)."""
        return self.stiffness(q) @ u

    def load_over(self, q: Array, dq: Array, damping: float) -> Array:
        """Return the load (3n,) over an increment, whose work is the change of energy; damping is η/h."""
        raise self._no_energy_momentum()

    def increment_solver(self, q: Array, dq: Array, damping: float, c: float) -> Solve:
        """Return what solves (M + c D) x = b, D the derivative of `load_over` with respect to dq."""
        raise self._no_energy_momentum()

    def _no_energy_momentum(self) -> ModelError:
        return ModelError(
            f"the formulation {self.name} has no energy–momentum integrator; name it in `without`, or take "
            "formulation='total_lagrangian'"
        )

    def highest_frequency(self, q: Array) -> float:
        """Return an upper bound of the angular frequencies in rad/s."""
        return finite_strain.highest_frequency(self.points, self.groups, lumped=self.mass.lumped)

    def project(self, q: Array, u: Array) -> tuple[Array, Array]:
        """Return configuration and velocity as the formulation can represent them."""
        return q, u


class TotalLagrangian(Formulation):
    """Large strains and rotations: Green's strain and Saint Venant–Kirchhoff's law at every Gauss point."""

    name = "total_lagrangian"
    aliases = ("TL",)
    unnamed = "standard"

    def __init__(
        self, points: Array, groups: Sequence[ElementGroup], mass: Mass, modes: int | None = None
    ) -> None:
        super().__init__(points, groups, mass, modes)
        finite_strain.check_elements(groups)

    def load(self, q: Array) -> Array:
        """Return Σ F S grad N dV, (3n,) in N."""
        return finite_strain.internal_load(self.points, self.groups, q.reshape(-1, 3)).ravel()

    def energy(self, q: Array) -> float:
        """Return ∫ ½ E : C : E dV in J."""
        return finite_strain.strain_energy(self.points, self.groups, q.reshape(-1, 3))

    def stiffness(self, q: Array) -> BlockMatrix:
        """Return the tangent (3n, 3n) in N/m."""
        return finite_strain.stiffness(self.points, self.groups, self.pattern, q.reshape(-1, 3))

    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c K(q)) x = b."""
        moved = self.points + q.reshape(-1, 3) if self._is_large else None
        return self._inverse_with(self.stiffness(q), c, moved=moved)

    def load_over(self, q: Array, dq: Array, damping: float) -> Array:
        """Return the load of the energy–momentum method; see `Formulation`."""
        q, dq = q.reshape(-1, 3), dq.reshape(-1, 3)
        return finite_strain.internal_load(self.points, self.groups, q, dq, damping).ravel()

    def increment_solver(self, q: Array, dq: Array, damping: float, c: float) -> Solve:
        """Return the solver of the energy–momentum method; see `Formulation`."""
        if self._is_large:  # its symmetric part will do: that of the tangent at the middle
            return self.solver(q + dq / 2, c / 2 * (1 + 2 * damping))
        q, dq = q.reshape(-1, 3), dq.reshape(-1, 3)
        D = finite_strain.stiffness(self.points, self.groups, self.pattern, q, dq, damping)
        return self._inverse_with(D, c, symmetric=False)

    def highest_frequency(self, q: Array) -> float:
        """Return the bound of the tangent at q; see `Formulation`."""
        q = q.reshape(-1, 3)
        return finite_strain.highest_frequency(self.points, self.groups, q, lumped=self.mass.lumped)


class Corotational(Formulation):
    """Small strains seen from one rotation R of the body, that of its mean deformation gradient."""

    # f = R K0 R^T d, d = (Z + q) - R Z, Z = X less a point amid the body; K0 and factors of M + c K0 stay.

    name = "corotational"
    aliases = ("BC",)
    without = ("energy_momentum",)

    def __init__(
        self, points: Array, groups: Sequence[ElementGroup], mass: Mass, modes: int | None = None
    ) -> None:
        super().__init__(points, groups, mass, modes)
        self._is_large = points.size > plan.REPEATED_LIMIT

    def local(self, q: Array, R: Array) -> Array:
        """Return R^T d (n, 3) in m: the displacement that strains the body, seen from it."""
        return np.asarray(q.reshape(-1, 3) @ R + self._Z @ R - self._Z)

    def _seen(self, q: Array, v: Array) -> tuple[Array, Array]:
        R = self.rotation(q)
        return R, (v.reshape(-1, 3) @ R).ravel()

    def load(self, q: Array) -> Array:
        """Return R K0 R^T d, (3n,) in N."""
        R = self.rotation(q)
        f = self._apply(self.local(q, R).ravel())
        return np.asarray(f.reshape(-1, 3) @ R.T).ravel()

    def _apply(self, d: Array) -> Array:
        """Return K0 d of a displacement seen from the body."""
        return self.K0 @ d

    def energy(self, q: Array) -> float:
        """Return ½ d^T R K0 R^T d in J."""
        d = self.local(q, self.rotation(q)).ravel()
        return float(d @ self._apply(d)) / 2

    def stiffness(self, q: Array) -> BlockMatrix:
        """Return R K0 R^T (3n, 3n) in N/m."""
        R = self.rotation(q)
        return BlockMatrix(R @ self.K0.data @ R.T, self.K0.indices, self.K0.indptr)

    def damping_load(self, q: Array, u: Array) -> Array:
        """Return R K0 R^T u, (3n,)."""
        R, v = self._seen(q, u)
        return np.asarray(self._apply(v).reshape(-1, 3) @ R.T).ravel()

    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c R K0 R^T) x = b."""
        return self.solver_at_rest(q, c)


class Modal(Corotational):
    """The co-rotational formulation with the lowest modes of the free body, the six rigid ones among them."""

    name = "modal"
    aliases = ("BC-MODAL",)

    def __init__(
        self, points: Array, groups: Sequence[ElementGroup], mass: Mass, modes: int | None = None
    ) -> None:
        super().__init__(points, groups, mass)
        count = whole_number(12 if modes is None else modes, "modes", least=6)  # six of them are rigid
        self._Z = points - mass.nodal @ points / mass.nodal.sum()  # momenta are about the mass center
        self.omega, self.shapes = natural_modes(self.K0.scipy().tocsr(), mass.matrix(), count)
        self._squares = np.where(np.arange(count) < 6, 0.0, self.omega**2)
        self._dual = np.ascontiguousarray(np.stack([mass.times(shape) for shape in self.shapes.T]))

    def _apply(self, d: Array) -> Array:
        """Return M E Λ E^T M d: the stiffness of the modes."""
        return np.asarray((self._squares * (self._dual @ d)) @ self._dual)

    def mass_solver(self, q: Array) -> Solve:
        """Return what solves M x = b among the modes; see `Formulation.mass_solver`."""
        return self.solver(q, 0.0)

    def _inverse(self, c: float) -> Solve:
        scale = 1 + c * self._squares

        def solve(b: Array) -> Array:
            coordinates = self.shapes.T @ b
            return np.asarray(self.shapes @ (coordinates.T / scale).T)

        return solve

    def highest_frequency(self, q: Array) -> float:
        """Return the frequency of the highest mode in rad/s."""
        return float(self.omega[-1])

    def project(self, q: Array, u: Array) -> tuple[Array, Array]:
        """Return q and u without what the modes, turned by R(q), do not span; both momenta stay."""
        R, v = self._seen(q, u)
        d = self.local(q, R).ravel()
        before = self._spin(d, v)
        d, v = self.shapes @ (self._dual @ d), self.shapes @ (self._dual @ v)
        x, Z = self._Z + d.reshape(-1, 3), self._Z
        product = x.T @ self.mass.times(Z).reshape(-1, 3)
        inertia = np.trace(product) * np.eye(3) - product.T
        lost = np.linalg.solve(inertia, before - self._spin(d, v))  # what modes of another rotation lack
        v = v.reshape(-1, 3) + np.cross(lost, Z)
        return (x @ R.T - Z).ravel(), np.asarray(v @ R.T).ravel()

    def _spin(self, d: Array, v: Array) -> Array:
        """Return the angular momentum (3,) about the mass center, seen from the body."""
        return np.asarray(np.cross(self._Z + d.reshape(-1, 3), self.mass.times(v).reshape(-1, 3)).sum(axis=0))
