"""Bodies in motion: tops, flight, pendulum, breathing; what integrators conserve."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kratos_lite.analysis.stepping import integrate
from kratos_lite.bodies import (
    Callback,
    FiniteElementBody,
    FixPoint,
    PseudoRigidBody,
    RigidBody,
    RigidLink,
)
from kratos_lite.bodies.rotations import exp
from kratos_lite.errors import KratosLiteError
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh.generators import box
from kratos_lite.model.loads.body import Gravity
from kratos_lite.model.mass_properties import MassProperties
from kratos_lite.verification.meshes import element
from kratos_lite.verification.problem import Problem
from tests.verification.moving.known_values import bounded

RUBBER = Isotropic3D(E=1e6, nu=0.3, density=1000.0)
SIDES, SPIN = (0.4, 0.6, 1.0), (0.05, 10.0, 0.05)
ELLIPTIC = 1.8540746773013719
"""K(1/2), the complete elliptic integral of the first kind."""


def agm(a: float, b: float) -> float:
    """Return the arithmetic-geometric mean: K(m) = π / (2 agm(1, √(1 - m))).

    >>> abs(np.pi / (2 * agm(1.0, 0.5**0.5)) - ELLIPTIC) < 1e-15
    True
    """
    while abs(a - b) > 4e-16 * a:
        a, b = (a + b) / 2, (a * b) ** 0.5
    return a


def top(inertia: tuple[float, ...], W: tuple[float, ...], integrator: str, angle: float = 0.0) -> RigidBody:
    """Return a rigid body of 1 kg with principal moments of inertia, turned about x, that spins."""
    shape = MassProperties(mass=1.0, inertia=np.diag(inertia))
    body = RigidBody(mass_properties=shape, integrator=integrator)
    body.rotate(exp([angle, 0.0, 0.0]))
    body.u[:3] = W
    return body


# ---- rigid tops --------------------------------------------------------------------------------------

TUMBLING = (1.0, 2.0, 3.0), (1e-3, 2.0, 1e-3)


def half_period() -> float:
    """Return half the period of the spin of the tumbling top, 2 K(m) / λ."""
    (a, b, c), W = TUMBLING
    squares = np.square(W)
    twice, square = float(squares @ (a, b, c)), float(squares @ (a * a, b * b, c * c))
    rate = np.sqrt((c - b) * (square - twice * a) / (a * b * c))
    left = 1 - (b - a) * (twice * c - square) / ((c - b) * (square - twice * a))
    return float(np.pi / agm(1.0, np.sqrt(left)) / rate)


def turns_over(_: str) -> float:
    """Return the time between the first two turns of the tumbling top about its intermediate axis."""
    body, times, h = top(*TUMBLING, "implicit"), list[float](), 0.02
    last = float(body.u[1])
    for state in integrate(body, h, 1200):
        if last * state.u[1] < 0:
            times.append(state.time - h * state.u[1] / (state.u[1] - last))
        last = float(state.u[1])
    return times[1] - times[0]


def momentum(integrator: str) -> Callable[[str], float]:
    """Return a function: the relative change of angular momentum of a free top over 20 s."""

    def of(_: str) -> float:
        body = top((5.0, 10.0, 1.0), (8.0, 0.02, 0.0), integrator)
        before = np.asarray(body.angular_momentum()).copy()
        list(integrate(body, 0.01, 2000, every=2000))
        return float(np.linalg.norm(body.angular_momentum() - before) / np.linalg.norm(before))

    return of


def heavy(W: float, angle: float) -> RigidBody:
    """Return a symmetric top whose weight of 20 N acts 1 m up its axis."""
    body = top((5.0, 5.0, 1.0), (0.0, 0.0, W), "implicit", angle)
    body.add(Callback(lambda q, u, t: np.r_[0, 0, 0, -20 * q[7], 20 * q[6], 0, 0, 0, 0]))
    return body


def lowest(W: float, angle: float) -> float:
    """Return the largest angle of the axis of a heavy top let go: the other root of Goldstein's cubic.

    With u = cos θ: β (1 - u²) = a² (u0 - u), a = J3 W / J1, β = 2 m g l / J1.
    """
    a, b, u0 = W / 5, 2 * 20 / 5, np.cos(angle)
    return float(np.arccos((a * a - np.sqrt(a**4 - 4 * b * (a * a * u0 - b))) / (2 * b)))


def nutation(W: float, angle: float, seconds: float) -> Callable[[str], float]:
    """Return a function: the largest angle of the axis of a heavy top."""

    def of(_: str) -> float:
        steps = round(seconds / 1e-3)
        return max(float(np.arccos(state.q[8])) for state in integrate(heavy(W, angle), 1e-3, steps))

    return of


# ---- simple mechanics --------------------------------------------------------------------------------


def thrown(_: str) -> float:
    """Return how far a projectile with drag f = -m v flies in 1.976 s."""
    body = RigidBody(box((0.2,) * 3, origin=(-0.1,) * 3), RUBBER)
    body.set_velocity((2.54, 0.0, 12.7))
    body.add(Gravity((0.0, 0.0, -9.81456)))
    m = float(body.mass)
    body.add(Callback(lambda q, u, t: np.r_[0, 0, 0, -m * u[3:]]))
    list(integrate(body, 1.976 / 1000, 1000, every=1000))
    return float(body.mass_center()[0])


def pendulum(_: str) -> float:
    """Return the period of a small cube on a massless rod of 1 m, let go from the level, g = π² m/s²."""
    period = 4 / np.pi * ELLIPTIC
    h = period / 400
    body = RigidBody(box((0.04,) * 3, origin=(0.98, -0.02, -0.02)), RUBBER, integrator="implicit")
    body.constrain(RigidLink((1, 0, 0), (0, 0, 0)))
    body.add(Gravity((0.0, 0.0, -(np.pi**2))))
    x = [1.0, *(float(body.position(np.array([1.0, 0, 0]))[0]) for _ in integrate(body, h, 408))]
    i = 204 + int(np.argmax(x[204:]))
    a, b, c = x[i - 1 : i + 2]
    return float(h * (i + (a - c) / (2 * (a - 2 * b + c))))


def pinned(_: str) -> float:
    """Return the rate at which a pinned bar, let go 30° off the vertical, passes the vertical."""
    tilt = np.radians(30)
    body = RigidBody(box((0.1, 0.1, 1.0), origin=(-0.05, -0.05, -0.5)), RUBBER, integrator="implicit")
    body.constrain(FixPoint([[-0.05, 0, -0.25], [0.05, 0, -0.25]]))
    body.add(Gravity(9.8 * np.array([0, np.sin(tilt), np.cos(tilt)])))
    angles, rates = [0.0], [0.0]
    for _state in integrate(body, 2e-3, 500):
        z, v = body.position(np.array([0, 0, 0.5])) - (0, 0, -0.25), body.velocity(np.array([0, 0, 0.5]))
        angles.append(float(np.arctan2(z[1], z[2])))
        rates.append(float((z[2] * v[1] - z[1] * v[2]) / (z @ z)))
    return float(np.interp(tilt, angles, rates))


PINNED = np.sqrt(2 * 9.8 * 0.25 * (1 - np.cos(np.radians(30))) / ((0.01 + 1) / 12 + 0.25**2))
FLIGHT = 2.54 * (1 - np.exp(-1.976))

# ---- deformable bodies -------------------------------------------------------------------------------

SIDE = 0.5
BREATHING = np.sqrt(12 * RUBBER.E / (1 - 2 * RUBBER.nu) / (RUBBER.density * SIDE**2))
SHEAR = np.sqrt(24 * RUBBER.lame[1] / (RUBBER.density * SIDE**2))


def cube() -> PseudoRigidBody:
    """Return a pseudo-rigid cube of 0.5 m."""
    return PseudoRigidBody(box((SIDE,) * 3, origin=(-SIDE / 2,) * 3), RUBBER, integrator="energy_momentum")


def pseudo_rigid_frequency(number: int) -> Callable[[str], float]:
    """Return a function: a frequency of the pseudo-rigid cube, rigid motions counted."""
    return lambda _: float(cube().frequencies()[number])


def turning_point(_: str) -> float:
    """Return the least stretch of the cube let go at 1.1."""
    body = cube()
    q = body.q.copy()
    q[:9] = 1.1 * np.eye(3).ravel()
    body.set_configuration(q)
    return min(float(state.q[0]) for state in integrate(body, 0.0183 / 400, 400))


def stiff_energy(_: str) -> float:
    """Return the relative change of energy of a stiff spinning pseudo-rigid box, ω h = 150."""
    origin = tuple(-np.array(SIDES) / 2)
    body = PseudoRigidBody(
        box(SIDES, origin=origin), Isotropic3D(2e11, 0.3, 1000.0), integrator="energy_momentum"
    )
    body.set_velocity(angular=SPIN)
    before = float(body.energy())
    list(integrate(body, 1e-3, 200, every=200))
    return float(body.energy()) / before - 1


def flying(kind: str) -> FiniteElementBody:
    """Return a box of 1 × 2 × 2 bricks, thrown and spinning, under gravity."""
    mesh = box(SIDES, (1, 2, 2), element(kind), origin=tuple(-np.array(SIDES) / 2))
    body = FiniteElementBody(mesh, RUBBER)
    body.set_velocity((1.0, 2.0, 3.0), SPIN)
    body.add(Gravity((0.0, 0.0, -9.81)))
    return body


def is_total_lagrangian(kind: str) -> bool:
    """Return whether an element takes large displacements: one with a B of its own may refuse them."""
    try:
        flying(kind)
    except KratosLiteError:
        return False
    return True


def flight(measure: Callable[[Any, Any], float]) -> Callable[[str], float]:
    """Return a function: what a measure says of the thrown box before and after 0.1 s."""

    def of(kind: str) -> float:
        before, body = flying(kind), flying(kind)
        list(integrate(body, 5e-3, 20, every=20))
        return measure(before, body)

    return of


def _fall(before: Any, after: Any) -> float:
    """Return the error of the mass center after 0.1 s, m."""
    exact = np.array([1.0, 2.0, 3.0]) * 0.1 + np.array([0, 0, -9.81]) * 0.1**2 / 2
    return float(np.abs(after.mass_center() - exact).max())


def _energy(before: Any, after: Any) -> float:
    return float(after.energy()) / float(before.energy()) - 1


def _angular(before: Any, after: Any) -> float:
    """Return the relative change of the angular momentum about the mass center."""
    a, b = (np.asarray(body.angular_momentum()) for body in (before, after))
    return float(np.linalg.norm(b - a) / np.linalg.norm(a))


def _momentum(kind: str) -> float:
    """Return the angular momentum about y at the start / exact ρ V (a² + c²) / 12 ω."""
    exact = 1000 * 0.24 * (SIDES[0] ** 2 + SIDES[2] ** 2) / 12 * SPIN[1]
    return float(flying(kind).angular_momentum()[1] / exact)


PROBLEMS: list[Problem] = [
    bounded("body/tumbling", "time between two turns about the intermediate axis, J = 1, 2, 3, s",
            "Landau: 2 K(m) / λ", half_period(), 1e-3, turns_over),
    *(
        bounded(f"body/momentum_{word}", f"change of momentum of a free top over 20 s, integrator {word}",
                "Koziara: conserved", 0, 1e-10, momentum(word))
        for word in ("momentum_conserving", "implicit")
    ),
    bounded("body/heavy_top", "largest angle of the fast heavy top let go at 0.05, rad", "Goldstein",
            lowest(50.0, 0.05), 1e-4, nutation(50.0, 0.05, 1.0)),
    bounded("body/nutating_top", "largest angle of the slower heavy top let go at 0.5, rad", "Goldstein",
            lowest(25.0, 0.5), 1e-4, nutation(25.0, 0.5, 2.0)),
    bounded("body/projectile", "way of a projectile with drag -m v in 1.976 s, m", "Newton: v (1 - exp(-t))",
            FLIGHT, 1e-5, thrown),
    bounded("body/pendulum", "period of a pendulum let go from the level, s",
            "Landau, section 11: 4 √(l/g) K(1/2)", 4 / np.pi * ELLIPTIC, 2e-4, pendulum),
    bounded("body/pinned_bar", "rate of a pinned bar at its lowest, rad/s", "Newton: energy of a solid bar",
            PINNED, 1e-4, pinned),
    bounded("body/breathing", "frequency of the breathing of a pseudo-rigid cube, rad/s", "Cohen", BREATHING,
            1e-10, pseudo_rigid_frequency(8)),
    bounded("body/shear", "frequency of the shear of a pseudo-rigid cube, rad/s", "Cohen", SHEAR, 1e-10,
            pseudo_rigid_frequency(5)),
    bounded("body/turning_point", "least stretch of a pseudo-rigid cube let go at 1.1", "Cohen: √(2 - 1.1²)",
            np.sqrt(2 - 1.1**2), 1e-4, turning_point),
    bounded("body/stiff_energy", "relative change of energy of a stiff spinning box, ω h = 150, 200 steps",
            "Simo: conserved", 0, 1e-10, stiff_energy),
    bounded("body/inertia", "angular momentum of a spinning box of finite elements / m (a² + c²)/12 ω",
            "Newton", 1, 1e-11, _momentum, is_total_lagrangian),
    bounded("body/fall", "error of the mass center of a thrown, tumbling box after 0.1 s, m",
            "Newton: v t + g t²/2", 0, 1e-11, flight(_fall), is_total_lagrangian),
    bounded("body/energy", "relative change of energy of the same", "Simo: conserved", 0, 1e-10,
            flight(_energy), is_total_lagrangian),
    bounded("body/angular_momentum", "relative change of its angular momentum", "Simo: conserved", 0, 1e-10,
            flight(_angular), is_total_lagrangian),
]  # fmt: skip
"""The rows of this family."""
