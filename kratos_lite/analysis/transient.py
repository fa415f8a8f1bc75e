"""Transient analysis: a model in time."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from kratos_lite.ale.checks import critical_rate_estimate, near_critical
from kratos_lite.analysis.derived_quantities import (
    acceleration_of_material,
    motion_summary,
    velocity_of_material,
)
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.integrators.base import INTEGRATORS, ModelIntegrator, check_stable
from kratos_lite.analysis.integrators.generalized_alpha import Newmark
from kratos_lite.analysis.modal import lowest_critical_rate
from kratos_lite.analysis.nonlinear_equations import NonlinearEquations
from kratos_lite.analysis.result import Result, result_of
from kratos_lite.analysis.solution_checks import check_deformation
from kratos_lite.analysis.state import MODEL_FIELDS, ModelInTime, State, check_state
from kratos_lite.errors import InputError, SolveError
from kratos_lite.model.loads.base import equal_loads
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.direct import one_thread
from kratos_lite.solvers.linear_solver import Solution
from kratos_lite.solvers.newton import SMALLEST_PART, in_parts
from kratos_lite.typing import Array, ArrayLike, Progress
from kratos_lite.validation import finite, flag, function_or_none

DIVERGED = 1e9  # displacements by the size of the model beyond which a motion has lost its stability
OFF_SUPPORT = 1e-6  # fraction of the largest displacement by which a state may miss its supports
OFF_BALANCE = 1e-4  # fraction of the largest force by which the accelerations of a state may miss the balance


class TransientAnalysis(ModelInTime):
    """A model that moves in time; made by `Model.transient`.

    Parameters
    ----------
    model : elements with density, supports, loads, and its motion if it has one.
    integrator : such as `Newmark()` (if not given), `HHT()`, `Bossak()`, `GeneralizedAlpha()` or
        `CentralDifference()`, or its name such as ``"hht"``.
    displacement, velocity : (n, 3) in m and m/s at the time 0; at rest if not given, and as the supports say
        where they hold.
    lumped : whether the mass stands in the nodes; central differences always lump it.
    rayleigh : α in 1/s and β in s of the damping α M + β K.
    progress : called with the phase and the fraction done, 0 … 1, while the equations are made.

    Attributes
    ----------
    equations : the equations of motion.
    integrator : the integrator.
    time, step : s, and number of steps taken.
    u, v, a : (3a,) of the nodes that elements use.

    Raises
    ------
    InputError
        An argument is wrong, or the displacement does not fit the supports.
    MeshError, ModelError
        The model is broken, or has what the integrator does not take.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0, density=1000.0))
    >>> bar.fix("z-")
    >>> bar.add(kl.Traction("z+", (0, 0, 1e3)))
    >>> top = [state.u[:, 2].max() for state in kl.integrate(bar.transient(), dt=1e-3, steps=100)]
    >>> print(f"{max(top):.2e} m, twice the static one")
    2.00e-03 m, twice the static one
    """

    def __init__(
        self,
        model: Structure,
        *,
        integrator: ModelIntegrator | str | None = None,
        displacement: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        lumped: bool = False,
        rayleigh: tuple[float, float] = (0.0, 0.0),
        progress: Progress | None = None,
    ) -> None:
        function_or_none(progress, "progress must be a function of a phase and a fraction")
        chosen = Newmark() if integrator is None else integrator
        self.integrator = INTEGRATORS[chosen]() if isinstance(chosen, str) else chosen
        if not isinstance(self.integrator, ModelIntegrator):
            raise InputError(f"an integrator such as Newmark() or its name is needed; got {integrator!r}")
        lumped = flag(lumped, "lumped") or self.integrator.lumps_mass
        kind = NonlinearEquations if model.is_nonlinear else EquationsOfMotion
        how: dict[str, Any] = {} if model.is_nonlinear else {"solver": "auto", "use": "steps"}
        e = kind(model, lumped=lumped, rayleigh=rayleigh, progress=progress, **how)
        self.equations = e
        e.warnings += equal_loads(model.loads, model.named_loads)
        self.integrator.check(e)
        super().__init__(model)
        self._monitor = CriticalRateMonitor(e)
        self._monitor.check(0.0)
        rest = np.zeros((e.system.n_nodes, 3))
        self.u = self._nodal(rest if displacement is None else displacement, "the initial displacement")
        self.v = self._nodal(rest if velocity is None else velocity, "the initial velocity")
        self._restored: State | None = None  # which has not gone on yet
        self._limit = DIVERGED * float(np.ptp(e.system.points, axis=0).max())
        start = e.prescribed.at_start()
        if displacement is not None:
            self._check_supports(self.u, start[0], "the initial displacement")
        elif jump := float(np.abs(e.prescribed.part(start[0])).max(initial=0.0)):
            e.warnings.append(
                f"supports are displaced by {jump:g} m at the start of a model at rest, which is struck: "
                "give the displacement of model.solve(), or let them move from 0"
            )
        self._start(*start)

    def _start(self, u: Array, v: Array, a: Array) -> None:
        """Take over what is prescribed at the start, and find the first acceleration."""
        replace = self.equations.prescribed.replace
        self.u, self.v = replace(self.u, u), replace(self.v, v)
        self.equations.commit(self.u, self.time)
        self.a = self._balanced(a)

    def _check_supports(self, u: Array, prescribed: Array, what: str) -> None:
        """Raise InputError if displacements (3a,) are not where the supports hold the model."""
        off = np.abs(self.equations.prescribed.part(u) - prescribed).reshape(-1, 3)
        node, axis = np.unravel_index(int(off.argmax()), off.shape)
        if off[node, axis] > OFF_SUPPORT * np.abs(u).max(initial=0.0):
            name = self.model.supports.name(3 * int(self.equations.system.nodes[node]) + int(axis))
            raise InputError(
                f"{what} does not fit the supports: {name} is {off[node, axis]:g} m off its prescribed value"
            )

    def _nodal(self, values: ArrayLike, what: str) -> Array:
        """Return nodal vectors (n, 3) as (3a,)."""
        vectors, n = finite(values, what), self.equations.system.n_nodes
        if vectors.shape != (n, 3):
            raise InputError(f"{what} needs shape ({n}, 3); got {vectors.shape}")
        return self.equations.system.gather(vectors).copy()

    def _balanced(self, prescribed: Array) -> Array:
        """Return a of M a = f - C v - K u + reactions, with the acceleration of what is prescribed."""
        e, time = self.equations, self.time
        force = e.load(time) - e.times_damping(self.v, time) - e.times_stiffness(self.u, time)
        return e.mass.solve_constrained(force, e.system.constraint_map, prescribed)

    # ---- steps -----------------------------------------------------------------------------------

    def critical_step(self) -> float:
        """Return the longest stable step in s; infinite for implicit integrators."""
        return self.integrator.critical_step(self.equations)

    def prepare(self, h: float, parts: int) -> None:
        """Make ready for steps of h s in so many parts; `kratos_lite.integrate` does."""
        e = self.equations
        self.check_unchanged()
        check_stable(str(self.integrator), h / parts, self.critical_step(), "Newmark()")
        e.step, self.parts = h / parts, parts
        if not self.step and self.model.supports.motions:
            self._start(*e.prescribed.at_start(e.step))
        elif self._restored is not None:
            self._settle(self._restored)
        self._restored = None

    def advance(self, h: float, count: int) -> None:
        """Take steps of h s; `kratos_lite.integrate` does."""
        self.check_unchanged()
        e, part = self.equations, h / self.parts
        for _ in range(count):
            now, before = (self.u, self.v, self.a), e.history
            try:
                with one_thread(), np.errstate(over="ignore", invalid="ignore"):
                    for k in range(self.parts):
                        now = self._step(now, self.time + k * part, part)
            except BaseException:
                e.history = before  # the step is not taken
                raise
            self._monitor.check(self.time + h)
            self.u, self.v, self.a = now
            self.time += h  # one after the other, so that a restart comes to the same times
            self.step += 1

    def _step(self, now: tuple[Array, Array, Array], start: float, h: float) -> tuple[Array, Array, Array]:
        """Return u, v, a after a step of h s, which is cut where laws do not converge."""

        def advance(done: float, fraction: float) -> int:
            nonlocal now
            now = self.integrator.step(self.equations, now, start + done * h, (fraction - done) * h)
            self.equations.commit(now[0], start + fraction * h)
            return 0

        if not self.model.is_nonlinear:
            advance(0.0, 1.0)
        elif error := in_parts(advance)[1]:
            raise SolveError(
                f"the step from t = {start:g} s to {start + h:g} s has no solution, cut to "
                f"{SMALLEST_PART:.1e} of its length: {error}; take smaller steps"
            )
        return now

    def diverged(self) -> bool:
        """Return whether displacements are beyond the divergence limit, or NaN."""
        return not np.abs(self.u).max(initial=0.0) < self._limit

    # ---- what is known at the time ---------------------------------------------------------------

    def state(self) -> State:
        """Return the model as it is now."""
        residual, imbalance, _ = self._residual()
        values = {name: self._whole(getattr(self, name)).copy() for name in "uva"}
        values["reactions"] = self.model.reactions(self._whole(residual), self._whole(self.u))
        values["imbalance"] = np.array(imbalance)
        values |= self.equations.history_values()
        return State("model", str(self.integrator), self.time, self.step, values, self.parts)

    def restore(self, state: State) -> None:
        """Go on from a state; an acceleration that does not balance is found anew.

        InputError for one that does not lie where the supports hold the model at its time.
        """
        self.check_state(state)
        u, v, a = (self.equations.system.gather(getattr(state, name)).copy() for name in "uva")
        time, step, e = float(state.time), state.step, self.equations
        self._check_supports(u, self.equations.prescribed(time), f"at t = {time:g} s the state")
        self.u, self.v, self.a, self.time, self.step = u, v, a, time, int(step)
        e.history = e.history_of(state.values, u, time)
        self._restored = state

    def check_state(self, state: State) -> State:
        """Return a state that is one of a model of this mesh; InputError for any other."""
        shape = (self.equations.system.n_nodes, 3)
        history = {name: values.shape for name, values in self.equations.history_values().items()}
        fields = dict.fromkeys(MODEL_FIELDS[:4], shape)
        return check_state(state, "model", {**fields, "imbalance": (), **history})

    def _settle(self, state: State) -> None:
        """Balance the acceleration of a state of another integrator, or of another load."""
        _, residual, largest = self._residual()
        other = abs(residual - float(state.values.get("imbalance", np.nan))) > OFF_BALANCE * largest
        if other or state.integrator != str(self.integrator):
            self.a = self._balanced(self.equations.prescribed.part(self.a))

    def _residual(self, state: State | None = None) -> tuple[Array, float, float]:
        """Return M a + C v + K u - f (3a,), its largest free component and the largest of its terms, in N."""
        e = self.equations
        with self._at(state) as (u, v, a, time):
            terms = e.mass.times(a), e.times_damping(v, time), e.times_stiffness(u, time), -e.load(time)
        residual = np.asarray(sum(terms))
        roundoff = 1e-11 * e.system.norm * float(np.abs(u).max(initial=0.0))  # of K u
        largest = max(roundoff, *(float(np.abs(term).max(initial=0.0)) for term in terms))
        free = e.system.constraint_map.reduce(residual)
        return residual, float(np.abs(free).max(initial=0.0)), largest

    def result(self, state: State | None = None) -> Result:
        """Return a state of this model, or that of now, as a result with strains and stresses.

        It has the loads of that time.  The backward error of its report is what M a + C v + K u - f leaves on
        free nodes, relative; None for integrators that do not take the balance at the end of a step.
        """
        e, at, residual = self.equations, self.state() if state is None else self.check_state(state), None
        model = self.model
        if self.integrator.balanced:
            _, free, largest = self._residual(at)
            residual = free / largest if largest else 0.0
        solution = Solution(at.u, str(self.integrator), f"step {at.step}, t = {at.time:g} s", 0, 0.0)
        warnings = [*e.warnings, *([] if model.is_nonlinear else check_deformation(model, e.groups, at.u))]
        report: dict[str, Any] = {
            "unknowns": len(e.system.constraint_map.free),
            "seconds": {},
            "warnings": warnings,
        }
        with self._at(at) as (u, _, _, time):
            fields = at.u.copy(), at.reactions.copy(), e.system.scatter(e.load_of_result(u, time)).copy()
            result = result_of(Result, None, model, e.groups_of_result(time), fields, solution, **report)
        result.report.backward_error = residual
        if e.terms is not None:
            result.report.motion = motion_summary(e, result, self._monitor.of_mesh, at.time)
        return result

    def reactions(self) -> Array:
        """Return M a + C v + K u - f (n, 3) in N: forces of supports and constraints, 0 where none act."""
        return self.model.reactions(self._whole(self._residual()[0]), self._whole(self.u))

    def energy(self, state: State | None = None) -> float:
        """Return ½ v·M v + ½ u·K u, K with what the motion adds: constant without loads and damping.

        With laws that are not linear, what they store takes the place of ½ u·K u.

        Parameters
        ----------
        state : of this model; that of now if not given.

        Returns
        -------
        float, J.
        """
        with self._at(state) as (u, v, _, time):
            return float(v @ self.equations.mass.times(v)) / 2 + self.equations.stored_energy(u, time)

    def material_velocity(self, state: State | None = None) -> Array:
        """Return the velocity of the material in space; see `kratos_lite.material_velocity`.

        Parameters
        ----------
        state : of this model; that of now if not given.

        Returns
        -------
        (n, 3) float, m/s.
        """
        with self._at(state) as (u, v, _, time):
            return self._whole(velocity_of_material(self.equations, u, v, time))

    def material_acceleration(self, state: State | None = None) -> Array:
        """Return the acceleration of the material in space; see `kratos_lite.material_acceleration`.

        Parameters
        ----------
        state : of this model; that of now if not given.

        Returns
        -------
        (n, 3) float, m/s².
        """
        with self._at(state) as at:
            return self._whole(acceleration_of_material(self.equations, *at))

    @contextmanager
    def _at(self, state: State | None) -> Iterator[tuple[Array, Array, Array, float]]:
        """Yield u, v, a (3a,) and the time, of now or of a state, to which laws go back meanwhile."""
        e, history = self.equations, self.equations.history
        if state is None:
            yield self.u, self.v, self.a, self.time
            return
        self.check_state(state)
        u, v, a = (e.system.gather(values) for values in (state.u, state.v, state.a))
        e.history = e.history_of(state.values, u, state.time)
        try:
            yield u, v, a, state.time
        finally:
            e.history = history

    def _whole(self, x: Array) -> Array:
        """Return vectors (3a,) as (n, 3) of all nodes."""
        return np.asarray(self.equations.system.scatter(x))


_log = logging.getLogger("kratos_lite")


class CriticalRateMonitor:
    """Checks the rate of a motion, and warns once when it comes near the critical one.

    `of_mesh` is the lowest critical rate of the mesh itself; None without a motion, or if it is estimated.
    """

    def __init__(self, e: EquationsOfMotion) -> None:
        self.equations, self.critical = e, np.inf
        self.of_mesh: float | None = None
        free = len(e.system.constraint_map.free)
        self._done = e.terms is None or not free or (e.terms.motion.steady and not e.rates(0.0)[0])
        if e.terms is None or self._done:
            return
        self.of_mesh = lowest_critical_rate(e)
        self.critical = critical_rate_estimate(e.terms) if self.of_mesh is None else self.of_mesh

    def check(self, time: float) -> None:
        """Warn if the rate of a time in s is near the critical one, and no warning came before."""
        e = self.equations
        if self._done or e.terms is None:
            return
        for text in near_critical(e.terms.motion, time, self.critical, self.of_mesh is not None):
            self._done = True
            e.warnings.append(f"at t = {time:g} s {text}" if time else text)
            if time:
                _log.warning("%s", e.warnings[-1])
