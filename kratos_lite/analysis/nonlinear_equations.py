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
from kratos_lite.analysis.nodal_loads import at_temperature
from kratos_lite.analysis.quasi_static import assembly_of
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import totals
from kratos_lite.assembly.nonlinear_assembly import States, named, unnamed
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.newton import newton
from kratos_lite.solvers.plan import Facts, choose
from kratos_lite.solvers.tangents import Changes, Tangents
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


Known: TypeAlias = tuple[Array, BlockMatrix, Changes]
"""Forces (3a,) that do not balance, effective matrix and tangent of the loads, at some displacements."""


class NonlinearEquations(EquationsOfMotion):
    """Equations of motion whose stiffness follows the displacements; damping is that of the initial one.

    What loads that follow the body have beyond those on the undeformed one counts as internal forces.
    """

    history: History

    def __init__(self, model: Structure, **options: Any) -> None:
        super().__init__(model, **options)
        self.assembly = assembly_of(model, self.system)
        self._found: History | None = None  # of the last evaluation
        rest = np.zeros(self.size)
        self.history = History(0.0, rest, rest, self.assembly.start())

    def _evaluate(
        self, u: Array, time: float, tangent: bool = False
    ) -> tuple[History, BlockMatrix | None, Changes]:
        h, before = time - self.history.time, self.history.states
        heating = [group.heating for group in at_temperature(self.model, self.groups, time)]
        forces, K, states = self.assembly.evaluate(u, before, h, heating, tangent=tangent)
        more, changes = self.applied.following(time, u)
        self._found = History(time, u, forces - more, states)
        return self._found, K, changes

    def times_stiffness(self, u: Array, time: float) -> Array:
        """Return the internal forces (3a,) in place of K u: of the history, or at the end of a step."""
        known = self.history if np.array_equal(u, self.history.u) else self._evaluate(u, time)[0]
        return known.internal

    def solver(self, time: float, m: float, c: float, k: float, h: float) -> Solve:
        """Return what solves m M u + c C u + k (r(u₀ + u) - r(u₀)) = f + reactions, u₀ of the history."""
        # Tangents are solved with the multigrid of the body at rest.
        n, made = len(self.system.constraint_map.free), super().solver
        tangents = Tangents(
            self.system,
            choose("auto", Facts(n, use="steps")),
            self.assembly.symmetric,
            lambda: made(time, m, c, k, h).args[0],  # type: ignore[attr-defined]
        )
        return partial(self._newton, tangents, self.matrix(time, m, c, 0.0), k, self.history.time + h)

    def _newton(
        self,
        tangents: Tangents,
        A: BlockMatrix,
        k: float,
        end: float,
        f: Array,
        prescribed: Array,
        start: Array | None,
    ) -> Array:
        """Return displacements (3a,) from the history, under forces f with a jump of what is prescribed."""
        before, reduce = self.history, self.system.constraint_map.reduce

        def evaluate(du: Array) -> tuple[float, Known]:
            now, K, changes = self._evaluate(before.u + du, end, tangent=True)
            assert K is not None
            inertia = A @ du
            r = f - inertia - k * (now.internal - before.internal)
            scale = max(float(np.linalg.norm(v)) for v in (f, inertia, now.internal))
            effective = BlockMatrix(k * K.data + A.data, K.indices, K.indptr)
            known = r, effective, [(nodes, k * tangent) for nodes, tangent in changes]
            return float(np.linalg.norm(reduce(r))) / (scale or 1.0), known

        def correction(du: Array, known: Known, residuals: list[float]) -> Array:
            r, K, changes = known
            jump = prescribed if len(residuals) == 1 else 0.0 * prescribed
            return tangents.solve(K, changes, [r], jump, residuals, TOLERANCE)[0]

        rest, least = np.zeros(self.size), int(prescribed.any())
        return newton(rest, evaluate, correction, TOLERANCE, ITERATIONS, least)[0]

    def commit(self, u: Array, time: float) -> None:
        """Let the states at displacements (3a,) be those from which the next step starts."""
        found = self._found
        if found is None or found.time != time or not np.array_equal(found.u, u):
            found = self._evaluate(u, time)[0]
        self.history, self._found = found, None

    def stored_energy(self, u: Array, time: float) -> float:
        """Return the energy in J that the laws store."""
        groups = self._with_states(at_temperature(self.model, self.system.groups, time))
        springs = self.assembly.springs
        inner = totals(self.system.points, groups, self.assembly.strained(u))[0]
        return inner if springs is None else inner + float(u @ (springs @ u)) / 2

    def load_of_result(self, u: Array, time: float) -> Array:
        """Return the nodal forces (3a,) at a time, those among them that follow the faces."""
        return self.load(time) + self.applied.following(time, u)[0]

    def groups_of_result(self, time: float) -> list[ElementGroup]:
        """Return the elements with the states of their laws, and the temperatures at a time in s."""
        return self._with_states(at_temperature(self.model, self.groups, time))

    def _with_states(self, groups: list[ElementGroup]) -> list[ElementGroup]:
        return [replace(g, states=s) for g, s in zip(groups, self.history.states, strict=True)]

    def history_values(self) -> dict[str, Array]:
        """Return internal forces and states by names."""
        return {"internal": self.history.internal.copy(), **named(self.history.states)}

    def history_of(self, values: Mapping[str, Array], u: Array, time: float) -> History:
        """Return the history that has such values at displacements (3a,) and a time."""
        states = unnamed(values, self.history.states)
        return History(time, u, np.array(values["internal"]), states)
