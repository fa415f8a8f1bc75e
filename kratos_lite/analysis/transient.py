"""Transient: a model in time."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.ale.checks import critical_rate_estimate, near_critical
from kratos_lite.analysis.equations_of_motion import DIRECT_MAX, EquationsOfMotion
from kratos_lite.analysis.modal import critical_rates
from kratos_lite.analysis.moment import Moment
from kratos_lite.analysis.outputs import result_of, velocity_of_material
from kratos_lite.analysis.prescribed_motion import Course, at_start, prescribed_part, with_prescribed
from kratos_lite.analysis.result import Result
from kratos_lite.analysis.schemes import CentralDifference, Implicit, newmark
from kratos_lite.analysis.steps import explicit_step, implicit_step, is_trapezoidal
from kratos_lite.assembly.finite_strain import highest_frequency
from kratos_lite.errors import InputError, ModelError, SolveError
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.blas import one_thread
from kratos_lite.typing import Array, Progress
from kratos_lite.validation import finite, flag, function_or_none, number, positive_step, whole_number

_log = logging.getLogger("kratos_lite")
ABSURD = 1e9
"""Displacements by the size of the model beyond which a motion has lost its stability."""
OFF_SUPPORT = 1e-6
"""Share of the largest displacement by which a moment may miss its supports."""
OFF_BALANCE = 1e-4
"""Share of the largest force by which the accelerations of a moment may miss the balance."""


def _version(model: Structure) -> list[Any]:
    """Return what must stay as it is while a transient of a model goes on; equal as long as it does."""
    return [model.version, model.supports.value_version, model.motion, *model.loads]


class Transient:
    """A model that moves in time; made by `Model.transient`.

    Parameters
    ----------
    model : elements with density, supports, loads, and its motion if it has one.
    scheme : `newmark()`, `hht()`, `bossak()`, `generalized_alpha()` or `CentralDifference()`.
    displacement, velocity : (n, 3) at the time 0; at rest if not given, and as the supports say where they
        hold.
    lumped : whether the mass stands in the nodes; central differences always lump it.
    rayleigh : α in 1/s and β in s of the damping α M + β K.

    Attributes
    ----------
    equations : the equations of motion.
    time, step : s, and number of steps taken.
    u, v, a : (3a,) of the nodes that elements use.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0, density=1000.0))
    >>> bar.fix("z-")
    >>> bar.add(kl.Traction("z+", (0, 0, 1e3)))
    >>> top = [moment.u[:, 2].max() for moment in Transient(bar).march(dt=1e-3, steps=100)]
    >>> print(f"{max(top):.2e} m, twice the static one")
    2.00e-03 m, twice the static one
    """

    def __init__(
        self,
        model: Structure,
        *,
        scheme: Implicit | CentralDifference | None = None,
        displacement: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        lumped: bool = False,
        rayleigh: tuple[float, float] = (0.0, 0.0),
        progress: Progress | None = None,
    ) -> None:
        function_or_none(progress, "progress must be a function of a phase and a share")
        self.scheme = newmark() if scheme is None else scheme
        if not isinstance(self.scheme, (Implicit, CentralDifference)):
            raise InputError(f"a scheme such as newmark() or CentralDifference() is needed; got {scheme!r}")
        explicit = isinstance(self.scheme, CentralDifference)
        self.progress = progress
        self.equations = EquationsOfMotion(
            model, lumped=flag(lumped, "lumped") or explicit, rayleigh=rayleigh, progress=progress
        )
        if explicit and self.equations.terms is not None:
            raise ModelError("central differences do not take a motion of the material; use newmark()")
        if explicit and model.supports.constraints:
            raise ModelError("central differences do not take constraints; use newmark()")
        self._version = _version(model)
        self._critical, self._of_mesh = self._critical_rate()
        self._watching = self._critical < np.inf
        self._watch_rate(0.0)
        self.time, self.step = 0.0, 0
        rest = np.zeros((self.equations.system.n_nodes, 3))
        self.u = self._nodal(rest if displacement is None else displacement, "the initial displacement")
        self.v = self._nodal(rest if velocity is None else velocity, "the initial velocity")
        self._untouched = True
        self._imbalance_then: float | None = None  # of a moment that was put and has not gone on yet
        course = at_start(self.equations)
        if displacement is not None:
            self._check_supports(self.u, course[0], "the initial displacement")
        elif jump := float(np.abs(prescribed_part(self.equations, course[0])).max(initial=0.0)):
            self.equations.warnings.append(
                f"supports are displaced by {jump:g} m at the start of a model at rest, which is struck: "
                "give the displacement of model.solve(), or let them move from 0"
            )
        self._start(*course)

    def _start(self, u: Array, v: Array, a: Array) -> None:
        """Take over what is prescribed at the start, and find the first acceleration."""
        e = self.equations
        self.u, self.v = with_prescribed(e, self.u, u), with_prescribed(e, self.v, v)
        self.a = self._balanced(a)

    def _check_supports(self, u: Array, prescribed: Array, what: str) -> None:
        """Raise InputError if displacements (3a,) are not where the supports hold the model."""
        off = np.abs(prescribed_part(self.equations, u) - prescribed).reshape(-1, 3)
        node, axis = np.unravel_index(int(off.argmax()), off.shape)
        if off[node, axis] > OFF_SUPPORT * np.abs(u).max(initial=0.0):
            name = self.equations.model.supports.name(3 * int(self.equations.system.nodes[node]) + int(axis))
            raise InputError(
                f"{what} does not fit the supports: {name} is {off[node, axis]:g} m off from where it is held"
            )

    def _nodal(self, values: ArrayLike, what: str) -> Array:
        """Return nodal vectors (n, 3) as (3a,)."""
        given, n = finite(values, what), self.equations.system.n_nodes
        if given.shape != (n, 3):
            raise InputError(f"{what} needs shape ({n}, 3); got {given.shape}")
        return self.equations.system.gather(given).copy()

    def _balanced(self, prescribed: Array) -> Array:
        """Return a of M a = f - C v - K u + reactions, with the acceleration of what is prescribed."""
        e, time = self.equations, self.time
        force = e.load(time) - e.times_damping(self.v, time) - e.times_stiffness(self.u, time)
        return e.solver(time, 1.0, 0.0, 0.0)(force, prescribed)

    # ---- marching --------------------------------------------------------------------------------

    def march(
        self,
        dt: float,
        steps: int,
        *,
        every: int = 1,
        until: Callable[[Moment], bool] | None = None,
    ) -> Iterator[Moment]:
        """Advance and yield moments.

        Parameters
        ----------
        dt : step in s, > 0.
        steps : number of steps.
        every : a moment is yielded after so many steps, and after the last.
        until : function of a moment; the march ends when it is true.

        Raises
        ------
        InputError
            A number is wrong, or the step is beyond the stability of central differences.
        SolveError
            The matrix of a step is singular, or the motion is no longer finite.
        """
        function_or_none(until, "until must be a function of a moment")
        h, steps, every = positive_step(dt), whole_number(steps, "steps"), whole_number(every, "every")
        if self._version != _version(self.equations.model):
            raise ModelError("the model has changed since this transient was made; make a new one and put()")
        if isinstance(self.scheme, CentralDifference):
            self._check_stable(h)
        self.equations.step = h
        if self._untouched and self.equations.model.supports.motions:
            self._start(*at_start(self.equations, h))
        elif self._imbalance_then is not None:
            self._settle()
        self._untouched = False
        return self._moments(h, steps, every, until)

    def _moments(
        self,
        h: float,
        steps: int,
        every: int,
        until: Callable[[Moment], bool] | None,
    ) -> Iterator[Moment]:
        beyond = ABSURD * float(np.ptp(self.equations.system.points, axis=0).max())
        for done in range(1, steps + 1):
            with one_thread(), np.errstate(over="ignore", invalid="ignore"):
                self.u, self.v, self.a = self._step((self.u, self.v, self.a), h)
            self._watch_rate(self.time + h)
            self.time += h  # one after the other, so that a restart comes to the same times
            self.step += 1
            if done % every and done < steps:
                continue
            if not np.abs(self.u).max(initial=0.0) < beyond:  # nor is what is not a number
                raise SolveError(
                    f"the motion grows without bound: at t = {self.time:g} s it is beyond {ABSURD:g} times "
                    "the size of the model; are the step and the rate stable, and all units SI?"
                )
            if self.progress:
                self.progress("march", done / steps)
            moment = self.moment()
            yield moment
            if until and until(moment):
                return

    def _step(self, now: Course, h: float) -> Course:
        """Return displacement, velocity and acceleration a step later."""
        if isinstance(self.scheme, CentralDifference):
            return explicit_step(self.equations, now, self.time, h)
        return implicit_step(self.equations, self.scheme, now, self.time, h)

    def _critical_rate(self) -> tuple[float, bool]:
        """Return the lowest critical rate, and whether it is that of the mesh; infinite without a motion."""
        e = self.equations
        moves = e.terms is not None and len(e.system.reduced.free)
        if e.terms is None or not moves or (e.terms.motion.steady and not e.rates(0.0)[0]):
            return np.inf, False
        if len(e.system.reduced.free) <= DIRECT_MAX and not e.free_motions:
            return float(critical_rates(e, 1)[0]), True
        return critical_rate_estimate(e.terms), False

    def _watch_rate(self, time: float) -> None:
        """Warn once, when the rate comes near the critical one."""
        e = self.equations
        if not self._watching or e.terms is None:
            return
        for text in near_critical(e.terms.motion, time, self._critical, self._of_mesh):
            self._watching = False
            e.warnings.append(f"at t = {time:g} s {text}" if time else text)
            if time:
                _log.warning("%s", e.warnings[-1])

    def _check_stable(self, h: float) -> None:
        e = self.equations
        omega = highest_frequency(e.system.points, e.system.groups, lumped=True)
        alpha, beta = e.rayleigh
        xi = alpha / (2 * omega) + beta * omega / 2
        critical = 2 / omega * (np.sqrt(1 + xi * xi) - xi)
        if h > critical * (1 + 1e-9):
            raise InputError(
                f"central differences are not stable with steps of {h:g} s: the critical step is "
                f"{critical:.4g} s; take a shorter step or newmark()"
            )

    # ---- what is known at the time ---------------------------------------------------------------

    def moment(self) -> Moment:
        """Return the model as it is now."""
        system = self.equations.system
        u, v, a = (system.scatter(x).copy() for x in (self.u, self.v, self.a))
        left = self._left()
        reactions = self.equations.model.supports.supported(system.scatter(left))
        return Moment(self.time, self.step, u, v, a, reactions, self._free_part(left))

    def put(self, moment: Moment) -> None:
        """Go on from a moment, such as `Moment.load` gives, of this model or of one that was held otherwise.

        Raises
        ------
        InputError
            It is no moment, has another size, or does not lie where the supports hold the model at its time.
        """
        if not isinstance(moment, Moment):
            raise InputError(f"a Moment is needed, such as Moment.load gives; got {type(moment).__name__}")
        u, v, a = (self._nodal(getattr(moment, name), f"{name} of a moment") for name in "uva")
        time, step = number(moment.time, "the time of a moment"), moment.step
        if time < 0 or isinstance(step, bool) or not isinstance(step, (int, np.integer)) or step < 0:
            raise InputError(f"a moment has a time and a number of steps ≥ 0; got {time:g} s and {step!r}")
        self._check_supports(u, self.equations.prescribed(time), f"at t = {time:g} s the moment")
        self.u, self.v, self.a, self.time, self.step = u, v, a, time, int(step)
        self._untouched, self._imbalance_then = not step, moment.imbalance

    def _settle(self) -> None:
        """Balance the acceleration of a moment of another load, or of a scheme that does not balance it."""
        left, largest = self._imbalance(self.u, self.v, self.a, self.time)
        assert self._imbalance_then is not None
        other = abs(left - self._imbalance_then) > OFF_BALANCE * largest
        if other or (is_trapezoidal(self.scheme) and left > OFF_BALANCE * largest):
            self.a = self._balanced(prescribed_part(self.equations, self.a))
        self._imbalance_then = None

    def _terms(self, u: Array, v: Array, a: Array, time: float) -> list[Array]:
        """Return M a, C v, K u and -f, (3a,) in N."""
        e = self.equations
        return [e.times_mass(a), e.times_damping(v, time), e.times_stiffness(u, time), -e.load(time)]

    def _left(self) -> Array:
        """Return M a + C v + K u - f, (3a,) in N."""
        return np.asarray(np.sum(self._terms(self.u, self.v, self.a, self.time), axis=0))

    def _imbalance(self, u: Array, v: Array, a: Array, time: float) -> tuple[float, float]:
        """Return the largest free component of M a + C v + K u - f, and the largest of its terms, in N."""
        terms = self._terms(u, v, a, time)
        # rounding of K u comes in
        noise = 1e-10 * float(np.abs(self.equations.K.data).max() * np.abs(u).max(initial=0.0))
        largest = max(noise, *(float(np.abs(term).max(initial=0.0)) for term in terms))
        return self._free_part(np.sum(terms, axis=0)), largest

    def _free_part(self, forces: Array) -> float:
        """Return the largest free component of forces (3a,)."""
        return float(np.abs(self.equations.system.reduced.reduce(forces)).max(initial=0.0))

    def result(self, moment: Moment | None = None) -> Result:
        """Return a moment, or now, as a `Result` with strains and stresses; its loads are those of that time.

        The backward error of its report is what M a + C v + K u - f leaves on free nodes, relative; None for
        schemes that do not take the balance at the end of a step.
        """
        at, local, left = self.moment() if moment is None else moment, self.equations.system.gather, None
        if is_trapezoidal(self.scheme):
            free, largest = self._imbalance(local(at.u), local(at.v), local(at.a), at.time)
            left = free / largest if largest else 0.0
        critical = self._critical if self._of_mesh else None
        return result_of(self.equations, at, self.scheme.name, left, critical)

    def reactions(self) -> Array:
        """Return M a + C v + K u - f where supports or constraints act, (n, 3) in N; 0 elsewhere."""
        return self.equations.model.supports.supported(self.equations.system.scatter(self._left()))

    def energy(self, moment: Moment | None = None) -> float:
        """Return ½ v·M v + ½ u·K u in J, K with what the motion adds: constant without loads and damping.

        It is that of now, or of a moment.
        """
        e, (u, v, time) = self.equations, self._at(moment)
        return float(v @ e.times_mass(v) + u @ e.times_stiffness(u, time)) / 2

    def material_velocity(self, moment: Moment | None = None) -> Array:
        """Return the velocity of the material in space, now or at a moment; see `material_velocity`."""
        e, (u, v, time) = self.equations, self._at(moment)
        return e.system.scatter(velocity_of_material(e, u, v, time))

    def _at(self, moment: Moment | None) -> tuple[Array, Array, float]:
        """Return u, v (3a,) and the time, of now or of a moment."""
        if moment is None:
            return self.u, self.v, self.time
        local = self.equations.system.gather
        return local(moment.u), local(moment.v), moment.time
