"""Checks of a kind of body: what every kind must do, whatever its vectors look like."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from kratos_lite.analysis.stepping import integrate
from kratos_lite.bodies.body import Body, Deformable
from kratos_lite.bodies.rotations import exp
from kratos_lite.errors import InputError
from kratos_lite.materials.isotropic3d import Isotropic3D
from kratos_lite.mesh.generators import box
from kratos_lite.testing.report import Finding, Measured, difference, largest, run
from kratos_lite.typing import Array

Make: TypeAlias = Callable[[], Body]

SIDES = (0.4, 0.6, 1.0)
MASS = 240.0
FLIGHT, SPIN = np.array([1.0, 2.0, 3.0]), np.array([0.5, 8.0, -0.3])
TURN = exp([0.4, -1.1, 0.7])


def check_body(kind: type[Body]) -> list[Finding]:
    """Check a kind of body on a box: mass, momenta, forces, and its internal forces if it deforms."""
    if not (isinstance(kind, type) and issubclass(kind, Body)):
        raise InputError(f"check a class of bodies, such as RigidBody; got {kind!r}")

    def make() -> Body:
        mesh = box(SIDES, (1, 1, 2))
        return kind(mesh, Isotropic3D(E=1e6, nu=0.3, density=1000.0))  # type: ignore[call-arg]

    return run(CHECKS + (DEFORMABLE if issubclass(kind, Deformable) else ()), make)


def _moving(make: Make) -> Body:
    body = make()
    body.rotate(TURN)
    body.set_velocity(FLIGHT, SPIN)
    return body


def _stirred(make: Make) -> Body:
    """Return a body with a velocity without symmetry, and so a configuration if it deforms."""
    body, rng = _moving(make), np.random.default_rng(0)
    if isinstance(body, Deformable):
        body.set_configuration(body.q + 0.01 * rng.uniform(-1, 1, body.q.shape))
    body.u[...] = rng.uniform(-1, 1, body.u.shape)
    return body


def _points(body: Body) -> Array:
    return np.asarray(body.center + np.random.default_rng(1).uniform(-0.5, 0.5, (5, 3)) * SIDES)


# ---- every kind ------------------------------------------------------------------------------------


def rigid_velocity(make: Make) -> Measured:
    """Check that `set_velocity` gives v + ω × (x - x̄)."""
    body = _moving(make)
    X = _points(body)
    expected = FLIGHT + np.cross(SPIN, body.position(X) - body.mass_center())
    return Measured(difference(body.velocity(X), expected), 1e-12, "velocity(X) after turn and set_velocity")


def momenta(make: Make) -> Measured:
    """Check energy and momenta of a rigid motion against those of a box."""
    body = _moving(make)
    J = TURN @ np.diag([27.2, 23.2, 10.4]) @ TURN.T
    errors = {
        "linear_momentum": difference(body.linear_momentum(), MASS * FLIGHT),
        "angular_momentum": difference(body.angular_momentum(), J @ SPIN),
        "kinetic_energy": difference(body.kinetic_energy(), (MASS * FLIGHT @ FLIGHT + SPIN @ J @ SPIN) / 2),
    }
    return largest(errors, 1e-11)


def mass_matrix(make: Make) -> Measured:
    """Check that the mass is symmetric and positive definite."""
    body = make()
    M = np.stack([body.times_mass(unit) for unit in np.eye(body.dofs)])
    if not np.linalg.eigvalsh((M + M.T) / 2)[0] > 0:
        return Measured(np.inf, 0.0, "some velocity has no kinetic energy: M is not positive definite")
    return Measured(difference(M, M.T), 1e-14, "M differs from its transpose")


def conjugacy(make: Make) -> Measured:
    """Check that the power of a force is the force times the velocity of its point."""
    body, error = _stirred(make), 0.0
    forces = np.random.default_rng(2).uniform(-1, 1, (5, 3))
    for X, f in zip(_points(body), forces, strict=True):
        dofs, H = body.jacobian(X, body.q)
        v = body.velocity(X)
        power = float(body.generalized_force(X, f, body.q) @ body.u)
        error = max(error, abs(power - f @ v) / np.linalg.norm(v), difference(H @ body.u[dofs], v))
    text = "generalized_force(X, f) · u, or jacobian(X) u, is not what velocity(X) says"
    return Measured(error, 1e-12, text)


def free_flight(make: Make) -> Measured:
    """Check that the mass center flies straight and linear momentum stays."""
    body = _moving(make)
    start, p = body.mass_center(), body.linear_momentum()
    for _ in integrate(body, 1e-3, 10, every=10):
        pass
    error = difference(body.mass_center() - start, 0.01 * FLIGHT)
    return Measured(max(error, difference(body.linear_momentum(), p)), 1e-11, "after ten steps without loads")


# ---- kinds that deform -----------------------------------------------------------------------------


def rigid_motions(make: Make) -> Measured:
    """Check that a rotation needs no load and stores no energy."""
    body = make()
    body.rotate(TURN)
    moved = _stirred(make)
    scale = float(np.abs(moved.internal_force()).max())
    load = float(np.abs(body.internal_force()).max()) / scale
    stored = float(body.internal_energy()) / float(moved.internal_energy())
    return Measured(max(load, stored), 1e-12, "internal_force or internal_energy of a turned body")


def balance_of_moments(make: Make) -> Measured:
    """Check that the internal force vector does no work on rigid motions."""
    body = _stirred(make)
    load, powers = body.internal_force(), []
    for axis in np.eye(6):
        body.set_velocity(axis[:3], axis[3:])
        powers.append(abs(float(load @ body.u)))
    text = "internal_force · u of a translation or rotation"
    return Measured(max(powers) / float(np.abs(load).max()), 1e-12, text)


def energy(make: Make) -> Measured:
    """Check that the internal force vector is the slope of the internal energy."""
    body = _stirred(make)
    q, v, h = body.q.copy(), body.u.copy(), 1e-5
    slope, energies = float(body.internal_force() @ v), []
    for side in (1, -1):
        body.set_configuration(q + side * h * v)
        energies.append(float(body.internal_energy()))
    numeric = (energies[0] - energies[1]) / (2 * h)
    return Measured(
        abs(numeric - slope) / abs(slope), 1e-7, f"load · v {slope:.8g}, differences {numeric:.8g}"
    )


def tangent(make: Make) -> Measured:
    """Check that `solver` solves with M + c K, K by differences of the internal force vector."""
    body = _stirred(make)
    assert isinstance(body, Deformable)
    c, h = 1e-4, 1e-6
    x = body.solver(body.q, c)(body.times_mass(body.u))
    slope = (body.internal_force(body.q + h * x) - body.internal_force(body.q - h * x)) / (2 * h)
    product = body.times_mass(x) + c * slope
    return Measured(difference(product, body.times_mass(body.u)), 1e-7, "(M + c K) x differs from b")


def conservation(make: Make) -> Measured:
    """Check that the energy-momentum integrator keeps the energy and both momenta over ten steps."""
    body = _moving(make)
    body.integrator = "energy_momentum"
    E, L = float(body.energy()), body.angular_momentum()
    for _ in integrate(body, 5e-3, 10, every=10):
        pass
    change = abs(float(body.energy()) / E - 1)
    return Measured(max(change, difference(body.angular_momentum(), L)), 1e-10, "energy or angular momentum")


CHECKS = (rigid_velocity, momenta, mass_matrix, conjugacy, free_flight)
DEFORMABLE = (rigid_motions, balance_of_moments, energy, tangent, conservation)
