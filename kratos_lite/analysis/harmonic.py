"""Harmonic response: the steady motion of a model under loads and supports that swing, by modes or directly.

u(t) = Re(u e^{iΩt}),   ((1 + iη) K + iΩ (α M + β K) - Ω² M) u = f.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Complex
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from kratos_lite.analysis.element_fields import ElementFields
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.fields import labelled
from kratos_lite.analysis.modal import natural_modes
from kratos_lite.analysis.nodal_loads import nodal_forces
from kratos_lite.assembly.element_groups import ElementGroup
from kratos_lite.errors import InputError, ModelError, SolveError
from kratos_lite.mesh import Mesh
from kratos_lite.model.loads import Load, ScaledLoad, TimeDependentLoad
from kratos_lite.model.loads.temperature import Temperature
from kratos_lite.model.matching import Cut
from kratos_lite.model.structure import Structure
from kratos_lite.solvers.plan import FALLBACK_LIMIT
from kratos_lite.tabular import Tabular, unit_name
from kratos_lite.typing import Array, ArrayLike, Complexes, Progress
from kratos_lite.validation import choice, finite, instance, number, short, whole_number

HarmonicLoads: TypeAlias = "Sequence[Load | tuple[Load, complex]]"
"""Loads, each alone or with a complex factor."""
METHODS = ("modes", "direct")
ENOUGH = 2.0
"""Frequency of the last mode that is taken over the largest one requested; the others answer statically."""
FIRST = 20
"""Modes that are looked for first."""
SINGULAR = 1e-8
"""Of ω² - Ω² beside ω², as frequencies of modes are known to 1e-9."""
LOW = 0.25
"""Of the first mode, up to which a largest frequency may be one in Hz that was meant in rad/s."""
UNDAMPED = "the frequency {:g} rad/s is that of an undamped mode; give damping, or leave it out"
TOLERANCE = 1e-12
"""Relative residual of the static solutions."""


@dataclass(frozen=True, eq=False, repr=False)
class HarmonicResponse(Tabular):
    """The steady motion Re(u e^{iΩt}) of a model at some frequencies; `Model.harmonic` makes it.

    Parameters
    ----------
    mesh : of n nodes.
    groups : the elements with their materials.
    frequencies : Ω (f,) in rad/s.
    basis : (b, n, 3) displacements in m, of which
    factors : (f, b) make the response at each frequency.
    natural : frequencies of the modes taken, in rad/s; none of the direct method.

    Notes
    -----
    It keeps a few displacements and their factors: all frequencies of a large mesh take no more room.
    """

    mesh: Mesh
    groups: list[ElementGroup]
    frequencies: Array
    basis: Any
    factors: Complexes
    natural: Array

    @property
    def units(self) -> str:  # type: ignore[override]
        """Set of units of the mesh, which all numbers are in."""
        return self.mesh.units

    def displacement(self, number: int) -> Complexes:
        """Return the complex displacement at one frequency.

        Parameters
        ----------
        number : of the frequency, from 0.

        Returns
        -------
        (n, 3) in m; np.abs is the amplitude, np.angle the phase.
        """
        f = len(self.frequencies)
        at = whole_number(number, "the number of a frequency", least=-f, most=f - 1)
        return np.tensordot(self.factors[at], self.basis, axes=1)

    def at(self, points: ArrayLike) -> Complexes:
        """Return the complex displacements of points at all frequencies.

        Parameters
        ----------
        points : (..., 3) in m of the undeformed mesh.

        Returns
        -------
        (f, ..., 3) in m; np.abs is the amplitude, np.angle the phase.

        Raises
        ------
        MeshError
            A point lies outside the mesh.
        """
        located = self.mesh.locate(points, required=True)
        parts = np.moveaxis(self.basis, 0, -1)
        values = np.moveaxis(located.interpolate(parts.real) + 1j * located.interpolate(parts.imag), -1, 0)
        return np.tensordot(self.factors, values, axes=1)

    def fields(self, number: int, phase: float = 0.0) -> ElementFields:
        """Return strains and stresses at one frequency and instant, without those at rest.

        Parameters
        ----------
        number : of the frequency, from 0.
        phase : Ωt in rad of the instant.

        Returns
        -------
        ElementFields
            Of Re(u e^{i phase}), with `stress`, `von_mises` and others, as results have them.
        """
        u = np.real(self.displacement(number) * np.exp(1j * finite(phase, "the phase", ())))
        return ElementFields(self.mesh, self.groups, np.ascontiguousarray(u))

    def table(self) -> list[tuple[str, str]]:
        """Return the rows of a summary: frequencies, method, and about the largest amplitude."""
        nodes = np.unique(np.linalg.norm(self.basis, axis=2).argmax(axis=1))  # where each part is largest
        size = np.linalg.norm(np.tensordot(self.factors, self.basis[:, nodes], axes=1), axis=2).max(axis=1)
        top = int(np.argmax(size))
        largest = np.linalg.norm(self.displacement(top), axis=1).max()
        method = f"{len(self.natural)} modes with static correction" if len(self.natural) else "direct"
        low, high = self.frequencies.min(), self.frequencies.max()
        first = self.natural.min() if len(self.natural) else 0.0
        note = f"all far below the first mode, {first:g} rad/s; give those in Hz times 2π"
        return [
            ("frequencies", f"{len(size)}, {low:g} … {high:g} rad/s"),
            ("method", method),
            ("largest amplitude", f"{largest:.6e} m at {self.frequencies[top]:g} rad/s"),
            *[("note", note)] * bool(high < LOW * first),
        ]

    def columns(self, point: ArrayLike) -> dict[str, Array]:
        """Return frequencies, amplitudes and phases of a point, as a data frame of pandas takes them.

        Parameters
        ----------
        point : (3,) in m.

        Returns
        -------
        (f,) each by headers with units: rad/s, m and rad.
        """
        u = self.at(finite(point, "a point", (3,)))
        return labelled({"frequency [rad/s]": self.frequencies, **amplitudes(u)}, self.units)

    def plot(self, point: ArrayLike, axis: str = "z", path: str | Path | None = None) -> Any:
        """Draw the amplitude of a point against the frequency, on logarithmic scales.

        Parameters
        ----------
        point : (3,) in m.
        axis : ``"x"``, ``"y"`` or ``"z"``.
        path : picture to write; .png, .pdf or .svg.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from kratos_lite.view.canvas import saved
        from kratos_lite.view.curves import response_figure

        component = "xyz".index(choice(axis, "axis", tuple("xyz")))
        amplitude = np.abs(self.at(finite(point, "in plot(point, axis, path), a point", (3,)))[:, component])
        unit = unit_name("m", self.units)
        return saved(response_figure(self.frequencies, amplitude, unit, f"amplitude of u{axis}"), path)


def amplitudes(u: Complexes) -> dict[str, Array]:
    """Return amplitudes and phases of complex displacements (k, 3) by headers."""
    made = dict[str, Array]()
    for i, axis in enumerate("xyz"):
        made |= {f"amplitude {axis} [m]": np.abs(u[:, i]), f"phase {axis} [rad]": np.angle(u[:, i])}
    return made


def harmonic_response(
    model: Structure,
    frequencies: ArrayLike,
    damping: ArrayLike,
    rayleigh: tuple[float, float],
    hysteretic: float,
    loads: HarmonicLoads | None,
    method: str,
    modes: int | None,
    progress: Progress | None,
) -> HarmonicResponse:
    """Return the harmonic response of a model; see `Model.harmonic`."""
    omega, zeta = np.atleast_1d(finite(frequencies, "frequencies")), finite(damping, "damping")
    if omega.ndim != 1 or not omega.size or (omega < 0).any():
        raise InputError(f"frequencies (f,) in rad/s are ≥ 0; got {short(frequencies)}")
    if not ((zeta >= 0) & (zeta < 1)).all():
        text = "damping is a ratio of the critical one, ≥ 0 and < 1, such as 0.02 for 2 per cent"
        raise InputError(f"{text}; got {short(damping)}")
    eta, by_modes = number(hysteretic, "hysteretic", least=0), choice(method, "method", METHODS) == "modes"
    if not by_modes and (zeta.any() or modes is not None):
        raise InputError("damping of modes and their number belong to method='modes'; take rayleigh=…")
    _check(model)
    solver = "auto" if by_modes else "direct"
    e = EquationsOfMotion(model, rayleigh=rayleigh, solver=solver, progress=progress)
    e.log_warnings()
    if by_modes and e.free_motions.any:
        raise ModelError("the supports leave rigid-body modes free, which method='direct' takes alone")
    if e.free_motions.any and not omega.all():
        raise ModelError(f"the frequency 0 needs supports that hold the body; {e.free_motions.described()}")
    alpha, beta = e.rayleigh
    f, c = _forces(model, e, loads), e.prescribed(0.0)
    if by_modes and c.any():  # supports move all of the body statically: what its inertia adds is smoother
        c = e.system.equations.solve(0 * c, TOLERANCE, progress, c).x
    vectors = np.stack([f.real, f.imag, 0 * c if by_modes else e.K @ c, e.mass.times(c)])
    k, m = 1 + 1j * (eta + omega * beta), omega * (1j * alpha - omega)  # factors of K and M
    factors = np.stack([1 + 0 * k, 1j + 0 * k, -k, -m], axis=1)  # of the vectors
    here = vectors.any(axis=1)
    swing = _by_modes if by_modes else _directly
    basis, made, natural = swing(e, vectors[here], factors[:, here], (k, m), (omega, zeta, modes))
    full, ones = np.concatenate([basis, e.system.scatter(c)[None]]), np.ones((len(omega), 1))
    return HarmonicResponse(model.mesh, e.groups, omega, full, np.hstack([made, ones]), natural)


def _directly(
    e: EquationsOfMotion, R: Array, s: Complexes, factors: Any, given: Any
) -> tuple[Any, Any, Array]:
    """Return the displacements (f, n, 3) at each frequency, by a factorization each."""
    from scipy.sparse.linalg import splu

    constraints, n, omega = e.system.constraint_map, len(e.system.constraint_map.free), given[0]
    if n > FALLBACK_LIMIT:
        raise InputError(f"method='direct' factorizes up to {FALLBACK_LIMIT} unknowns; got {n}; take modes")
    K, M = (constraints.reduce_matrix(A).tocsc() for A in (e.K.scipy().tocsr(), e.mass.matrix()))
    r, out = np.stack([constraints.reduce(vector) for vector in R] or [np.zeros(n)]), []
    s = s if len(R) else np.zeros((len(s), 1), dtype=complex)
    for k, m, some, rate in zip(*factors, s, omega, strict=True):
        try:
            A = splu((k * K + m * M).astype(complex))
        except RuntimeError:  # exactly singular
            raise SolveError(UNDAMPED.format(rate)) from None
        q = A.solve(some @ r)
        if np.linalg.norm(q) < SINGULAR * abs(m) * np.linalg.norm(A.solve(M @ q)):
            raise SolveError(UNDAMPED.format(rate))
        u = constraints.transform(q)
        out.append(e.system.scatter(u.real) + 1j * e.system.scatter(u.imag))
    return np.array(out), np.eye(len(s)), np.zeros(0)


def _by_modes(
    e: EquationsOfMotion, R: Array, s: Complexes, factors: Any, given: Any
) -> tuple[Any, Any, Array]:
    """Return modes with static solutions less their part (b, n, 3), and the factors (f, b) of all."""
    # What the modes leave of the response is that of K alone. Source: Craig & Kurdila, Fundamentals of
    # Structural Dynamics (2006), section 11.4 (mode acceleration).
    (k, m), (omega, zeta, count) = factors, given
    natural, shapes = _modes(e, count, ENOUGH * float(omega.max()))
    if zeta.shape not in ((), natural.shape):
        raise InputError(f"damping is one ratio, or one of each of {len(natural)} modes; got {zeta.shape}")
    loads = np.stack([e.system.scatter(r) for r in R]) if len(R) else np.zeros((0, *shapes.shape[1:]))
    P = np.einsum("lni,jni->lj", loads, shapes)
    denominators = k[:, None] * natural**2 + m[:, None] + 2j * zeta * natural * omega[:, None]
    if (singular := np.abs(denominators) < SINGULAR * natural**2).any():
        raise SolveError(UNDAMPED.format(omega[singular.any(axis=1)][0]))
    zero = np.zeros(e.size)
    statics = [e.system.equations.solve(r, TOLERANCE, e.system.progress, zero).x for r in R]
    rest = np.array([e.system.scatter(u) for u in statics]).reshape(-1, *shapes.shape[1:])
    basis = np.concatenate([shapes, rest - np.tensordot(P / natural**2, shapes, axes=1)])
    return basis, np.hstack([(s @ P) / denominators, s / k[:, None]]), natural


def _modes(e: EquationsOfMotion, count: int | None, top: float) -> tuple[Array, Array]:
    """Return so many modes, or all up to a frequency in rad/s and some beyond it."""
    if count is not None:
        return natural_modes(e.model, whole_number(count, "modes"), progress=e.system.progress)
    n = len(e.system.constraint_map.free)
    count = min(FIRST, n)
    while True:
        natural, shapes = natural_modes(e.model, count, progress=e.system.progress)
        if natural[-1] > top or count == n:
            return natural, shapes
        count = min(2 * count, n)


def _check(model: Structure) -> None:
    """Raise ModelError for what does not swing harmonically about a state at rest."""
    model.require_linear("harmonic response")
    if model.motion is not None:
        raise ModelError("harmonic response takes no motion of the material; take model.transient()")
    if model.supports.motions:
        raise ModelError("a support that is a function of time is no amplitude; prescribe a number")
    for tie in model.supports.ties:
        if isinstance(tie, Cut) and tie.length != 0.0:
            raise ModelError(
                f"{tie}: a bolt is at rest in the response about its tight state; lock it by "
                "model.pretension(a, b, length=0.0)"
            )


def _forces(model: Structure, e: EquationsOfMotion, loads: HarmonicLoads | None) -> Complexes:
    """Return the amplitudes (3a,) of the forces in N."""
    total = np.zeros(model.mesh.points.shape, dtype=complex)
    loads = model.loads if loads is None else instance(loads, "loads", (list, tuple), "[load]")
    for item in loads:
        load, factor = item if isinstance(item, tuple) and len(item) == 2 else (item, 1.0)
        instance(load, "a load", Load, "kl.Traction('z+', (0, 0, 1e3)), or (load, factor)")
        of = load.load if isinstance(load, ScaledLoad) else load
        if isinstance(of, (Temperature, TimeDependentLoad)):
            raise ModelError(f"{of!r} does not swing: harmonic response takes forces, each with a factor")
        if not isinstance(factor, Complex):
            raise InputError(f"the factor of a load is a complex number; got {factor!r}")
        finite(abs(factor), "the size of the factor of a load")
        for nodes, forces in nodal_forces(model, e.groups, [load]):
            np.add.at(total, nodes, complex(factor) * forces)
    return np.asarray(e.system.gather(total), dtype=complex)
