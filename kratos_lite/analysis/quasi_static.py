"""Quasi-static analysis: loads that grow in a pseudo-time, any law, large displacements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.analysis.nodal_loads import AppliedLoads, Temperatures, temperatures
from kratos_lite.analysis.prescribed_motion import PrescribedMotion
from kratos_lite.analysis.report import StepReport
from kratos_lite.analysis.result import Result, result_of
from kratos_lite.analysis.state import ModelInTime, State, check_state
from kratos_lite.assembly.block_matrix import BlockMatrix
from kratos_lite.assembly.gauss_point_fields import internal_load
from kratos_lite.assembly.nonlinear_assembly import NonlinearAssembly, States, named, unnamed
from kratos_lite.errors import InputError, ModelError, SolveError, naming
from kratos_lite.mesh.mesh import place_of
from kratos_lite.model.free_motions import free_motions
from kratos_lite.model.loads.temperature import heated
from kratos_lite.model.structure import Structure
from kratos_lite.model.supports import Supports
from kratos_lite.solvers.constrained_system import ConstrainedSystem
from kratos_lite.solvers.direct import one_thread
from kratos_lite.solvers.linear_solver import LinearSolver, Solution
from kratos_lite.solvers.newton import SMALLEST_PART, along_path, in_parts, newton
from kratos_lite.solvers.plan import Facts, Plan, choose
from kratos_lite.solvers.tangents import Changes, Tangents
from kratos_lite.typing import Array, Progress
from kratos_lite.validation import number, whole_number

Load: TypeAlias = tuple[Array, Changes]
"""Nodal forces (3a,) at some displacements, and their tangent."""
Response: TypeAlias = "tuple[Array, Array, BlockMatrix | None, Changes, States]"
"""Internal forces and load (3a,), tangents of both, or None where none is needed, and states."""
ROUNDING = 10 * float(np.finfo(float).eps)
"""Fraction of |K| |u| that rounding leaves of forces in balance."""
SLACK, SEARCHES = 0.8, 6
"""Line search: fraction of the work of the residual that a full correction may leave, and most trials."""


class QuasiStaticAnalysis(ModelInTime):
    """A model whose loads grow in a pseudo-time; made by `Model.quasi_static`.

    Each step is found by Newton's method with the consistent tangent.  A step that does not converge is cut
    into parts, over which loads and prescribed displacements grow linearly.

    Parameters
    ----------
    model : elements with any law, supports and loads.
    tolerance : relative residual at which a step has converged.
    iterations : most corrections of a step; one that needs more is cut.
    line_search : whether corrections are shortened that overshoot; thin bodies that bend go better without.
    arc_length : whether steps after the first, which is one of the load, have its length along the path of
        equilibrium, through limit points: the time is the load factor then, and may fall.  Loads are
        proportional to the time, ``amplitude=lambda t: t``, or constant.
    solver : of the corrections, as for `Model.solve`; with the arc length always ``"direct"``.
    progress : called with the phase and the fraction done, 0 … 1.

    Attributes
    ----------
    time, step : s, and number of steps taken.
    reports : a `StepReport` for each step, or part of one.
    work : work of loads and supports in J.

    Raises
    ------
    InputError
        An argument is wrong.
    MeshError, ModelError
        The model is broken, or its supports leave rigid motions free.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bar = kl.Model(kl.box(), kl.J2Plasticity3D(E=200e9, nu=0.3, yield_stress=200e6, hardening=2e9))
    >>> for side, axis in (("x-", "x"), ("y-", "y"), ("z-", "z")):
    ...     bar.fix(side, axis)
    >>> bar.fix("z+", "z", lambda t: 0.01 * t)
    >>> analysis = bar.quasi_static()
    >>> for state in kl.integrate(analysis, dt=0.5, steps=2):
    ...     print(f"{analysis.result().stress()[0, 0, 2] / 1e6:.2f} MPa")
    207.92 MPa
    217.82 MPa
    """

    def __init__(
        self,
        model: Structure,
        *,
        tolerance: float = 1e-8,
        iterations: int = 25,
        line_search: bool = False,
        arc_length: bool = False,
        solver: str = "auto",
        progress: Progress | None = None,
    ) -> None:
        self.tolerance = number(tolerance, "the tolerance", least=1e-14)
        self.iterations = whole_number(iterations, "iterations")
        self.line_search, self.progress = line_search, progress
        if model.motion is not None:
            raise ModelError("a model with a motion has no quasi-static analysis; leave the motion out")
        self.groups, self.warnings = model.checked()
        mesh, supports = model.mesh, model.supports
        what = mesh.points, self.groups, supports.constraint_map
        how: dict[str, Any] = {"patterns": model.patterns, "hanging": mesh.hanging}
        self.system = ConstrainedSystem(*what, **how, attached=model.attached)
        self.applied = AppliedLoads(model, self.system, self.groups, initial=False)
        self.assembly = assembly_of(model, self.system)
        self.solver, self.arc_length = solver, arc_length
        self._kept = ["load", "internal", "work", "rate", "curvature", "last"]  # in states, beside u
        self._kept += ["increment", "speed"] if arc_length else []
        super().__init__(model)
        self.u = np.zeros(3 * len(self.system.nodes))
        self._hold(supports)
        self.work = 0.0
        self.states = self.assembly.start()
        self.increment, self.speed = np.zeros_like(self.u), 0.0
        self.load, self.rate, self.curvature = (np.zeros_like(self.u) for _ in range(3))
        self.last = 0.0  # s, duration of the last part
        self._heat([])
        self.internal = self._forces(self.u)
        self.reports: list[StepReport] = []
        if arc_length:
            self._check_factor()

    def _heat(self, acting: Temperatures) -> None:
        """Let temperatures, each with a factor, act."""
        self.temperatures = [(factor, load) for factor, load in acting if factor]
        groups = heated(self.model.mesh, self.groups, self.temperatures)
        self.heating = [group.heating for group in groups]

    def _hold(self, supports: Supports) -> None:
        """Let the supports that act at a time hold the model."""
        mesh, large = self.model.mesh, any(group.element.finite for group in self.groups)
        x = mesh.points + self._whole(self.u) if large else mesh.points
        free_motions(mesh.replace(points=x), supports, self.groups).check((), moving=False)
        self.system.constraint_map = supports.constraint_map(self.system.nodes)
        self.prescribed = PrescribedMotion(supports, self.system)
        plan = choose(self.solver, Facts(len(self.system.constraint_map.free), use="steps"))
        if self.arc_length:
            plan = Plan("direct", "tangents beyond a limit point are not positive definite")
        symmetric, constant = self.assembly.symmetric and not self.arc_length, self.assembly.constant
        self.tangents = Tangents(self.system, plan, symmetric, self._at_rest, constant is not None)

    def _forces(self, u: Array) -> Array:
        """Return the internal forces (3a,) of the committed states at displacements (3a,)."""
        return self.assembly.evaluate(u, self.states, 0.0, self.heating, tangent=False)[0]

    def _check_factor(self) -> None:
        """Refuse loads that are no constant ones and a factor times others, and supports that move."""
        if temperatures(self.model, 1.0):
            raise InputError("the arc length scales loads, not temperatures; leave them out")
        f = [self._loads(self.u, t)[0] for t in (0.0, 1.0, 2.0)]
        if self.model.supports.motions or np.abs(f[2] - 2 * f[1] + f[0]).max() > 1e-9 * np.abs(f[1]).max():
            raise InputError(
                "the arc length scales loads: give them amplitude=lambda t: t, or none, and hold the supports"
            )
        if not np.abs(f[1] - f[0]).max() > 0:
            raise InputError("no load grows with the time; give one amplitude=lambda t: t for the arc length")

    # ---- steps -----------------------------------------------------------------------------------

    def prepare(self, h: float, parts: int) -> None:
        """Make ready for steps of h s in so many parts; `kratos_lite.integrate` does."""
        self.check_unchanged()
        self.parts = parts

    def advance(self, h: float, count: int) -> None:
        """Take steps of h s; `kratos_lite.integrate` does.

        SolveError for one that does not converge, however much it is cut; the last converged state is kept.
        """
        for _ in range(count):
            begin, before = self.time, self.u
            for k in range(self.parts):
                if self.speed:
                    self._advance_along(h / self.parts)
                else:
                    self._advance_to(begin + (k + 1) * h / self.parts)
            if not self.speed:
                self.time = begin + h
            if self.arc_length and not self.speed:
                self.increment = self.u - before
                self.speed = float(np.linalg.norm(self.increment[self.system.constraint_map.free])) / h
            self.step += 1

    def _advance_to(self, end: float) -> None:
        """Come to the loads of a time, in parts where one step does not converge."""
        acting = self.model.supports.acting(end)
        if not np.array_equal(acting.fixed, self.prescribed.supports.fixed):
            with naming(f"at t = {end:g} s"):
                self._hold(acting)
        start, begin, dead = self.time, self.load, self.applied(end)
        fields = self.prescribed.part(self.u), self.prescribed(end)
        cold, hot = self.temperatures, temperatures(self.model, end)

        def heat(fraction: float) -> None:
            self._heat([((1 - fraction) * w, T) for w, T in cold] + [(fraction * w, T) for w, T in hot])

        def advance(done: float, fraction: float) -> int:
            def load(u: Array) -> Load:
                more, tangent = self.applied.following(end, u)
                now = (1 - fraction) * begin + fraction * (dead + more)
                return now, [(nodes, fraction * k) for nodes, k in tangent]

            field = (1 - fraction) * fields[0] + fraction * fields[1]
            heat(fraction)
            with one_thread():
                u, known, residuals = self._newton(load, field, (fraction - done) * (end - start))
            time = start + fraction * (end - start)
            return self._commit(u, known, StepReport(time, tuple(residuals), fraction - done))

        done, error = in_parts(advance)
        if error:
            heat(done)
            limit = "the load may be beyond the limit load (prescribe displacements in its place), "
            raise SolveError(
                f"the step from t = {start:g} s to {end:g} s converges up to t = {self.time:g} s only, cut "
                f"to {SMALLEST_PART / 2:.1e} of its length: {error}; {limit if self.model.loads else ''}"
                "a law may soften, or its tangent be wrong: kratos-lite check my_law.py"
            )

    def _advance_along(self, h: float) -> None:
        """Go on along the path of equilibrium, in parts where one step does not converge."""

        def evaluate(u: Array, factor: float) -> tuple[float, Response]:
            return self._balance(u, self._loads(u, factor), h)

        def solve(u: Array, known: Response, residuals: list[float]) -> list[Array]:
            internal, force, K, tangent, _ = known
            unit = self._loads(u, 1.0)[0] - self._loads(u, 0.0)[0]
            assert K is not None
            forces = [unit, force - internal]
            return self.tangents.solve(K, tangent, forces, np.zeros_like(u), residuals, self.tolerance)

        def advance(done: float, fraction: float) -> int:
            length, free = (fraction - done) * self.speed * h, self.system.constraint_map.free
            with one_thread():
                u, time, known, residuals = along_path(
                    (self.u, self.time),
                    self.increment,
                    length,
                    free,
                    evaluate,
                    solve,
                    self.tolerance,
                    self.iterations,
                )
            self.increment = u - self.u
            return self._commit(u, known, StepReport(time, tuple(residuals), fraction - done))

        if error := in_parts(advance)[1]:
            raise SolveError(
                f"no equilibrium was found beyond the load factor {self.time:g}: {error}; take smaller "
                "steps, or prescribe displacements in place of loads"
            )

    def _loads(self, u: Array, time: float) -> Load:
        following, tangent = self.applied.following(time, u)
        return self.applied(time) + following, tangent

    def _commit(self, u: Array, known: Response, report: StepReport) -> int:
        """Keep what has converged; return the iterations."""
        internal, force, _, _, states = known
        h, old = report.time - self.time, self.rate
        if not self.arc_length:
            self.rate = (u - self.u) / h
            self.curvature = (self.rate - old) / (h + self.last) if self.last else 0.0 * old
            self.last = h
        self.work += float((internal + self.internal) @ (u - self.u)) / 2
        self.u, self.states, self.load, self.internal, self.time = u, states, force, internal, report.time
        self.reports.append(report)
        return report.iterations

    def _balance(
        self, u: Array, load: Load, dt: float, before: float = np.inf, heat: float = 0.0
    ) -> tuple[float, Response]:
        """Return the residual at displacements (3a,) over forces or those of heat, and what is known."""
        # After a residual before it that is small, this one is converged, as a rule, and needs no tangent.
        near = before <= self.tolerance**0.5
        internal, K, states = self.assembly.evaluate(u, self.states, dt, self.heating, tangent=not near)
        force, tangent = load
        scale = max(heat, *(float(np.linalg.norm(v)) for v in (force, internal, self.load, self.internal)))
        residual = float(np.linalg.norm(self.system.constraint_map.reduce(force - internal)))
        relative = residual / (scale or 1.0)
        if K is None and relative > self.tolerance:
            return self._balance(u, load, dt, heat=heat)
        known = float(np.linalg.norm(self.u) + np.linalg.norm(self.prescribed.part(u)))  # u may have run away
        if K is not None and residual <= ROUNDING * K.norm() * known:
            relative = min(relative, self.tolerance)
        return relative, (internal, force, K, tangent, states)

    def _newton(
        self, load: Callable[[Array], Load], field: Array, dt: float
    ) -> tuple[Array, Response, list[float]]:
        """Return displacements, what the law says there, and residuals under a load and a field."""
        # The iteration begins on the parabola through the last three states, or else at the last one.
        guess = self.u + dt * (self.rate + (dt + self.last) * self.curvature)
        jump, closer = (field - self.prescribed.part(u) for u in (self.u, guess))
        if np.abs(closer).max(initial=0.0) <= 0.5 * np.abs(jump).max(initial=0.0) and self.last:
            try:
                return self._newton_from(guess, closer, load, dt)
            except SolveError:
                pass  # the load does not go on as it did
        return self._newton_from(self.u, jump, load, dt)

    def _newton_from(
        self, start: Array, jump: Array, load: Callable[[Array], Load], dt: float
    ) -> tuple[Array, Response, list[float]]:
        """Return the same from a start, with a jump of what is prescribed."""
        reduce = self.system.constraint_map.reduce

        last, heat = np.inf, 0.0

        def evaluate(u: Array) -> tuple[float, Response]:
            nonlocal last, heat
            last, known = self._balance(u, load(u), dt, last, heat)
            if any(values is not None for values in self.heating):
                heat = heat or float(np.linalg.norm(known[0]))
            return last, known

        def correction(u: Array, known: Response, residuals: list[float]) -> Array:
            internal, force, K, tangent, _ = known
            assert K is not None
            first, r = len(residuals) == 1, force - internal
            moved = jump if first else 0.0 * jump
            if first and not self.u.any() and self.model.prestress is not None:
                # A prestress beyond yield is first relieved elastically: its forces are those of no law yet.
                K, rest = self.system.assembled(), np.zeros_like(self.assembly.points)
                r = force - internal_load(self.assembly.points, self.system.groups, rest).ravel()
            (du,) = self.tangents.solve(K, tangent, [r], moved, residuals, self.tolerance)
            exact = moved.any() or not self.line_search
            return du if exact else self._shortened(u, du, reduce(r), load, dt)

        return newton(start, evaluate, correction, self.tolerance, self.iterations, int(jump.any()))

    def _at_rest(self) -> LinearSolver:
        """Return what solves the body at rest."""
        system = self.system
        how = system.constraint_map, system.points, self.tangents.plan
        springs, K = system.attached and system.attached.K, self.assembly.constant
        K = system.assembled() if K is None else K
        return LinearSolver(K, *how, groups=system.groups, springs=springs)

    def _shortened(self, u: Array, du: Array, r: Array, load: Callable[[Array], Load], dt: float) -> Array:
        """Return a correction, shortened until the residual does little work over it."""
        # Source: Crisfield, Non-linear Finite Element Analysis, vol. 1 (1991), section 9.2.
        constraints = self.system.constraint_map
        q, s = du[constraints.free], 1.0
        before = float(q @ r)
        for _ in range(SEARCHES):
            forces = self.assembly.evaluate(u + s * du, self.states, dt, self.heating, tangent=False)[0]
            after = float(q @ constraints.reduce(load(u + s * du)[0] - forces))
            if after * before >= 0 or abs(after) <= SLACK * abs(before):
                break
            s *= float(np.clip(before / (before - after), 0.1, 0.5))
        return s * du

    def diverged(self) -> bool:
        """Return whether displacements are not finite."""
        return not np.isfinite(self.u).all()

    # ---- what is known at the time ---------------------------------------------------------------

    def state(self) -> State:
        """Return the model as it is now."""
        values = {"u": self._whole(self.u).copy(), "reactions": self._reactions()}
        values |= {name: np.array(getattr(self, name)) for name in self._kept} | named(self.states)
        return State("model", "quasi_static", self.time, self.step, values, self.parts)

    def check_state(self, state: State) -> State:
        """Return a state of a model of the same mesh, elements and laws.

        Raises
        ------
        InputError
            It is another one.
        """
        now = self.state()
        checked = check_state(state, "model", {name: np.shape(value) for name, value in now.values.items()})
        if checked.integrator != "quasi_static":
            raise InputError(f"this state was made by {state.integrator}, not by a quasi-static analysis")
        if other := state.values.keys() - now.values.keys():
            names = ", ".join(sorted(other))
            raise InputError(f"this state does not fit: it has {names}, of other laws or elements than here")
        return checked

    def restore(self, state: State) -> None:
        """Go on from a state of a model of the same mesh, elements and laws."""
        get = self.check_state(state).values
        self.u = self.system.gather(get["u"]).copy()
        for name in self._kept:
            setattr(self, name, get[name].copy() if get[name].ndim else float(get[name]))
        self.states = unnamed(get, self.states)
        self.time, self.step = float(state.time), int(state.step)
        self._heat(temperatures(self.model, self.time) if self.last else [])

    def _whole(self, values: Array) -> Array:
        return self.system.scatter(values)

    def _reactions(self) -> Array:
        return self.model.reactions(self._whole(self.internal - self.load), self._whole(self.u))

    def result(self, state: State | None = None) -> Result:
        """Return a state of this model, or that of now, with strains, stresses and internal variables."""
        if state is not None:
            now = self.state()
            self.restore(state)
            try:
                return self.result()
            finally:
                self.restore(now)
        model, loads, reactions = self.model, self._whole(self.load).copy(), self._reactions()
        steps = [report for report in self.reports if report.time <= self.time]
        way = f"{self.step} {'step' if self.step == 1 else 'steps'} to t = {self.time:g} s"
        solution = Solution(self.u, "newton", way, sum(step.iterations for step in steps), 0.0)
        report: dict[str, Any] = {"unknowns": len(self.system.constraint_map.free), "seconds": {}}
        report |= {"warnings": list(self.warnings), "steps": steps, "work": self.work}
        groups = [replace(g, states=s) for g, s in zip(self.groups, self.states, strict=True)]
        groups = heated(model.mesh, groups, self.temperatures)
        fields = self._whole(self.u).copy(), reactions, loads
        result = result_of(Result, None, model, groups, fields, solution, **report)
        result.report.backward_error = steps[-1].residuals[-1] if steps else None
        return result


def assembly_of(model: Structure, system: ConstrainedSystem) -> NonlinearAssembly:
    """Return the laws of a model in its equations."""
    u0 = model.initial_displacement
    gathered = None if u0 is None else system.gather(u0)
    place = partial(place_of, model.mesh)
    springs = system.attached.K if system.attached else None
    return NonlinearAssembly(system.points, system.groups, system.pattern, place, gathered, springs)


def solve_nonlinear(model: Structure, solver: str, tolerance: float, progress: Progress | None) -> Result:
    """Return the result of one step from the undeformed body to the loads of the time 1 s."""
    analysis = QuasiStaticAnalysis(model, tolerance=max(tolerance, 1e-8), solver=solver, progress=progress)
    analysis.prepare(1.0, 1)
    analysis.advance(1.0, 1)
    return analysis.result()
