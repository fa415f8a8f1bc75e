"""Static analysis: from a structure to displacements, one linear solution for each set of loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kratos_lite.analysis.nodal_loads import stress_load
from kratos_lite.analysis.prepared import (
    Equations,
    LoadSet,
    any_axis,
    backend_of,
    dirichlet_conditions,
    load_set,
    prepared,
    system_of,
)
from kratos_lite.analysis.result import Result, result_of
from kratos_lite.analysis.solution_checks import Phases, check_arguments, check_deformation, check_solution
from kratos_lite.errors import InputError, ModelError
from kratos_lite.model import checks
from kratos_lite.model.loads import Load
from kratos_lite.model.loads.base import equal_loads, warnings_of
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constrained_system import ConstrainedSystem, select
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.typing import Array, Mask, Progress
from kratos_lite.validation import finite


class StaticAnalysis:
    """The static analysis of a structure, for many sets of loads; made by `Model.static`.

    It follows its structure: new prescribed values are used; anything else that changes K (materials,
    rules, which degrees of freedom are prescribed, constraints, initial stress) has all checked and made
    anew at the next solution.  Arguments are those of `Model.solve`.
    """

    def __init__(
        self,
        model: Structure,
        solver: str = "auto",
        tolerance: float = 1e-10,
        progress: Progress | None = None,
        *,
        backend: str | None = None,
        petsc: str | None = None,
    ) -> None:
        check_arguments(solver, tolerance)
        self.backend, self.petsc = backend_of(backend, petsc), petsc
        if model.motion is not None:
            raise ModelError("a model with a motion is solved by model.solve() or moves by model.transient()")
        model.require_linear("static analysis with one matrix")
        self.model, self.solver, self.tolerance = model, solver, tolerance
        self.progress = progress
        self._phase = Phases(progress)
        self._equations: Equations | None = None
        self._prepare()

    @property
    def system(self) -> ConstrainedSystem | None:
        """The system that is solved, or None as long as nothing has moved."""
        return self._equations.system if self._equations else None

    @property
    def warnings(self) -> list[str]:
        """What the checks of the structure found, one sentence each."""
        return self._state.warnings

    def solve(
        self,
        loads: Load | Sequence[Load] | LoadSet | None = None,
        *,
        start: Array | None = None,
        tolerance: float | None = None,
    ) -> Result:
        """Solve for some loads, or for those of the model; errors are those of `Model.solve`.

        `start` (n, 3) in m is near the solution, such as that of a similar load: an iteration begins there.
        `tolerance` is the relative residual at which this iteration stops, in place of that of the analysis;
        how far the result is from equilibrium is in its report, and no error then.
        """
        if not isinstance(loads, LoadSet):
            loads = self.case(loads)
        if tolerance is not None:
            check_arguments(self.solver, tolerance)
        if start is not None:
            start = finite(start, "start", (self.model.mesh.n_nodes, 3))
        return self._solve(loads, loads.moving, tolerance, start)

    def case(self, loads: Load | Sequence[Load] | None = None, *, checked: bool = True) -> LoadSet:
        """Return some loads, or those of the model, as `solve` takes them; check functions for jumps."""
        self._follow()
        phase, self._phase = self._phase, Phases(self.progress)
        loads = self.model.loads if loads is None else loads
        case = load_set(self.model, self._state, self._dirichlet, loads, phase)
        if checked:
            with phase("load"):
                case.warnings = warnings_of(case.loads, self.model.mesh, self._state.groups)
        return case

    def check(self) -> list[str]:
        """Check the loads of the model, too, as a solution does, without solving; return warnings."""
        case = self.case()
        return self._warnings(case) + self._state.free.notes(case.moving)

    def solve_cases(self, cases: Mapping[str, Load | Sequence[Load]]) -> dict[str, Result]:
        """Return the result of each load case by its name; see `Model.solve_cases`."""
        if not isinstance(cases, Mapping):
            raise InputError(f"load cases must map names to lists of loads; got {type(cases).__name__}")
        loaded = {name: self.case(loads) for name, loads in cases.items()}
        moving = np.any([case.moving for case in loaded.values()], axis=0)
        return {name: self._solve(case, moving) for name, case in loaded.items()}

    # ---- what is kept from one solution to the next ------------------------------------------------

    def _prepare(self) -> None:
        """Check the model; what fails is tried again at the next solution."""
        with self._phase("check"):
            state = prepared(self.model)
            self._dirichlet = dirichlet_conditions(self.model.supports, state.used)
            self._state = state
            self.release()

    def _follow(self) -> None:
        """Take over what has changed in the model."""
        supports, state = self.model.supports, self._state
        if state.version != self.model.version:
            self._prepare()
        elif self._dirichlet.version != supports.value_version:
            before, self._dirichlet = self._dirichlet, dirichlet_conditions(supports, state.used)
            if not np.array_equal(before.at_rest, self._dirichlet.at_rest):
                self.release()  # elements that were omitted may be needed now
            if self._equations:
                c = supports.constraint_map(self._equations.system.nodes).c
                self._equations = replace(self._equations, prescribed=c)

    def _warnings(self, case: LoadSet) -> list[str]:
        """Return the warnings of the model and of a load set."""
        idle = checks.check_loads(case.loads, self._state.groups, case.forces, self.model.supports)
        return self.warnings + case.warnings + idle + equal_loads(case.loads, self.model.named_loads)

    def _equations_of(self, moving: Mask) -> Equations:
        """Return the equations of the components that move, made anew only for one that is new."""
        state, known = self._state, self._equations
        if known is None or (moving & ~known.components).any():
            components = moving if known is None else moving | known.components
            nodes = components[state.component] & state.used
            groups = select(state.groups, nodes & ~self._dirichlet.at_rest)
            n_at_rest = sum(map(len, select(state.groups, nodes))) - sum(map(len, groups))
            how = state.free.constrained, self.solver, self.tolerance, self.progress, self.backend, self.petsc
            system = system_of(self.model, groups, *how)  # which may be refused; the one before stays then
            self.release()
            self._equations = known = Equations(system, components, n_at_rest)
        return known

    # ---- one solution ------------------------------------------------------------------------------

    def _solve(
        self, case: LoadSet, moving: Mask, tolerance: float | None = None, start: Array | None = None
    ) -> Result:
        """Solve for a load set with the equations of all parts in `moving`."""
        model, state, phase = self.model, self._state, case.phase
        warnings, n_used = self._warnings(case), 3 * int(state.used.sum())
        u, reactions, rounding = self._at_rest(), 0.0 - case.forces, 0.0
        solution = Solution(u, "none", "nothing moves: u = 0 needs no solution", 0, 0.0)
        if case.moving.any():
            with phase("assemble"):
                equations = self._equations_of(moving)
                system = equations.system
                rounding = float(np.finfo(float).eps * system.norm * system.constraint_map.norm)
            with phase("solve"):
                u, solution = system.solve(case.forces, equations.prescribed, tolerance, start)
                warnings += system.warnings
                u = state.free.without(self._complete(u, system, case.moving))
                rounding *= float(np.abs(u).max(initial=0.0))
        with phase("verify"):
            if case.moving.any():
                reactions = system.residual(u, case.forces)
            reactions = model.reactions(reactions, u)
            inner = model.supports.on_independents(stress_load(model, case.groups, u))
            initial = case.external - case.forces
            roundoff = max(rounding, self._initial_roundoff(case.forces) if initial.any() else 0.0)
            # Without loads, each prescribed degree of freedom may hold nothing but the rounding of K u.
            count = n_used**0.5 if case.forces.any() else np.count_nonzero(reactions)
            balance = checks.equilibrium(model.mesh.points, case.external, reactions, inner, count * roundoff)
            if tolerance is None:
                check_solution(solution, u, balance)
            if tolerance is None and not initial.any():
                work = checks.work_of(u, inner, case.external, reactions)
                moved = float(np.abs(u).sum()) if model.attached else model.supports.displaced
                warnings += checks.check_energy(work, 100 * rounding * moved)  # which have roundoff of forces
            warnings += checks.check_rounding(rounding, case.external, initial, reactions, model.supports)
            warnings += check_deformation(model, state.groups, u)
        report = {
            "unknowns": n_used - self._dirichlet.count - len(model.supports.dependents()),
            "seconds": phase.seconds,
            "warnings": warnings,
            "notes": state.free.notes(case.moving),
            "skipped": self._skipped(case.moving),
        }
        fields = u, reactions, case.external
        result = result_of(Result, self, model, case.groups, fields, solution, balance, **report)
        result._acting = case.loads
        return result

    def release(self) -> None:
        """Release the matrix and what is made of it; another solution makes them anew."""
        if self._equations is not None:
            self._equations.system.destroy()
        self._equations = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave the equations out, which another solution makes anew."""
        return vars(self) | {"_equations": None}

    def adjoint(self, load: Array, motion: Array, tolerance: float | None = None) -> Array:
        """Return the displacement (n, 3) in m under a load (n, 3) in N alone, supports displaced by a motion.

        The motion (n, 3) in m is read where a displacement is prescribed; ModelError where nothing is.
        The tolerance is that of the analysis if not given.
        """
        self._follow()
        supports, load = self.model.supports, self._state.free.balanced(load)
        moved = np.where(supports.fixed, motion, 0.0)
        if motion.any() and not (moved.any() or load.any()):
            raise ModelError("nothing is prescribed on the part along this axis, so that it has no reaction")
        moving = self._state.components_with(any_axis(load != 0) | any_axis(moved != 0))
        if not moving.any():
            return np.zeros_like(load)
        system = self._equations_of(moving).system
        displaced, at_rest = (supports.constraint_map(system.nodes, u).c for u in (moved, 0.0 * moved))
        return system.solve(load, displaced - at_rest, tolerance)[0]

    def _initial_roundoff(self, forces: Array) -> float:
        """Return what rounding and the solver leave of the forces (n, 3) of an initial state, in N."""
        if self.system is None:
            return 0.0
        u0 = self.model.initial_displacement
        largest = 0.0 if u0 is None else float(np.abs(u0).max(initial=0.0))
        rounded = np.finfo(float).eps * self.system.norm * largest
        return float(max(rounded, self.tolerance * np.linalg.norm(forces)))

    def _at_rest(self) -> Array:
        """Return displacements (n, 3) that are 0 but for what is prescribed."""
        return np.where(self.model.supports.fixed, self.model.supports.values, 0.0)

    def _complete(self, u: Array, system: ConstrainedSystem, moving: Mask) -> Array:
        """Fill in what is prescribed on nodes without equations; parts that nothing moves stay at rest."""
        if len(system.nodes) < len(u):
            rest = self._at_rest()
            rest[system.nodes] = u[system.nodes]
            u = rest
        if not moving.all():
            u[self._state.used & ~moving[self._state.component]] = 0.0
        return u

    def _skipped(self, moving: Mask) -> list[str]:
        """Return what this solution did without, in words."""
        state, skipped = self._state, []
        if not moving.any():
            skipped.append("assembly and solution, as nothing moves")
        elif not moving.all():
            count = int((~moving[state.component] & state.used).sum())
            skipped.append(
                f"{int((~moving).sum())} of {len(moving)} parts ({count} nodes), as nothing moves them"
            )
        equations = self._equations if moving.any() else None
        if equations and equations.n_at_rest:
            skipped.append(f"{equations.n_at_rest} elements, as all their nodes are constrained")
        if self._dirichlet.count:
            skipped.append(f"{self._dirichlet.count} prescribed degrees of freedom")
        if unused := int((~state.used).sum()):
            skipped.append(f"{unused} nodes without elements")
        return skipped + (equations.system.skipped if equations else [])
