"""How time integration starts where constraints are."""

import logging

import numpy as np
import pytest

import kratos_lite as kl

RUBBER = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)
KINDS = [kl.RigidBody, kl.PseudoRigidBody, kl.FiniteElementBody]
each_kind = pytest.mark.parametrize("kind", KINDS)


@each_kind
def test_an_impulse_takes_what_constraints_forbid(kind, caplog):
    body = kind(kl.box(), RUBBER)
    body.set_velocity((1.0, 0.0, 3.0))
    body.constrain(kl.FixPoint("x-"))
    with caplog.at_level(logging.WARNING):
        for _ in kl.integrate(body, 1e-3, 3):
            assert np.abs(body.velocity(body.mesh.points[body.mesh.nodes("x-")])).max() < 1e-11
    assert "an impulse changes the kinetic energy from 5000 to" in caplog.text
    caplog.clear()
    list(kl.integrate(body, 1e-3, 3))
    assert not caplog.records


@each_kind
def test_a_ramp_starts_at_its_slope(kind):
    body = kind(kl.box(), RUBBER)
    body.constrain(kl.PrescribedDisplacement((0, 0, 0), (1, 0, 0), lambda t: 0.01 * t))
    for state in kl.integrate(body, 1e-3, 40):
        assert body.velocity(np.zeros(3))[0] == pytest.approx(0.01, rel=1e-4)
        assert body.position(np.zeros(3))[0] == pytest.approx(0.01 * state.time, rel=1e-9)


@each_kind
def test_a_displacement_that_starts_elsewhere_is_refused(kind):
    body = kind(kl.box(), RUBBER)
    body.constrain(kl.PrescribedDisplacement((0, 0, 0), (1, 0, 0), 0.01))
    with pytest.raises(kl.InputError, match=r"not met: its gap is 0\.01 m at t = 0 s, where the body is"):
        list(kl.integrate(body, 1e-3, 1))


def test_a_body_at_rest_may_be_moved_by_a_number():
    bar = kl.FiniteElementBody(
        kl.box((2, 1, 1), (2, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0, density=1.0), formulation="corotational"
    )
    bar.constrain(kl.FixPoint("x-"))
    bar.constrain(kl.PrescribedDisplacement("x+", (1, 0, 0), 0.01))
    kl.find_equilibrium(bar)
    assert bar.constraints[1].reactions.sum(axis=0)[0] == pytest.approx(1e6 * 0.005, rel=1e-9)
    list(kl.integrate(bar, 1e-3, 2))  # and it stays where it is
    assert bar.displacement[:, 0].max() == pytest.approx(0.01, rel=1e-9)


def test_nodes_are_chosen_by_parts_and_predicates():
    one, other = (kl.FiniteElementBody(kl.box(), RUBBER) for _ in range(2))
    one.constrain(kl.FixPoint("z-"))
    other.constrain(kl.FixPoint(lambda X: X[:, 2] < 0.5))
    np.testing.assert_array_equal(one.constraints[0].points, other.constraints[0].points)
    with pytest.raises(kl.ModelError, match="this body has none"):
        kl.RigidBody(mass_properties=kl.MassProperties.ball(1.0, 1.0)).constrain(kl.FixPoint("z-"))


def test_two_runs_of_quadratic_elements_are_the_same_bit_by_bit():
    def run(steps):
        body = kl.FiniteElementBody(kl.box((0.2, 0.2, 1.0), (1, 1, 4), "KinematicLinear3D20N"), RUBBER)
        body.constrain(kl.FixPoint("z-"))
        body.add(kl.Gravity((9.81, 0, 0)))
        *_, last = kl.integrate(body, 2e-3, steps)
        return last

    np.testing.assert_array_equal(run(12).q, run(12).q)


def test_modes_are_those_of_the_held_body():
    """A slender clamped bar bends as a beam, 1.8751² sqrt(E I / (ρ A)) / L², less a little by shear."""
    steel = kl.Isotropic3D(E=2e11, nu=0.0, density=7850.0)
    bar = kl.FiniteElementBody(kl.box((0.1, 0.1, 1.4), (1, 1, 7), "KinematicLinear3D20N"), steel)
    bar.constrain(kl.FixPoint("z-"))
    beam = 1.87510407**2 * np.sqrt(2e11 * 0.1**2 / 12 / 7850) / 1.4**2
    omega, shapes = bar.modes(3)
    assert omega[0] == pytest.approx(beam, rel=5e-3)
    assert omega[1] == pytest.approx(omega[0], rel=1e-9)
    assert not shapes[np.repeat(bar.points[:, 2] == 0, 3)].any()


def test_modes_with_an_oblique_direction():
    """What slides along a slope is a motion without stiffness."""
    body = kl.FiniteElementBody(kl.box(), RUBBER)
    body.constrain(kl.FixDirection("z-", (0, 1, 1)))
    omega, shapes = body.modes(7)
    assert (omega[:3] < 1e-3).all()  # along x, along the slope, about its normal
    assert omega[3] > 1
    held = shapes.reshape(-1, 3, 7)[body.points[:, 2] == 0]
    assert np.abs(held[:, 1] + held[:, 2]).max() < 1e-12
