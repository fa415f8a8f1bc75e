"""Statics: from a model to displacements, one linear solve for each set of loads."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from kratos_lite import solvers
from kratos_lite.analysis.result import Report, Result
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.errors import InputError, ModelError, SolveError
from kratos_lite.mesh import Mesh
from kratos_lite.model import checks
from kratos_lite.model.loads import Load, check_loads
from kratos_lite.solvers.constrained_system import ConstrainedSystem, among
from kratos_lite.solvers.supports import resolve
from kratos_lite.typing import Array, Mask, Progress
from kratos_lite.validation import function_or_none

if TYPE_CHECKING:
    from kratos_lite.analysis.model import Model


class Phases:
    """Seconds spent in each named phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Measure the body of a ``with`` statement."""
        start = perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start


def solve_static(
    model: Model, solver: str = "auto", tolerance: float = 1e-10, progress: Progress | None = None
) -> Result:
    """Solve K u = f with the supports of a model eliminated; see `Model.solve`."""
    return StaticAnalysis(model, solver, tolerance, progress).solve()


@dataclass(eq=False)
class LoadSet:
    """Loads, their nodal forces (n, 3) in N alone and with initial stress, and the parts that they move."""

    loads: list[Load]
    external: Array
    forces: Array
    moving: Mask
    phase: Phases


def check_arguments(solver: str, tolerance: float, progress: Progress | None) -> None:
    """Raise InputError for arguments of a solution that are none."""
    if isinstance(tolerance, bool) or not isinstance(tolerance, (float, int)) or not 0 < tolerance < 1:
        raise InputError(f"tolerance must be a number between 0 and 1; got {tolerance!r}")
    function_or_none(progress, "progress must be a function of a phase and a share")
    solvers.choose(solver, 0)


class StaticAnalysis:
    """A model made ready to be solved for many load sets; made by `Model.system`.

    It follows its model: new prescribed values are taken over, and anything else that changed what K is
    (points, elements, materials, rules, which degrees of freedom are prescribed, constraints, initial
    stress) has it checked and made anew at the next solution.

    Attributes
    ----------
    equations : the `ConstrainedSystem` that is solved, or None as long as nothing has moved.
    """

    def __init__(
        self,
        model: Model,
        solver: str = "auto",
        tolerance: float = 1e-10,
        progress: Progress | None = None,
    ) -> None:
        check_arguments(solver, tolerance, progress)
        if model.motion is not None:
            raise ModelError("a model with a motion is solved by model.solve() or moves by model.transient()")
        self.model, self.solver, self.tolerance, self.progress = model, solver, tolerance, progress
        self._phase = Phases()
        self._prepare()

    def solve(self, loads: Sequence[Load] | None = None) -> Result:
        """Solve for some loads in place of those of the model, or for those of the model.

        Errors as of `Model.solve`.
        """
        self._follow()
        case = self._load(self.model.loads if loads is None else loads)
        return self._solve(case, case.moving)

    def solve_cases(self, cases: Mapping[str, Sequence[Load]]) -> dict[str, Result]:
        """Return the result of each load case by its name; see `Model.solve_cases`."""
        if not isinstance(cases, Mapping):
            raise InputError(f"load cases must map names to lists of loads; got {type(cases).__name__}")
        self._follow()
        loaded = {name: self._load(loads) for name, loads in cases.items()}
        moving = np.any([case.moving for case in loaded.values()], axis=0)
        return {name: self._solve(case, moving) for name, case in loaded.items()}

    # ---- what is kept from one solution to the next ------------------------------------------------

    def _prepare(self) -> None:
        """Check the model and take note of its state."""
        model = self.model
        self._state: list[Any] = []  # so that what fails below is tried again
        with self._phase("check"):
            self.groups, self.part, self.warnings = model.checked()
            self._used = self.part >= 0
            self._prescribe()
            self.initial = initial_loads(model, self.groups)
            self.equations: ConstrainedSystem | None = None
            self._solved = np.zeros(0, dtype=bool)  # parts in the equations
            self._still = 0  # elements left out of them
            self._state = model.state()

    def _prescribe(self) -> None:
        """Take note of the values that supports prescribe, and of what they hold at rest."""
        supports = self.model.supports
        links = resolve(supports, self._used) if supports.links else {}  # first, as it may refuse them
        self.links, self._values = links, supports.values.copy()
        moved = supports.fixed & (supports.values != 0)
        pushed = [slave for slave, (_, constant) in self.links.items() if constant]
        moved.flat[np.array(pushed, dtype=np.int64)] = True
        self._moved = _any_axis(moved)
        self._held = ~_any_axis(~supports.fixed) & ~self._moved
        self._fixed = int((supports.fixed if self._used.all() else supports.fixed[self._used]).sum())

    def _follow(self) -> None:
        """Take over what has changed in the model."""
        if not same_state(self._state, self.model.state()):
            self._prepare()
        elif not np.array_equal(self._values, self.model.supports.values):
            held = self._held
            self._prescribe()
            if self.equations and not np.array_equal(held, self._held):
                self.equations = None  # elements that were left out may be needed now
            elif self.equations:
                self.equations.prescribe(self.links)

    def _load(self, loads: Sequence[Load]) -> LoadSet:
        """Return the nodal forces of loads, and which parts are pushed or pulled by anything."""
        phase, self._phase = self._phase, Phases()
        for load in loads:
            if not isinstance(load, Load):
                raise InputError(f"a load such as Gravity or Traction is needed; got {type(load).__name__}")
        with phase("load"):
            mesh, fixed = self.model.mesh, self.model.supports.fixed
            external = external_loads(mesh, self.groups, loads)
            forces = external if self.initial is None else external - self.initial
            acts = forces != 0
            lost = np.flatnonzero(~self._used)
            lost = lost[_any_axis(acts[lost])]
            if len(lost):
                raise ModelError(f"node {mesh.node_ids[lost[0]]} carries a load but belongs to no element")
            moving = np.zeros(int(self.part.max()) + 1, dtype=bool)
            moving[self.part[(_any_axis(acts & ~fixed) | self._moved) & self._used]] = True
        return LoadSet(list(loads), external, forces, moving, phase)

    def _equations_of(self, moving: Mask) -> ConstrainedSystem:
        """Return the equations of the elements in moving parts, made anew only for a part that is new."""
        if self.equations is None or (moving & ~self._solved).any():
            model = self.model
            solved = moving if self.equations is None else moving | self._solved
            parts = solved[self.part] & self._used
            every, groups = among(self.groups, parts), among(self.groups, parts & ~self._held)
            self.equations = ConstrainedSystem(
                model.mesh.points,
                groups,
                model.supports,
                self.links,
                solver=self.solver,
                tolerance=self.tolerance,
                patterns=model.patterns,
                progress=self.progress,
            )
            self._still = sum(map(len, every)) - sum(map(len, groups))
            self._solved = solved
        return self.equations

    # ---- one solution ------------------------------------------------------------------------------

    def _solve(self, case: LoadSet, moving: Mask) -> Result:
        """Solve for a load set with the equations of all parts in `moving`."""
        model, phase = self.model, case.phase
        warnings = self.warnings + check_loads(case.loads, self.groups, case.forces, model.supports)
        u, reactions, noise = self._at_rest(), 0.0 - case.forces, 0.0
        solution = solvers.Solution(u, "none", "nothing moves: u = 0 needs no solution", 0, 0.0)
        if case.moving.any():
            with phase("assemble"):
                system = self._equations_of(moving)
                noise = float(np.finfo(float).eps * system.norm)
            with phase("solve"):
                u, solution = system.solve(case.forces)
                u = self._complete(u, system, case.moving)
                noise *= float(np.abs(u).max(initial=0.0))
        with phase("verify"):
            if case.moving.any():
                reactions = system.residual(u, case.forces)
            reactions = model.supports.carried(reactions)
            # Without loads, each prescribed degree of freedom may hold nothing but the rounding of K u.
            count = (3 * int(self._used.sum())) ** 0.5 if case.forces.any() else np.count_nonzero(reactions)
            balance = checks.equilibrium(model.mesh.points, case.external, reactions, noise * count)
            judge(solution, u, balance)
            initial = case.external - case.forces
            warnings += checks.check_rounding(noise, case.external, initial, reactions, model.supports)
        report = self._report(case, solution, reactions, balance, warnings)
        u0 = model.initial_displacement
        return Result(model.mesh, self.groups, u, reactions, case.external, report, u0)

    def _report(
        self,
        case: LoadSet,
        solution: solvers.Solution,
        reactions: Array,
        balance: tuple[float, float],
        warnings: list[str],
    ) -> Report:
        return Report(
            unknowns=3 * int(self._used.sum()) - self._fixed - len(self.links),
            total_load=case.external.sum(axis=0),
            total_reaction=reactions.sum(axis=0),
            **quality(solution, balance),
            seconds=case.phase.seconds,
            warnings=warnings,
            notes=list(self.model.notes),
            skipped=self._skipped(case.moving),
        )

    def _at_rest(self) -> Array:
        """Return displacements (n, 3) that are 0 but for what is prescribed."""
        return np.where(self.model.supports.fixed, self._values, 0.0)

    def _complete(self, u: Array, system: ConstrainedSystem, moving: Mask) -> Array:
        """Fill in what is prescribed on nodes without equations; parts that nothing moves stay at rest."""
        if len(system.nodes) < len(u):
            rest = self._at_rest()
            rest[system.nodes] = u[system.nodes]
            u = rest
        if not moving.all():
            u[self._used & ~moving[self.part]] = 0.0
        return u

    def _skipped(self, moving: Mask) -> list[str]:
        """Say what this solution did without."""
        said = []
        if not moving.any():
            said.append("assembly and solution, as nothing moves")
        elif not moving.all():
            count = int((~moving[self.part] & self._used).sum())
            said.append(
                f"{int((~moving).sum())} of {len(moving)} parts ({count} nodes), as nothing moves them"
            )
        if moving.any() and self.equations and self._still:
            said.append(f"{self._still} elements, as all their nodes are held")
        if self._fixed:
            said.append(f"{self._fixed} prescribed degrees of freedom")
        if not self._used.all():
            said.append(f"{int((~self._used).sum())} nodes without elements")
        if moving.any() and self.equations:
            said += self.equations.skipped
        return [*said, "load steps, as the law is linear", "mass", "strains and stresses until asked for"]


def quality(solution: solvers.Solution, balance: tuple[float, float]) -> dict[str, Any]:
    """Return how a solution was found and how good it is, by the names of a `Report`."""
    return {
        "solver": solution.method,
        "reason": solution.reason,
        "iterations": solution.iterations,
        "backward_error": solution.backward_error,
        "force_error": balance[0],
        "moment_error": balance[1],
    }


def judge(solution: solvers.Solution, u: Array, balance: tuple[float, float]) -> None:
    """Raise SolveError for a solution that does not solve its equations or is not in equilibrium."""
    if not np.isfinite(u).all() or solution.backward_error > 1e-8:
        raise SolveError(
            f"{solution.method} solver reached a backward error of {solution.backward_error:.1e} only; "
            "ask for a smaller tolerance, or look for very thin elements, very unlike stiffnesses or "
            "nearly free parts"
        )
    if max(balance) > 1e-2:
        raise SolveError(
            f"loads and reactions miss equilibrium by {balance[0]:.1e} (forces) and {balance[1]:.1e} "
            "(moments) of their size; look for very unlike stiffnesses, spurious modes or nearly free "
            "parts, and please report a model that has none"
        )


def external_loads(mesh: Mesh, groups: Sequence[ElementGroup], loads: Sequence[Load]) -> Array:
    """Return the nodal forces (n, 3) in N of all loads."""
    total = np.zeros_like(mesh.points)
    for load in loads:
        total += load.forces(mesh, groups)
    return total


def initial_loads(model: Model, groups: Sequence[ElementGroup]) -> Array | None:
    """Return ∫ B^T (σ0 - C ε0) dV: what prestress and stress-free displacement put on the nodes."""
    u0 = model.initial_displacement
    if u0 is None and model.prestress is None:
        return None
    start = np.zeros_like(model.mesh.points) if u0 is None else -u0
    return internal_load(model.mesh.points, groups, start)


def _any_axis(mask: Mask) -> Mask:
    """Return mask.any(axis=1) of a mask (n, 3), faster."""
    return mask[:, 0] | mask[:, 1] | mask[:, 2]


def same_state(state: list[Any], other: list[Any]) -> bool:
    """Return whether two states of a model are equal."""
    return len(state) == len(other) and all(
        np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b
        for a, b in zip(state, other, strict=True)
    )
