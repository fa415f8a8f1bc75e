"""Static analysis: from a structure to displacements, one linear solution for each set of loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kratos_lite.analysis.engines import System, displacements, engine_of, release, system_of
from kratos_lite.analysis.nodal_loads import external_loads, initial_loads, stress_load
from kratos_lite.analysis.origin import Origin
from kratos_lite.analysis.report import Report
from kratos_lite.analysis.result import Result
from kratos_lite.analysis.small_deformations import check_deformation
from kratos_lite.analysis.solution_checks import (
    Phases,
    balance_of,
    check_arguments,
    initial_noise,
    judge,
    quality,
)
from kratos_lite.errors import InputError, ModelError
from kratos_lite.model import checks
from kratos_lite.model.equal import equal_loads
from kratos_lite.model.loads import Load
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.constrained_system import select
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.typing import Array, Mask, Progress
from kratos_lite.validation import finite

ADJOINT_TOLERANCE = 1e-5
"""Relative residual that is enough for the adjoint: its own error on the mesh is far larger."""


@dataclass(eq=False)
class LoadSet:
    """Loads, their nodal forces (n, 3) in N without and with initial stress, and the parts that they move."""

    loads: list[Load]
    external: Array
    forces: Array
    moving: Mask
    phase: Phases


class StaticAnalysis:
    """The static analysis of a structure, for many sets of loads; made by `Model.static`.

    It follows its structure: new prescribed values are used; anything else that changes K (materials,
    rules, which degrees of freedom are prescribed, constraints, initial stress) has all checked and made
    anew at the next solution.

    Parameters
    ----------
    model : the structure.
    solver : ``auto``, ``dense``, ``direct`` or ``amg``.
    tolerance : relative residual at which the iterative solver stops.
    progress : called with the phase and the share done, 0 … 1.
    engine, petsc : see `Model.solve`.

    Attributes
    ----------
    system : the `ConstrainedSystem` or `PetscSystem` that is solved, or None as long as nothing has moved.

    Raises
    ------
    MeshError, ModelError, InputError
        The structure is broken, or it has a motion.
    """

    def __init__(
        self,
        model: Structure,
        solver: str = "auto",
        tolerance: float = 1e-10,
        progress: Progress | None = None,
        *,
        engine: str | None = None,
        petsc: str | None = None,
    ) -> None:
        check_arguments(solver, tolerance)
        self.engine, self.petsc = engine_of(model.mesh, engine, petsc), petsc
        if model.motion is not None:
            raise ModelError("a model with a motion is solved by model.solve() or moves by model.transient()")
        self.model, self.solver, self.tolerance = model, solver, tolerance
        self.ranks = model.mesh.ranks
        self.progress = progress if self.ranks.rank == 0 else None
        self.system: System | None = None
        self._solved = np.zeros(0, dtype=bool)  # parts in the equations
        self._phase = Phases(self.progress)
        with self.ranks.together():
            self._prepare()

    def solve(
        self,
        loads: Load | Sequence[Load] | None = None,
        *,
        start: Array | None = None,
        tolerance: float | None = None,
    ) -> Result:
        """Solve for some loads, or for those of the model.

        Parameters
        ----------
        loads : one or several, in place of those of the model.
        start : (n, 3) m, displacements near the solution, such as those of a similar load, at which an
            iteration begins.
        tolerance : relative residual at which this iteration stops, in place of that of the analysis; how
            far the result is from equilibrium is in its report, and no error then.

        Returns
        -------
        Result

        Raises
        ------
        MeshError, ModelError, InputError
            A load does not fit, does not balance where supports leave rigid-body modes free, or a change of
            the model has broken it.
        SolveError
            If the accuracy asked for cannot be reached.
        """
        with self.ranks.together():
            self._follow()
            case = self._load(self.model.loads if loads is None else loads)
            if tolerance is not None:
                check_arguments(self.solver, tolerance)
            if start is not None:
                start = finite(start, "start", (self.model.mesh.n_nodes, 3))
            return self._solve(case, case.moving, tolerance, start)

    def check(self) -> list[str]:
        """Check the loads of the model, too, as a solution does, without solving.

        Returns
        -------
        Warnings, one sentence each.

        Raises
        ------
        MeshError, ModelError, InputError
            A load does not fit, or a change of the model has broken it.
        """
        with self.ranks.together():
            self._follow()
            case = self._load(self.model.loads)
            return self._warnings(case) + self.free.notes(case.moving)

    def solve_cases(self, cases: Mapping[str, Load | Sequence[Load]]) -> dict[str, Result]:
        """Return the result of each load case by its name; see `Model.solve_cases`."""
        if not isinstance(cases, Mapping):
            raise InputError(f"load cases must map names to lists of loads; got {type(cases).__name__}")
        with self.ranks.together():
            self._follow()
            loaded = {name: self._load(loads) for name, loads in cases.items()}
            moving = np.any([case.moving for case in loaded.values()], axis=0)
            return {name: self._solve(case, moving) for name, case in loaded.items()}

    # ---- what is kept from one solution to the next ------------------------------------------------

    def _prepare(self) -> None:
        """Check the model; what fails is tried again at the next solution."""
        model = self.model
        self._version: tuple[int, int] | None = None
        with self._phase("check"):
            version = model.version
            self.groups, self.warnings = model.checked()
            self.kinds = model.kinds(self.groups)
            self.free = model.free_motions(self.groups)
            self.part = self.free.part
            self._used = self.part >= 0
            self._n_used, self._n_unused = self._count(self._used), self._count(~self._used)
            self._read_supports()
            self.initial = initial_loads(model, self.groups)
            self.release()
            self._prescribed: Array | None = None  # where it differs from that of the system
            self._still = 0  # elements left out of them
            self._version = version

    def _read_supports(self) -> None:
        """Find the nodes that supports displace, and those that they hold at rest."""
        supports = self.model.supports
        slaves = supports.slaves()  # first, as it may refuse them
        self._value_version = supports.value_version
        moved = supports.fixed & (supports.values != 0)
        pushed = [slave for slave, (_, constant) in slaves.items() if constant]
        moved.flat[np.array(pushed, dtype=np.int64)] = True
        self._moved = _any_axis(moved)
        self._held = ~_any_axis(~supports.fixed) & ~self._moved
        own = self._used & self.model.mesh.own_nodes
        fixed = supports.fixed if own.all() else supports.fixed[own]
        self._fixed = self.ranks.sum(int(fixed.sum()))

    def _follow(self) -> None:
        """Take over what has changed in the model."""
        supports = self.model.supports
        changed = self._version != self.model.version, self._value_version != supports.value_version
        prepare, read = self.ranks.any(np.array(changed)).tolist()
        if prepare:
            self._prepare()
        elif read:
            held = self._held
            self._read_supports()
            if self.ranks.any(not np.array_equal(held, self._held)):
                self.release()  # elements that were left out may be needed now
            if self.system:
                self._prescribed = displacements(self.model, self.system)

    def _load(self, given: Load | Sequence[Load]) -> LoadSet:
        """Return the nodal forces of loads, and which parts are pushed or pulled by anything."""
        phase, self._phase = self._phase, Phases(self.progress)
        if not isinstance(given, (Load, list, tuple)):
            raise InputError(f"a load, or a list of them, is needed; got {type(given).__name__}")
        loads = [given] if isinstance(given, Load) else list(given)
        for load in loads:
            if not isinstance(load, Load):
                raise InputError(f"a load such as Gravity or Traction is needed; got {type(load).__name__}")
        with phase("load"):
            mesh, fixed = self.model.mesh, self.model.supports.fixed
            external = self.model.supports.on_masters(external_loads(mesh, self.groups, loads))
            if mesh.subdomain is not None:
                external = mesh.subdomain.fetch(external)  # at ghosts, not all of it is here
            forces = external if self.initial is None else external - self.initial
            acts = forces != 0
            checks.check_carried(mesh, forces, self._used)
            moving = self._parts_with(_any_axis(acts & ~fixed) | self._moved)
            self.free.check((load.forces(mesh, self.groups) for load in loads), moving)
        return LoadSet(loads, external, forces, moving, phase)

    def _parts_with(self, nodes: Mask) -> Mask:
        """Return the parts with one of some own nodes, a mask (n,)."""
        parts = np.zeros(len(self.free.counts), dtype=bool)
        parts[self.part[nodes & self._used & self.model.mesh.own_nodes]] = True
        found: Mask = self.ranks.any(parts)
        return found

    def _warnings(self, case: LoadSet) -> list[str]:
        """Return the warnings of the model and of a load set."""
        idle = checks.check_loads(case.loads, self.kinds, case.forces, self.model.supports)
        return self.warnings + idle + equal_loads(case.loads, self.ranks)

    def _system_of(self, moving: Mask) -> System:
        """Return the system of the elements in moving parts, made anew only for a part that is new."""
        if self.system is None or (moving & ~self._solved).any():
            model = self.model
            solved = moving if self.system is None else moving | self._solved
            parts = solved[self.part] & self._used
            every, groups = select(self.groups, parts), select(self.groups, parts & ~self._held)
            how = self.free.held, self.solver, self.tolerance, self.progress, self.engine, self.petsc
            system = system_of(model, groups, *how)  # which may be refused; the one before stays then
            self.release()
            self.system = system
            self._prescribed = None
            own = model.mesh.own_elements
            still = (sum(int(own[group.rows].sum()) for group in some) for some in (every, groups))
            self._still = self.ranks.sum(next(still) - next(still))
            self._solved = solved
        return self.system

    # ---- one solution ------------------------------------------------------------------------------

    def _solve(
        self, case: LoadSet, moving: Mask, tolerance: float | None = None, start: Array | None = None
    ) -> Result:
        """Solve for a load set with the equations of all parts in `moving`."""
        model, phase = self.model, case.phase
        warnings = self._warnings(case)
        u, reactions, noise = self._at_rest(), 0.0 - case.forces, 0.0
        solution = Solution(u, "none", "nothing moves: u = 0 needs no solution", 0, 0.0)
        if case.moving.any():
            with phase("assemble"):
                system = self._system_of(moving)
                noise = float(np.finfo(float).eps * system.norm)
            with phase("solve"):
                u, solution = system.solve(case.forces, self._prescribed, tolerance, start)
                warnings += system.warnings
                u = self.free.without(self._complete(u, system, case.moving))
                noise *= self.ranks.max(float(np.abs(u).max(initial=0.0)))
        with phase("verify"):
            if case.moving.any():
                reactions = system.residual(u, case.forces)
            reactions = model.supports.supported(reactions)
            if model.mesh.subdomain is not None:
                reactions = model.mesh.subdomain.fetch(reactions)
            inner = model.supports.on_masters(stress_load(model, self.groups, u))
            if self.initial is not None and self.system is not None:
                rounding = initial_noise(model, self.system.norm, self.tolerance, case.forces)
            else:
                rounding = 0.0
            forces = case.external, case.forces, reactions, inner
            balance = balance_of(model.mesh, *forces, max(noise, rounding), 3 * self._n_used)
            if tolerance is None:
                judge(solution, u, balance)
            initial = case.external - case.forces
            warnings += checks.check_rounding(noise, case.external, initial, reactions, model.supports)
            warnings += check_deformation(model, self.kinds, u)
        report = self._report(case, solution, reactions, balance, warnings)
        u0 = model.initial_displacement
        origin = Origin(self, model.version)
        return Result(model.mesh, self.groups, u, reactions, case.external, report, u0, origin, self.kinds)

    def release(self) -> None:
        """Let go of the matrix and what is made of it; another solution makes them anew."""
        if self.system is not None:
            release(self.system)
        self.system, self._solved = None, np.zeros(0, dtype=bool)

    def adjoint(self, load: Array, motion: Array) -> Array:
        """Return the displacement (n, 3) in m under a load alone, with supports displaced by a motion alone.

        Parameters
        ----------
        load : (n, 3) N.
        motion : (n, 3) m, read where a displacement is prescribed.

        Returns
        -------
        (n, 3) in m, without the loads, prescribed displacements and initial stress of the model.

        Raises
        ------
        ModelError
            A motion is given, and nothing is prescribed there.
        """
        self._follow()
        supports, load = self.model.supports, self.free.balanced(load)
        moved = np.where(supports.fixed, motion, 0.0)
        motions = self.ranks.any(np.array([motion.any(), moved.any()]))
        if motions[0] and not motions[1]:
            raise ModelError("nothing is prescribed on the part along this axis, so that it has no reaction")
        moving = self._parts_with(_any_axis(load != 0) | _any_axis(moved != 0))
        if not moving.any():
            return np.zeros_like(load)
        system = self._system_of(moving)
        displaced, at_rest = (displacements(self.model, system, u) for u in (moved, 0.0 * moved))
        return system.solve(load, displaced - at_rest, max(self.tolerance, ADJOINT_TOLERANCE))[0]

    def _report(
        self,
        case: LoadSet,
        solution: Solution,
        reactions: Array,
        balance: tuple[float, float],
        warnings: list[str],
    ) -> Report:
        own = self.model.mesh.own_nodes
        slaves = self.ranks.sum(sum(bool(own[slave // 3]) for slave in self.model.supports.slaves()))
        return Report(
            unknowns=3 * self._n_used - self._fixed - slaves,
            total_load=self.ranks.sum(case.external[own].sum(axis=0)),
            total_reaction=self.ranks.sum(reactions[own].sum(axis=0)),
            **quality(solution, balance),
            seconds=case.phase.seconds,
            warnings=warnings,
            notes=[*self.model.remarks(), *self.free.notes(case.moving)],
            skipped=self._skipped(case.moving),
            formulation=self.model.chosen(self.kinds),
        )

    def _at_rest(self) -> Array:
        """Return displacements (n, 3) that are 0 but for what is prescribed."""
        return np.where(self.model.supports.fixed, self.model.supports.values, 0.0)

    def _complete(self, u: Array, system: System, moving: Mask) -> Array:
        """Fill in what is prescribed on nodes without equations; parts that nothing moves stay at rest."""
        if len(system.nodes) < len(u):
            rest = self._at_rest()
            rest[system.nodes] = u[system.nodes]
            u = rest
        if not moving.all():
            u[self._used & ~moving[self.part]] = 0.0
        return u

    def _count(self, nodes: Mask) -> int:
        """Return how many of some nodes, a mask (n,), all ranks have."""
        return int(self.ranks.sum(int((nodes & self.model.mesh.own_nodes).sum())))

    def _skipped(self, moving: Mask) -> list[str]:
        """Return what this solution did without, in words."""
        skipped = []
        if not moving.any():
            skipped.append("assembly and solution, as nothing moves")
        elif not moving.all():
            count = self._count(~moving[self.part] & self._used)
            skipped.append(
                f"{int((~moving).sum())} of {len(moving)} parts ({count} nodes), as nothing moves them"
            )
        if moving.any() and self.system and self._still:
            skipped.append(f"{self._still} elements, as all their nodes are held")
        if self._fixed:
            skipped.append(f"{self._fixed} prescribed degrees of freedom")
        if self._n_unused:
            skipped.append(f"{self._n_unused} nodes without elements")
        if moving.any() and self.system:
            skipped += self.system.skipped
        return skipped


def _any_axis(mask: Mask) -> Mask:
    """Return mask.any(axis=1) of a mask (n, 3), faster."""
    return mask[:, 0] | mask[:, 1] | mask[:, 2]
