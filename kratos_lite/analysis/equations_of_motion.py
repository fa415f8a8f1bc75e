"""The equations of motion of a model: M u'' + C u' + K u = f(t), with what a motion of the material adds."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.ale import Motion, MotionMatrices
from kratos_lite.ale.checks import check_materials
from kratos_lite.analysis.nodal_loads import AppliedLoads, at_temperature
from kratos_lite.analysis.prescribed_motion import PrescribedMotion
from kratos_lite.assembly.block_matrix import BlockMatrix, times_numbers
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError, ModelError
from kratos_lite.model.free_motions import FreeMotions
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.linear_solver import LinearSolver
from kratos_lite.solvers.mass import Mass
from kratos_lite.solvers.plan import LIGHT, Facts, choose
from kratos_lite.typing import Array, Mask, Progress
from kratos_lite.validation import finite

Solve: TypeAlias = Callable[[Array, Array, "Array | None"], Array]
"""Takes nodal forces, prescribed displacements and a start (3a,) or None, returns displacements (3a,)."""

_log = logging.getLogger("kratos_lite")
STEP_TOLERANCE, OF_START = 1e-10, 1e-5
"""Relative residual of a step: without a start, and of a start (4e-6 of the error of the step itself)."""


class EquationsOfMotion:
    """Mass, damping, stiffness and loads of a model, on the nodes that its elements use.

    Vectors are (3a,): dof = 3·node + axis of these nodes.  `rayleigh` are α in 1/s and β in s of the damping
    α M + β K.  Supports may leave rigid motions `free` or not.  If `steady`, a rate that changes is taken as
    one that stays, unless the motion is given an acceleration.  Materials may be `massless` where the mass is
    only looked at.
    """

    def __init__(
        self,
        model: Structure,
        *,
        lumped: bool = False,
        rayleigh: tuple[float, float] = (0.0, 0.0),
        free: bool = True,
        steady: bool = False,
        massless: bool = False,
        solver: str = "direct",
        use: str = "once",
        progress: Progress | None = None,
    ) -> None:
        self.model, self._steady = model, steady
        self.step = 0.0  # s, over which an acceleration is taken from the rate; 0 for its slope
        self.rayleigh = _checked_rayleigh(rayleigh)
        self.groups, self.warnings = model.checked()  # elements on all nodes of the mesh
        if model.motion is not None:
            model.require_linear("a motion of the material")
            if model.stiffness_factors is not None:
                raise ModelError(
                    "factors of the stiffness stay with elements, and a motion carries material through "
                    "them; take one of both away"
                )
        if not free:
            self.free_motions.check((), moving=False)
        for group in self.groups:
            if not (massless or group.material.density > 0):
                raise ModelError(
                    f"{type(group.material).__name__} has density {group.material.density:g}, but what moves "
                    "needs mass; give each material a density > 0"
                )
        self.system = ConstrainedSystem(
            model.mesh.points,
            self.groups,
            model.supports.constraint_map,
            solver=solver,
            use=use,
            hanging=model.mesh.hanging,
            patterns=model.patterns,
            progress=progress,
            attached=model.attached,
        )
        self.applied = AppliedLoads(model, self.system, self.groups, initial=not model.is_nonlinear)
        self.prescribed = PrescribedMotion(model.supports, self.system)
        placed = self.system.points, self.system.groups, self.system.pattern
        self.mass = Mass(*placed, lumped, self.system.attached.M if self.system.attached else None)
        self.terms: MotionMatrices | None = None
        if isinstance(model.motion, Motion):
            consistent = Mass(*placed, False) if lumped else self.mass
            moving = model.motion.moving(model.mesh)[self.system.nodes]
            self.terms = MotionMatrices(model.motion, *placed, consistent, moving)
            check_materials(self.terms)
            self.warnings += model.motion.warnings(model, self.terms.groups)
            if self.rayleigh[1]:
                self.warnings.append(
                    "Rayleigh's β K u' damps in fixed axes, not along with the material that moves; take the "
                    "damping of the motion"
                )
        self._kept: tuple[Any, Solve] | None = None
        self._product: tuple[Array, Array] | None = None  # the last u and K u
        self._scalar_kept: tuple[tuple[float, float], tuple[Any, Any]] | None = None

    def log_warnings(self) -> None:
        """Log what the checks of the model found, where no report of a result says it."""
        for text in self.warnings:
            _log.warning("%s", text)

    # ---- loads and supports ------------------------------------------------------------------------------

    @property
    def size(self) -> int:
        """Number of degrees of freedom, the prescribed ones among them."""
        return 3 * len(self.system.nodes)

    @cached_property
    def constrained(self) -> Mask:
        """Which degrees of freedom (3a,) follow from supports or constraints."""
        return ~self.system.constraint_map.is_free

    def load(self, time: float) -> Array:
        """Return the nodal forces (3a,) at a time, those of the motion among them."""
        return self.applied(time) + self.inertia_load(time)

    def inertia_load(self, time: float) -> Array:
        """Return the load (3a,) of the inertia of the rigid motion at a time: centrifugal, Euler, -ρ Z̈."""
        if self.terms is None:
            return np.zeros(self.size)
        (rate, acceleration), (_, of_center) = self.rates(time), self.center_rates(time)
        total = np.zeros_like(self.system.points)
        if rate:
            total += rate**2 * self.terms.centrifugal
        if acceleration:
            total += acceleration * self.terms.euler
        if of_center.any():
            total -= self.terms.nodal_mass[:, None] * of_center
        return total.ravel()

    # ---- matrices ----------------------------------------------------------------------------------------

    @property
    def K(self) -> Any:
        """Stiffness (3a, 3a) of the elements alone in N/m."""
        return self.system.K

    def stiffness_terms(self, time: float) -> Array | None:
        """Return what the motion adds to K, data (nnz,) on the pattern, or None."""
        if self.terms is None:
            return None
        rate, acceleration = self.rates(time)
        parts = []
        if rate:
            parts.append(-(rate**2) * self.terms.H)
            if self.stiffened:
                parts.append(rate**2 * self.stiffening)
        if carried := acceleration + self.terms.motion.damping * rate:
            parts.append(carried * self.terms.circulatory)
        return np.asarray(sum(parts)) if parts else None

    def damping_terms(self, time: float) -> Array | None:
        """Return what the motion adds to C, data (nnz,), or None."""
        parts = []
        if self.terms is not None:
            if alpha := self.terms.motion.damping:
                parts.append(alpha * self.terms.of_moving(self.mass.data))
            if rate := self.terms.motion.rate(time):
                parts.append(2 * rate * self.terms.gyroscopic)
        return np.asarray(sum(parts)) if parts else None

    @property
    def stiffened(self) -> bool:
        """Whether the motion has centrifugal stiffening."""
        return self.terms is not None and self.terms.motion.stiffening

    @cached_property
    def stiffening(self) -> Array:
        """Stiffness by the stress of the centrifugal load for the rate 1, data (nnz,) in kg/s²."""
        assert self.terms is not None
        system, load = self.system, self.system.scatter(self.terms.centrifugal.ravel())
        cure = "let it turn about a principal axis through its center of mass"
        self.free_motions.check([(np.arange(len(load)), load)], moving=True, cure=cure)
        held = system.constraint_map.holding(self.free_motions.constrained[system.nodes])
        equations = replace(system.equations, constraint_map=held)
        u0 = equations.solve(system.gather(load), 1e-12, system.progress, np.zeros_like(held.c)).x
        return self.terms.stiffening(u0.reshape(-1, 3))

    @cached_property
    def dashpots(self) -> BlockMatrix | None:
        """Damping of absorbing boundaries, (3a, 3a) in N s/m, or None."""
        return self.terms.motion.boundary_damping(self.model.mesh, self.system) if self.terms else None

    def times_damping(self, v: Array, time: float) -> Array:
        """Return C v at a time, of a vector (3a,), or without β of several (k, 3a)."""
        out = self.rayleigh[1] * (self.K @ v) if self.rayleigh[1] else np.zeros_like(v)
        if self.rayleigh[0]:
            out = out + self.rayleigh[0] * self.mass.times(v)
        if (scalar := self.scalars(time)[1]) is not None:
            out = out + times_numbers(scalar, v)
        if self.dashpots is not None:
            out = out + self.dashpots.times(v)
        return np.asarray(out)

    def times_stiffness(self, u: Array, time: float) -> Array:
        """Return K u with what the motion adds, at a time."""
        if self._product is None or not np.array_equal(self._product[0], u):
            self._product = u.copy(), self.K @ u
        out = self._product[1]
        if (scalar := self.scalars(time)[0]) is not None:
            out = out + times_numbers(scalar, u)
        return np.asarray(out)

    def scalars(self, time: float) -> tuple[Any, Any]:
        """Return what the motion adds to K and C as sparse (a, a), or None; kept for the same rates."""
        from scipy.sparse import csr_array

        key, pattern = self.rates(time), self.system.pattern
        if self._scalar_kept is None or self._scalar_kept[0] != key:

            def sparse(data: Array | None) -> Any:
                return None if data is None else csr_array((data, pattern.indices, pattern.indptr))

            self._scalar_kept = key, (sparse(self.stiffness_terms(time)), sparse(self.damping_terms(time)))
        return self._scalar_kept[1]

    def matrix(self, time: float, m: float, c: float, k: float) -> BlockMatrix:
        """Return m M + c C + k K at a time, (3a, 3a)."""
        A = self._elastic(m, c, k)
        for factor, made in ((c, self.damping_terms), (k, self.stiffness_terms)):
            if factor and (terms := made(time)) is not None:
                A.add_scalar(factor * terms)
        if c and self.dashpots is not None:
            A.data += c * self.dashpots.data
        return A

    def _elastic(self, m: float, c: float, k: float) -> BlockMatrix:
        """Return m M + c C + k K without what a motion adds, (3a, 3a)."""
        K, (alpha, beta) = self.K, self.rayleigh
        K = K if isinstance(K, BlockMatrix) else self.system.assembled()
        A = BlockMatrix((k + c * beta) * K.data, K.indices, K.indptr)
        if mass := m + c * alpha:
            A.add_scalar(mass * self.mass.data)
            if self.mass.attached is not None:
                self.system.pattern.add_matrix(A.data, self.mass.attached, mass)
        return A

    def solver(self, time: float, m: float, c: float, k: float, h: float) -> Solve:
        """Return what solves (m M + c C + k K) u = f + reactions; it is kept for the same matrix."""
        key = m, c, k, *self.rates(time)
        if self._kept is None or self._kept[0] != key:
            self._kept = key, self._solver(time, m, c, k)
        return self._kept[1]

    # ---- what laws remember: nothing if they are linear --------------------------------------------------

    history: Any = None

    def commit(self, u: Array, time: float) -> None:
        """Let the states at displacements (3a,) be those from which the next step starts."""

    def history_values(self) -> dict[str, Array]:
        """Return what states of a model hold of it, by names."""
        return {}

    def history_of(self, values: Mapping[str, Array], u: Array, time: float) -> Any:
        """Return the history that has such values at displacements (3a,) and a time."""
        return None

    def load_of_result(self, u: Array, time: float) -> Array:
        """Return the nodal forces (3a,) at displacements (3a,) and a time."""
        return self.load(time)

    def groups_of_result(self, time: float) -> list[ElementGroup]:
        """Return the elements with the states of their laws, and the temperatures at a time in s."""
        return at_temperature(self.model, self.groups, time)

    def stored_energy(self, u: Array, time: float) -> float:
        """Return ½ u·K u in J, K with what the motion adds, at a time."""
        return float(u @ self.times_stiffness(u, time)) / 2

    # ---- the motion --------------------------------------------------------------------------------------

    def rates(self, time: float) -> tuple[float, float]:
        """Return rate and acceleration of the motion at a time."""
        if self.terms is None:
            return 0.0, 0.0
        return self.terms.motion.rates(time, self.step, self._steady)

    def center_rates(self, time: float) -> tuple[Array, Array]:
        """Return Ż and Z̈ (3,) of the center of the motion at a time."""
        if self.terms is None:
            return np.zeros(3), np.zeros(3)
        return self.terms.motion.center_rates(time, self.step, self._steady)

    @cached_property
    def free_motions(self) -> FreeMotions:
        """What the supports leave free of rigid motions."""
        return self.model.free_motions(self.groups)

    def is_symmetric(self, time: float, c: float) -> bool:
        """Return whether a matrix with the factor c of damping is symmetric at a time."""
        rate, acceleration = self.rates(time)
        damped = bool(self.terms and self.terms.motion.damping)
        return not (acceleration or (rate and (c or damped)))

    def _solver(self, time: float, m: float, c: float, k: float) -> Solve:
        alpha, beta = self.rayleigh
        size = k + c * beta  # of K, by which the equations are divided
        mass, factors = (m + c * alpha) / size, (m / size, c / size, k / size)
        made, n = self.system.equations, len(self.system.constraint_map.free)
        plan = choose("auto", Facts(n, use="steps"))
        nodal, symmetric = mass * self.mass.nodal, self.is_symmetric(time, c)
        made = replace(made, plan=plan, mass=nodal, symmetric=symmetric)
        heavy = np.abs(nodal).max() > LIGHT * self.system.norm
        if isinstance(self.K, BlockMatrix) or heavy or self.terms:
            made.K = self.matrix(time, *factors)
        else:
            made.K = self.K.with_mass(mass, self.mass.scalar, partial(self._elastic, *factors))
        if not made.symmetric and plan.iterates:  # what it has beside skew parts
            made.near = replace(made, K=self._elastic(*factors), symmetric=True)
        return partial(_solved, made, size, self.system.progress)


def _solved(
    equations: LinearSolver,
    size: float,
    progress: Progress | None,
    f: Array,
    prescribed: Array,
    start: Array | None,
) -> Array:
    """Return displacements (3a,); no lambda, as an analysis can be pickled."""
    return equations.solve(f / size, STEP_TOLERANCE, progress, prescribed, start, OF_START).x


def _checked_rayleigh(rayleigh: tuple[float, float]) -> tuple[float, float]:
    values = finite(rayleigh, "the Rayleigh damping")
    if values.shape != (2,) or (values < 0).any():
        raise InputError(f"Rayleigh damping is α ≥ 0 in 1/s and β ≥ 0 in s; got {rayleigh!r}")
    return float(values[0]), float(values[1])
