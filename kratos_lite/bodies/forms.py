"""Forms: how the deformation of a finite-element body becomes a load.

`TotalLagrangian`: Green's strain at every Gauss point.  `Corotational`: one rotation for the whole body, and
small strains seen from it.  `Modal`: the same, with the lowest modes only.

Source: Solfec-1.0 theory, finite-element formulations.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from kratos_lite import finite_strain
from kratos_lite.assembly import Pattern, assemble_stiffness
from kratos_lite.batches import Batch
from kratos_lite.blockmatrix import BlockMatrix
from kratos_lite.bodies.deformable import Solve
from kratos_lite.bodies.mass import Mass
from kratos_lite.errors import InputError, ModelError
from kratos_lite.modes import modes
from kratos_lite.registry import Registry
from kratos_lite.rotations import polar
from kratos_lite.solvers import Equations
from kratos_lite.solvers.banded import Factoriser
from kratos_lite.supports import Reduction

Array = NDArray[np.float64]

FACTORISED_MAX = 4000
"""Up to this many displacements a matrix for each step is factorised."""
FACTORISED_ONCE_MAX = 30_000
"""Up to this many a matrix for all steps is."""
RESIDUAL = 1e-13
"""Relative residual at which an iteration stops: momentum is as exact."""

FORMS: Registry[type[Form]] = Registry("form of a finite-element body")
"""Every form by its class name and by its `name`."""


class Form(ABC):
    """Internal load of nodal displacements q (3n,), and solutions with its tangent.

    Parameters
    ----------
    points : (n, 3) m.
    batches : the elements.
    mass : their mass.
    """

    name: ClassVar[str]
    schemes: ClassVar[tuple[str, ...]]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "name" in cls.__dict__:
            FORMS.add(cls.__name__, cls, [cls.name])

    def __init__(self, points: Array, batches: Sequence[Batch], mass: Mass) -> None:
        self.points, self.batches, self.mass = points, batches, mass

    @cached_property
    def pattern(self) -> Pattern:
        """The sparsity of matrices on the nodes."""
        return self.mass.pattern

    @cached_property
    def _factoriser(self) -> Factoriser:
        return Factoriser(self.pattern)

    @cached_property
    def _factoriser_unsymmetric(self) -> Factoriser:
        return Factoriser(self.pattern, symmetric=False)

    @cached_property
    def K0(self) -> BlockMatrix:
        """Stiffness matrix (3n, 3n) of small strains in N/m."""
        return assemble_stiffness(self.points, self.batches, self.pattern)

    @property
    def is_large(self) -> bool:
        """Whether it takes less time to iterate with multigrid than to factorise a matrix for each step."""
        return self.points.size > FACTORISED_MAX

    def _factorised(self, K: BlockMatrix, c: float, symmetric: bool = True, iterate: bool = False) -> Solve:
        """Return what solves (M + c K) x = b, made ready by a factorisation or by multigrid."""
        A = BlockMatrix(c * K.data, K.indices, K.indptr)
        self.mass.add_to(A)
        if iterate:
            return self._iterated(A)
        factoriser = self._factoriser if symmetric else self._factoriser_unsymmetric
        return factoriser.factorise(A).solve

    def _iterated(self, A: BlockMatrix) -> Solve:
        """Return what solves A x = b by conjugate gradients with multigrid."""
        every = Reduction(np.arange(self.points.size), np.zeros(self.points.size))
        equations = Equations(A, every, self.points, "amg", "a matrix for each step")

        def solve(b: Array) -> Array:
            columns = b.reshape(len(b), -1).T
            x = [equations.solve(np.ascontiguousarray(column), RESIDUAL).x for column in columns]
            return np.stack(x, axis=1).reshape(b.shape)

        return solve

    @abstractmethod
    def load(self, q: Array) -> Array:
        """Return the internal load (3n,) in N."""

    @abstractmethod
    def energy(self, q: Array) -> float:
        """Return the strain energy in J."""

    @abstractmethod
    def stiffness(self, q: Array) -> BlockMatrix:
        """Return the tangent of the load (3n, 3n) in N/m."""

    @abstractmethod
    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c K(q)) x = b."""

    def damping_load(self, q: Array, u: Array) -> Array:
        """Return K(q) u, (3n,)."""
        return self.stiffness(q) @ u

    def load_over(self, q: Array, dq: Array, damping: float) -> Array:
        """Return the load of the energy–momentum method; see `FiniteElementBody`."""
        raise ModelError(f"the form {self.name} has no energy–momentum scheme; use form='TL'")

    def increment_solver(self, q: Array, dq: Array, damping: float, c: float) -> Solve:
        """Return the solver of the energy–momentum method; see `FiniteElementBody`."""
        raise ModelError(f"the form {self.name} has no energy–momentum scheme; use form='TL'")

    def highest_frequency(self, q: Array) -> float:
        """Return an upper bound of the angular frequencies in rad/s."""
        return finite_strain.highest_frequency(self.points, self.batches, lumped=self.mass.lumped)

    def project(self, q: Array, u: Array) -> tuple[Array, Array]:
        """Return configuration and velocity as the form can represent them."""
        return q, u


class TotalLagrangian(Form):
    """Green's strain and Saint Venant–Kirchhoff's law at every Gauss point."""

    name = "TL"
    schemes = ("ENERGY_MOMENTUM", "DEF_LIM", "DEF_EXP")

    def load(self, q: Array) -> Array:
        """Return Σ F S grad N dV, (3n,) in N."""
        return finite_strain.internal_load(self.points, self.batches, q.reshape(-1, 3)).ravel()

    def energy(self, q: Array) -> float:
        """Return ∫ ½ E : C : E dV in J."""
        return finite_strain.strain_energy(self.points, self.batches, q.reshape(-1, 3))

    def stiffness(self, q: Array) -> BlockMatrix:
        """Return the tangent (3n, 3n) in N/m."""
        return finite_strain.stiffness(self.points, self.batches, self.pattern, q.reshape(-1, 3))

    def solver(self, q: Array, c: float) -> Solve:
        """Return what solves (M + c K(q)) x = b."""
        return self._factorised(self.stiffness(q), c, iterate=self.is_large)

    def load_over(self, q: Array, dq: Array, damping: float) -> Array:
        """Return the load of the energy–momentum method; see `FiniteElementBody`."""
        q, dq = q.reshape(-1, 3), dq.reshape(-1, 3)
        return finite_strain.internal_load(self.points, self.batches, q, dq, damping).ravel()

    def increment_solver(self, q: Array, dq: Array, damping: float, c: float) -> Solve:
        """Return the solver of the energy–momentum method; see `FiniteElementBody`."""
        if self.is_large:  # its symmetric part will do: that of the tangent at the middle
            return self.solver(q + dq / 2, c / 2 * (1 + 2 * damping))
        q, dq = q.reshape(-1, 3), dq.reshape(-1, 3)
        D = finite_strain.stiffness(self.points, self.batches, self.pattern, q, dq, damping)
        return self._factorised(D, c, symmetric=False)

    def highest_frequency(self, q: Array) -> float:
        """Return the bound of the tangent at q; see `Form`."""
        q = q.reshape(-1, 3)
        return finite_strain.highest_frequency(self.points, self.batches, q, lumped=self.mass.lumped)


class Corotational(Form):
    """Small strains seen from one rotation R of the body, that of its mean deformation gradient.

    f = R K0 R^T d with d = (Z + q) - R Z, Z = X less a point amid the body; K0 is constant, and so are the
    factors of M + c K0.
    """

    name = "BC"
    schemes = ("DEF_LIM", "DEF_EXP")

    def __init__(self, points: Array, batches: Sequence[Batch], mass: Mass) -> None:
        super().__init__(points, batches, mass)
        gradients, volume = finite_strain.nodal_gradients(points, batches)
        self._gradients = np.ascontiguousarray(gradients.T / volume)
        self._Z = points - points.mean(axis=0)
        self._solver: tuple[float, Solve] | None = None
        self._turned = np.full(points.size, np.nan), np.eye(3)

    def rotation(self, q: Array) -> Array:
        """Return R (3, 3), the polar rotation of the mean deformation gradient."""
        if not np.array_equal(q, self._turned[0]):  # a step asks several times for the same one
            self._turned = q.copy(), polar(np.eye(3) + (self._gradients @ q.reshape(-1, 3)).T)
        return self._turned[1]

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
        """Return what solves (M + c R K0 R^T) x = b: R A0^-1 R^T with factors of A0 made once for each c."""
        if self._solver is None or self._solver[0] != c:
            self._solver = c, self._inverse(c)
        solve, R = self._solver[1], self.rotation(q)

        def rotated(b: Array) -> Array:
            columns = b.reshape(len(self._Z), 3, -1)
            seen = np.einsum("nik,ij->njk", columns, R).reshape(b.shape)
            x = solve(seen).reshape(columns.shape)
            return np.asarray(np.einsum("njk,ij->nik", x, R).reshape(b.shape))

        return rotated

    def _inverse(self, c: float) -> Solve:
        return self._factorised(self.K0, c, iterate=self.points.size > FACTORISED_ONCE_MAX)


class Modal(Corotational):
    """The co-rotational form with the lowest modes of the free body, the six rigid ones among them.

    Parameters
    ----------
    count : number of modes, at least 6.
    """

    name = "BC-MODAL"

    def __init__(self, points: Array, batches: Sequence[Batch], mass: Mass, count: int) -> None:
        super().__init__(points, batches, mass)
        if count < 6:
            raise InputError(f"modes must be at least 6, for the rigid motions are modes too; got {count}")
        self._Z = points - mass.nodal @ points / mass.nodal.sum()  # momenta are about the mass centre
        self.omega, self.shapes = modes(self.K0.scipy().tocsr(), mass.matrix(), count)
        self._squares = np.where(np.arange(count) < 6, 0.0, self.omega**2)
        self._dual = np.ascontiguousarray(np.stack([mass.times(shape) for shape in self.shapes.T]))

    def _apply(self, d: Array) -> Array:
        """Return M E Λ E^T M d: the stiffness of the modes."""
        return np.asarray((self._squares * (self._dual @ d)) @ self._dual)

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
        """Return the angular momentum (3,) about the mass centre, seen from the body."""
        return np.asarray(np.cross(self._Z + d.reshape(-1, 3), self.mass.times(v).reshape(-1, 3)).sum(axis=0))
