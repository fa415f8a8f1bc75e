"""Equations of motion of any law and of large displacements: M u'' + C u' + r(u) = f(t), r internal forces.

Laws that remember start each step from the states at its start, and find those at its end.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.analysis.equations_of_motion import EquationsOfMotion, Solve
from kratos_lite.analysis.nodal_loads import turned
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.constitutive import Constitutive, States, named, unnamed
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import totals
from kratos_lite.errors import SolveError
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.linear_solver import LinearSolver
from kratos_lite.solvers.newton import forcing, newton
from kratos_lite.solvers.plan import stepped
from kratos_lite.typing import Array

TOLERANCE, ITERATIONS = 1e-9, 25
"""Relative residual at which a step has converged, and most iterations."""


@dataclass(frozen=True)
class History:
    """Displacements (3a,) at a time in s, internal forces (3a,) in N, and states of the laws there."""

    time: float
    u: Array
    internal: Array
    states: States


Known: TypeAlias = tuple[Array, BlockMatrix, History]
"""Forces (3a,) that do not balance, effective matrix and internal forces, at some displacements."""


class NonlinearMotion(EquationsOfMotion):
    """Equations of motion whose stiffness follows the displacements; damping is that of the initial one.

    What loads that follow the body have beyond those on the undeformed one counts as internal forces, and of
    its tangent the symmetric part.
    """

    history: History

    def __init__(self, model: Structure, **options: Any) -> None:
        super().__init__(model, **options)
        self.law = Constitutive(self.system.points, self.system.groups, self.system.pattern)
        u0 = model.initial_displacement
        self._u0 = np.zeros(self.size) if u0 is None else self.system.gather(u0)
        self._found: History | None = None  # of the last evaluation
        rest = np.zeros(self.size)
        self.history = History(0.0, rest, rest, self.law.start())
        self._symmetric = all(group.material.symmetric_tangent for group in self.groups)

    def _evaluate(self, u: Array, time: float, tangent: bool) -> tuple[History, BlockMatrix | None]:
        strained, h = (u - self._u0).reshape(-1, 3), time - self.history.time
        forces, K, states = self.law.evaluate(strained, self.history.states, h, tangent=tangent)
        more, changes = self.applied.following(time, u)
        if K is not None:
            self.system.pattern.add_tangents(K.data, [(n, -(k + turned(k)) / 2) for n, k in changes])
        self._found = History(time, u, forces.ravel() - more, states)
        return self._found, K

    def times_stiffness(self, u: Array, time: float) -> Array:
        """Return the internal forces (3a,) in place of K u: of the history, or at the end of a step."""
        known = self.history if np.array_equal(u, self.history.u) else self._evaluate(u, time, False)[0]
        return known.internal

    def solver(self, time: float, m: float, c: float, k: float, h: float) -> Solve:
        """Return what solves m M u + c C u + k (r(u₀ + u) - r(u₀)) = f + reactions, u₀ of the history.

        Tangents are solved with the multigrid of the body at rest.
        """
        plan, near = stepped(len(self.system.constraint_map.free)), None
        if plan.iterates:
            near = super().solver(time, m, c, k, h).args[0]  # type: ignore[attr-defined]
        A = self.matrix(time, m, c, 0.0)
        linear = LinearSolver(A, self.system.constraint_map, self.system.points, plan, near=near)
        return partial(self._newton, linear, k, self.history.time + h)

    def _newton(
        self, linear: LinearSolver, k: float, end: float, f: Array, prescribed: Array, start: Array | None
    ) -> Array:
        """Return displacements (3a,) from the history, under forces f with a jump of what is prescribed."""
        before, reduce = self.history, self.system.constraint_map.reduce

        def evaluate(du: Array) -> tuple[float, Known]:
            now, K = self._evaluate(before.u + du, end, True)
            assert K is not None
            inertia, internal = linear.K @ du, k * (now.internal - before.internal)
            r = f - inertia - internal
            scale = max(float(np.linalg.norm(v)) for v in (f, inertia, now.internal))
            K.data *= k
            K.data += linear.K.data
            return float(np.linalg.norm(reduce(r))) / (scale or 1.0), (r, K, now)

        def correction(du: Array, known: Known, residuals: list[float]) -> Array:
            jump = prescribed if len(residuals) == 1 else 0.0 * prescribed
            solver = replace(linear, K=known[1], symmetric=self._symmetric)
            return solver.solve(known[0], forcing(residuals, TOLERANCE), None, jump, jump).x

        rest, least = np.zeros(self.size), int(prescribed.any())
        try:
            return newton(rest, evaluate, correction, TOLERANCE, ITERATIONS, least)[0]
        except SolveError as error:
            raise SolveError(
                f"the step from t = {before.time:g} s to {end:g} s has no solution: {error}; take smaller "
                "steps"
            ) from None

    def commit(self, u: Array, time: float) -> None:
        """Let the states at displacements (3a,) be those from which the next step starts."""
        found = self._found
        if found is None or found.time != time or not np.array_equal(found.u, u):
            found = self._evaluate(u, time, False)[0]
        self.history, self._found = found, None

    def stored_energy(self, u: Array, time: float) -> float:
        """Return the energy in J that the laws store."""
        strained = (u - self._u0).reshape(-1, 3)
        return totals(self.system.points, self._with_states(self.system.groups), strained)[0]

    def load_of_result(self, u: Array, time: float) -> Array:
        """Return the nodal forces (3a,) at a time, those among them that follow the faces."""
        return self.load(time) + self.applied.following(time, u)[0]

    def groups_of_result(self) -> list[ElementGroup]:
        """Return the elements with the states of their laws."""
        return self._with_states(self.groups)

    def _with_states(self, groups: list[ElementGroup]) -> list[ElementGroup]:
        return [replace(g, states=s) for g, s in zip(groups, self.history.states, strict=True)]

    def history_values(self) -> dict[str, Array]:
        """Return internal forces and states by names."""
        return {"internal": self.history.internal.copy(), **named(self.history.states)}

    def history_of(self, values: Mapping[str, Array], u: Array, time: float) -> History:
        """Return the history that has such values at displacements (3a,) and a time."""
        states = unnamed(values, self.history.states)
        return History(time, u, np.array(values["internal"]), states)
