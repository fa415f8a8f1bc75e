"""Formulations: how the deformation of a finite-element body becomes a load.

`TotalLagrangian`: Green's strain at every Gauss point.  `Corotational`: one rotation for the whole body, and
small strains seen from it.  `Modal`: the same, with the lowest modes only.

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
from kratos_lite.elements.formulations import NON_LOCKING
from kratos_lite.errors import InputError, ModelError
from kratos_lite.registry import Registry
from kratos_lite.solvers import plan
from kratos_lite.solvers.constraints import ConstraintMap
from kratos_lite.solvers.direct import Factorizer
from kratos_lite.solvers.linear_solver import LinearSolver
from kratos_lite.solvers.mass import Mass
from kratos_lite.typing import Array

RESIDUAL = 1e-13
"""Relative residual at which an iteration stops: momentum is as exact."""

CORRECTED = 1e-3
"""That of a correction: the next one begins with what it leaves."""


@dataclass
class Iterated:
    """What solves A x = b, (n,) or (n, k), by iterations, and about as well as a correction needs it."""

    equations: LinearSolver

    def __call__(self, b: Array) -> Array:
        """Return x."""
        columns = b.reshape(len(b), -1).T
        x = [self.equations.solve(np.ascontiguousarray(column), RESIDUAL).x for column in columns]
        return np.stack(x, axis=1).reshape(b.shape)

    def correction(self, b: Array) -> Array:
        """Return about x of one b (n,).

        Source: Eisenstat & Walker, SIAM J. Sci. Comput. 17 (1996) 16-32 (inexact Newton methods).
        """
        return self.equations.solve(b, CORRECTED, start=np.zeros_like(b)).x


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
        if "name" in cls.__dict__:
            FORMULATIONS.add(cls.__name__, cls, [cls.name, *cls.aliases])

    def __init__(
        self, points: Array, groups: Sequence[ElementGroup], mass: Mass, modes: int | None = None
    ) -> None:
        if modes is not None:
            raise InputError(f"modes are for formulation='modal'; got formulation={self.name!r}")
        self.points, self.groups, self.mass = points, groups, mass

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

    @property
    def is_large(self) -> bool:
        """Whether it takes less time to iterate with multigrid than to factorize a matrix for each step."""
        return self.points.size > plan.STEPPED_LIMIT

    def _factorized(self, K: BlockMatrix, c: float, symmetric: bool = True, iterate: bool = False) -> Solve:
        """Return what solves (M + c K) x = b, made ready by a factorization or by multigrid."""
        A = BlockMatrix(c * K.data, K.indices, K.indptr)
        A.add_scalar(self.mass.data)
        if iterate:
            return self._iterated(A)
        factorizer = self._factorizer if symmetric else self._factorizer_unsymmetric
        return factorizer.factorize(A)

    def _iterated(self, A: BlockMatrix) -> Solve:
        """Return what solves A x = b by conjugate gradients with multigrid."""
        every = ConstraintMap(np.arange(self.points.size), np.zeros(self.points.size))
        equations = LinearSolver(A, every, self.points, plan.Plan("amg", "a matrix for each step"))

        return Iterated(equations)

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
            f"the formulation {self.name} has no energy–momentum integrator; "
            "use formulation='total_lagrangian'"
        )

    def highest_frequency(self, q: Array) -> float:
        """Return an upper bound of the angular frequencies in rad/s."""
        return finite_strain.highest_frequency(self.points, self.groups, lumped=self.mass.lumped)

    def project(self, q: Array, u: Array) -> tuple[Array, Array]:
        """Return configuration and velocity as the formulation can represent them."""
        return q, u
