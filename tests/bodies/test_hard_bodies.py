"""Bodies where mistakes would go unseen: strong damping, clocks, loads on velocities."""

import numpy as np
import pytest

import kratos_lite as kl

KINDS = (kl.RigidBody, kl.PseudoRigidBody, kl.FiniteElementBody)
SOFT = (
    (kl.PseudoRigidBody, {}),
    (kl.FiniteElementBody, {}),
    (kl.FiniteElementBody, {"lumped": True}),
    (kl.FiniteElementBody, {"formulation": "corotational"}),
    (kl.FiniteElementBody, {"formulation": "modal"}),
)
RUBBER = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)


def advance(body, dt, steps, **options):
    """Return the last state."""
    *_, last = kl.integrate(body, dt, steps, every=steps, **options)
    return last


# ---- explicit steps with damping -------------------------------------------------------------------


@pytest.mark.parametrize("damping", [1e-3, 2e-2])
@pytest.mark.parametrize(("kind", "options"), SOFT)
def test_automatic_steps_are_stable_with_damping(kind, options, damping):
    body = kind(kl.box(), RUBBER, integrator="DEF_EXP", damping=damping, **options)
    body.u += 1e-3 * np.random.default_rng(0).normal(size=body.u.shape)
    start = body.energy()
    advance(body, 0.1, 10, substeps="auto")
    assert body.energy() < start


def test_the_critical_step_with_damping_is_sharp():
    """Drift, kick, drift of the highest frequency: a spectral radius of 1 is exceeded just above the step."""
    body = kl.PseudoRigidBody(kl.box(), RUBBER, integrator="DEF_EXP", damping=0.01)
    for fraction, stable in ((0.99, True), (1.01, False)):
        h, square = fraction * body.critical_step(), body.highest_frequency() ** 2
        drift, kick = np.array([[1, h / 2], [0, 1]]), np.array([[1, 0], [-h * square, 1 - h * 0.01 * square]])
        assert (np.abs(np.linalg.eigvals(drift @ kick @ drift)).max() < 1) == stable


# ---- clocks ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS[:2])
def test_bodies_that_advanced_together_have_clocks_of_their_own(kind):
    one, two = (kind(kl.box(), RUBBER) for _ in range(2))
    advance([one, two], 0.1, 3)
    assert (one.step, two.step) == (3, 3)
    advance(one, 0.1, 2)
    assert (one.step, two.step) == (5, 3)
    assert two.time == pytest.approx(0.3)
    kl.State.of(one).restore(two)
    one.time = 7.0
    assert two.time == pytest.approx(0.5)


# ---- loads that depend on the velocity -------------------------------------------------------------

INTEGRATORS = [(kl.RigidBody, s) for s in kl.RigidBody.integrators] + [
    (kind, s) for kind in KINDS[1:] for s in kl.PseudoRigidBody.integrators
]


@pytest.mark.parametrize(("kind", "integrator"), INTEGRATORS)
def test_a_damper_is_of_second_order(kind, integrator):
    """m v̇ = -d v of a body that only slides: v = exp(-d t / m), x = (m/d)(1 - v)."""
    errors = []
    for steps in (125, 250):
        body = kind(kl.box((0.2, 0.2, 0.2)), RUBBER, integrator=integrator)
        d = float(body.mass)
        body.set_velocity((1, 0, 0))
        body.add(kl.Spring(body.center, (-9, 0.1, 0.1), stiffness=0, damping=d))
        advance(body, 0.25 / steps, steps)
        errors.append(abs(body.mass_center()[0] - 0.1 - (1 - np.exp(-0.25))))
    assert errors[1] < 1e-6
    assert errors[0] / errors[1] == pytest.approx(4, abs=0.2)


# ---- many bodies, and bodies of another shape ---------------------------------------------------------


def test_each_of_many_bodies_may_have_its_own_force_and_torque():
    many = kl.RigidBody(mass_properties=kl.MassProperties.box(np.ones((3, 3)), density=2.0))
    force = np.array([[1.0, 0, 0], [0, 2, 0], [0, 0, 3]])
    many.add(kl.Force((0, 0, 0), force))
    many.add(kl.Torque(force))
    advance(many, 0.5, 2)
    np.testing.assert_allclose(many.linear_momentum(), force, atol=1e-14)
    np.testing.assert_allclose(many.angular_momentum(), force, atol=1e-14)


@pytest.mark.parametrize("lumped", [False, True])
def test_a_tapered_body_stays_undeformed_when_converted(lumped):
    """Lumped mass has its center elsewhere, which must not look like deformation."""
    mesh = kl.box(element="KinematicLinear3D20N")
    mesh = mesh.replace(points=mesh.points * (1 + mesh.points[:, :1] * [0, 1, 1]))
    soft = kl.FiniteElementBody(mesh, RUBBER, lumped=lumped)
    soft.q, soft.u = np.tile([1.0, 2, 3], 20), np.tile([4.0, 5, 6], 20)
    body = kl.convert(soft, kl.PseudoRigidBody)
    np.testing.assert_allclose(body.deformation, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(body.mass_center(), body.center + np.array([1, 2, 3]), atol=1e-14)
    np.testing.assert_allclose(body.u, np.repeat([0, 4, 5, 6], [9, 1, 1, 1]), atol=1e-13)
