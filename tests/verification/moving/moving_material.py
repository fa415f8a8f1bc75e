"""Material moving through a fixed mesh: rotors, bars and pulses (ALE)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kratos_lite.ale import Motion, MotionMatrices, Rotation, Translation
from kratos_lite.analysis.modal import critical_rate
from kratos_lite.analysis.model import Model
from kratos_lite.analysis.stepping import integrate
from kratos_lite.assembly.sparsity_pattern import Pattern
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh import Block, Mesh
from kratos_lite.mesh.generators import annulus, box
from kratos_lite.model.loads.body import BodyForce
from kratos_lite.solvers.mass import Mass
from kratos_lite.typing import Array
from kratos_lite.verification.meshes import (
    body_forces,
    element,
    is_quadratic,
    keeps_linear_strains,
    kind_of,
    on_plane,
    warped,
)
from kratos_lite.verification.problem import Of, Problem, every
from kratos_lite.verification.scenes import SOIL
from tests.verification.moving.rotating_axes import INNER, OUTER

RATE = 30.0
WAVE = float(np.sqrt(SOIL.C[0, 0] / SOIL.density))
"""Speed of longitudinal waves, m/s."""


# ---- matrices of the motion ------------------------------------------------------------------------------


def matrices(motion: Motion, model: Model) -> dict[str, Array]:
    """Return G and H of a motion in a model as full matrices (n, n)."""
    groups, points = model.element_groups(), model.mesh.points
    pattern = Pattern(len(points), [group.nodes for group in groups])
    mass = Mass(points, groups, pattern, False)
    terms = MotionMatrices(motion, points, groups, pattern, mass)
    unit = np.eye(len(points))
    return {name: terms.times(getattr(terms, name), unit) for name in "GH"}


def unit_sum(name: str) -> Callable[[str], float]:
    """Return a function: Σ |G| or Σ |H| of the unit cube or simplex that turns about z, density 1."""

    def of(kind: str) -> float:
        shape = kind_of(kind).shape
        X = (shape.nodes + 1) / 2 if shape.cell == "hexahedron" else shape.nodes
        mesh = Mesh(X, [Block(element(kind), np.arange(len(X))[None])])
        own = matrices(Rotation("z"), Model(mesh, Isotropic3D(E=1.0, nu=0.3, density=1.0)))
        return float(np.abs(own[name]).sum())

    return of


def linear_fields(kind: str) -> float:
    """Return the largest error of G u = ∫ N ρ L A X dV for u = L X on distorted cells, relative."""
    model = Model(warped(kind, 2), SOIL)
    A = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 0]])
    L = np.random.default_rng(5).uniform(-1, 1, (3, 3))
    left = matrices(Rotation("z"), model)["G"] @ (model.mesh.points @ L.T)
    right = SOIL.density * body_forces(model.mesh, lambda X: X @ (L @ A).T)
    return float(np.abs(left - right).max() / np.abs(right).max())


# ---- rotor -----------------------------------------------------------------------------------------------


def rotor(
    kind: str, clamped: bool, radial: int = 4, around: int = 32, motion: Rotation | None = None
) -> Model:
    """Return an annulus in plane strain that turns at 30 rad/s or so, its hub clamped or free to grow."""
    mesh = annulus(INNER, OUTER, 0.2, (radial, around, 1), element(kind))
    model = Model(mesh, SOIL)
    model.fix(np.arange(mesh.n_nodes), "z")
    if clamped:
        model.fix("inner", "xy")
    else:
        r, angle = np.hypot(*mesh.points[:, :2].T), np.arctan2(mesh.points[:, 1], mesh.points[:, 0])
        for k, axis in enumerate("yxyx"):  # four points of the hub keep to their rays
            there = np.abs(np.angle(np.exp(1j * (angle - k * np.pi / 2)))) < 1e-9
            model.fix(there & (r < INNER + 1e-9), axis)
    model.add(motion or Rotation("z", rate=RATE))
    return model


def growth(clamped: bool) -> float:
    """Return u_r of the rim: u = -r + C1 J1(k r) + C2 Y1(k r), k = rate / c_p.

    No stress on the rim, and none or no displacement on the hub.
    """
    from scipy.special import jv, yv

    (lam, mu), k = SOIL.lame, RATE / WAVE

    def stress(f: Any, r: float) -> float:
        slope = k * f(0, k * r) - f(1, k * r) / r
        return float((lam + 2 * mu) * slope + lam * f(1, k * r) / r)

    held, free = [jv(1, k * INNER), yv(1, k * INNER)], [stress(jv, INNER), stress(yv, INNER)]
    rows = np.array([held if clamped else free, [stress(jv, OUTER), stress(yv, OUTER)]], dtype=float)
    c1, c2 = np.linalg.solve(rows, np.array([INNER if clamped else 2 * (lam + mu), 2 * (lam + mu)]))
    return float(-OUTER + c1 * jv(1, k * OUTER) + c2 * yv(1, k * OUTER))


def grown(clamped: bool) -> Callable[[str], float]:
    """Return a function: mean u_r of the rim / exact."""
    exact = growth(clamped)

    def of(kind: str) -> float:
        model = rotor(kind, clamped)
        rim = model.mesh.nodes("outer")
        X = model.mesh.points[rim, :2]
        u = model.solve().u[rim, :2]
        return float(((u * X).sum(axis=1) / np.linalg.norm(X, axis=1)).mean() / exact)

    return of


def antiplane(kind: str) -> Model:
    """Return an annulus that strains along z alone, equally through its width; its hub is held."""
    mesh = annulus(INNER, OUTER, 0.2, (3, 24, 1), element(kind))
    model = Model(mesh, SOIL)
    model.fix(np.arange(mesh.n_nodes), "xy")
    model.fix("inner", "z")
    independents = {tuple(np.round(mesh.points[i, :2], 9)): int(i) for i in mesh.nodes("z-")}
    for i in np.setdiff1d(np.arange(mesh.n_nodes), mesh.nodes("z-")):
        independent = independents[tuple(np.round(mesh.points[i, :2], 9))]
        if not model.supports.fixed[i, 2]:
            model.constrain((int(i), "z"), {(independent, "z"): 1.0})
    model.add(Rotation("z", rate=RATE))
    return model


def antiplane_frequency(n: int) -> float:
    """Return ω of n waves around at rest: J_n(k a) Y_n'(k b) = Y_n(k a) J_n'(k b), ω = k c_s."""
    from scipy.optimize import brentq
    from scipy.special import jv, jvp, yv, yvp

    def zero(k: float) -> float:
        return float(jv(n, k * INNER) * yvp(n, k * OUTER) - yv(n, k * INNER) * jvp(n, k * OUTER))

    k = np.linspace(0.5, 6.0, 400)
    values = np.array([zero(x) for x in k])
    first = int(np.flatnonzero(values[1:] * values[:-1] < 0)[0])
    return float(brentq(zero, k[first], k[first + 1]) * np.sqrt(SOIL.C[3, 3] / SOIL.density))


def shifted(n: int, sign: int) -> Callable[[str], float]:
    """Return a function: the frequency nearest to ω_n ± n rate / that."""

    def of(kind: str) -> float:
        exact = antiplane_frequency(n) + sign * n * RATE
        values, _ = antiplane(kind).complex_modes(10)
        return float(values.imag[np.argmin(np.abs(values.imag - exact))] / exact)

    return of


# ---- bar -------------------------------------------------------------------------------------------------


def bar(kind: str, n: int, length: float, tied: bool = False) -> Model:
    """Return a bar -length/2 … length/2 that strains along x alone, its sections whole where `tied`."""
    mesh = box((length, 1, 1), (n, 1, 1), element(kind), origin=(-length / 2, 0, 0))
    model = Model(mesh, SOIL)
    model.fix(np.arange(mesh.n_nodes), "yz")
    x = np.round(mesh.points[:, 0], 9)
    for section in np.unique(x) if tied else ():
        first, *others = np.flatnonzero(x == section).tolist()
        for node in others:
            model.constrain((node, "x"), {(first, "x"): 1.0})
    return model


def critical_speed(kind: str) -> float:
    """Return the speed at which a moving frame on a bar loses its stiffness / c_p."""
    model = bar(kind, 4, 6.0, tied=True)
    for end in (-3.0, 3.0):
        model.fix(np.flatnonzero(np.abs(model.mesh.points[:, 0] - end) < 1e-9)[:1], "x")
    model.add(Translation("x", rate=1.0, boundaries="natural"))
    return float(critical_rate(model, 1)[0] / WAVE)


def damped(kind: str) -> float:
    """Return u at the free end of a damped bar through which material flows / exact.

    (M - ρ v²) u'' + ρ α v u' + f = 0 with u(0) = 0 and u'(L) = 0.
    """
    length, speed, alpha, f = 10.0, 40.0, 60.0, 1e5
    model = bar(kind, 20, length)
    model.fix(on_plane(model.mesh, 0, -length / 2), "x")
    model.add(BodyForce((f, 0, 0)))
    model.add(Translation("x", rate=speed, boundaries="natural", damping=alpha))
    D, b = SOIL.C[0, 0] - SOIL.density * speed**2, SOIL.density * alpha * speed
    exact = f / b * (np.exp(b * length / D) * (-D / b) * (np.exp(-b * length / D) - 1) - length)
    end = on_plane(model.mesh, 0, length / 2)
    return float(model.solve().u[end, 0].mean() / exact)


def pulse(kind: str) -> float:
    """Return what is left of a pulse after it has met absorbing ends / its height, at 0.4 c_p."""
    speed, width = 0.4 * WAVE, 0.8
    model = bar(kind, 60, 20.0)
    x = model.mesh.points[:, 0]
    model.add(Translation("x", rate=speed, boundaries="absorbing"))
    u, v = np.zeros_like(model.mesh.points), np.zeros_like(model.mesh.points)
    u[:, 0] = np.exp(-(x**2) / (2 * width**2))
    v[:, 0] = -speed * x / width**2 * u[:, 0]
    transient = model.transient(displacement=u, velocity=v)
    *_, end = integrate(transient, 0.16 / 200, 200, every=200)
    return float(np.abs(end.u[:, 0]).max())


BRICKS: Of = lambda kind: kind_of(kind).shape.cell == "hexahedron"  # noqa: E731
SINGLE = {  # nodes of the element: Σ|G| and Σ|H|
    8: (7 / 6, 9 / 5),
    4: (1 / 10, 1 / 10),
}


def problem(
    name: str, quantity: str, source: str, of: Callable[[str], float], takes: Of = every,
    reference: float = 1.0, tolerance: float | None = None, exact: Of = every,
) -> Problem:  # fmt: skip
    """Return a problem of this family; its reference is 1 where its value is found / exact."""
    return Problem(
        name=f"ale/{name}", quantity=quantity, source=source, reference=reference, tolerance=tolerance, of=of,
        takes=takes, exact=exact,
    )  # fmt: skip


def _has(nodes: int) -> Of:
    return lambda kind: len(kind_of(kind).shape.nodes) == nodes


PROBLEMS: list[Problem] = [
    *(
        problem(f"unit_{name}_{nodes}", f"Σ |{name}| of the unit cell that turns about z, density 1",
                "Polynomials", unit_sum(name), _has(nodes), sums["GH".index(name)], 1e-12)
        for nodes, sums in SINGLE.items()
        for name in "GH"
    ),
    problem("linear_fields", "largest error of G u = ∫ N ρ L A X dV, u = L X", "Polynomials",
            linear_fields, reference=0.0, tolerance=1e-11),
    problem("growth_clamped", "growth of the rim of a rotor at 30 rad/s, hub clamped, 4 × 32 bricks / exact",
            "Bessel", grown(True), tolerance=2e-3, exact=is_quadratic),
    problem("growth_free", "growth of the rim of a rotor at 30 rad/s, hub free, 4 × 32 bricks / exact",
            "Bessel", grown(False), tolerance=2e-3, exact=is_quadratic),
    problem("shift_back", "antiplane frequency ω₁ - rate of a rotor, 3 × 24 bricks / exact", "Bessel",
            shifted(1, -1), BRICKS),
    problem("shift_ahead", "antiplane frequency ω₁ + rate of a rotor, 3 × 24 bricks / exact", "Bessel",
            shifted(1, 1), BRICKS),
    problem("critical_speed", "speed of a moving frame on a bar that takes its stiffness / c_p", "Dalembert",
            critical_speed, tolerance=1e-8, exact=keeps_linear_strains),
    problem("damped_bar", "end of a damped bar with material flowing through, 20 bricks / exact",
            "Newton: (M - ρ v²) u'' + ρ α v u' + f = 0", damped, tolerance=1e-3),
    problem("pulse", "what is left of a pulse after it has left through absorbing ends / its height",
            "Dalembert", pulse, BRICKS, 0.0, 5e-3),
]  # fmt: skip
"""The rows of this family."""
