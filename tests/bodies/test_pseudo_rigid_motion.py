"""Pseudo-rigid bodies: vibration, free rotation, and what each integrator conserves.

Reference values: closed forms, and the equations of motion solved with 12 digits.
"""

import motions
import numpy as np
import pytest
from computing import compiled
from motions import end

import kratos_lite as kl

INTEGRATORS = ("DEF_EXP", "DEF_LIM", "ENERGY_MOMENTUM")
each_integrator = pytest.mark.parametrize("integrator", INTEGRATORS)
SPIN = (0.05, 10, 0.05)
MOMENTUM = np.array([1.36, 232, 0.52])
"""Angular momentum of the box under this spin."""
OMEGA_B, OMEGA_S = 346.41016151377545, 192.15378456610458
"""Breathing and shear frequency of the cube."""
F_AT_1 = {
    1e6: np.array(
        [
            [-0.81307595, 0.41860102, -0.4074419],
            [0.39640065, 0.90491398, 0.13949238],
            [0.42665822, -0.04667751, -0.90981535],
        ]
    ),
    1e8: np.array(
        [
            [-0.74512831, 0.42921427, -0.51047487],
            [0.41583249, 0.8973293, 0.14753263],
            [0.52132217, -0.10230523, -0.84731672],
        ]
    ),
}
"""Deformation gradient of the freely rotating box after 1 s, to 8 digits."""


def cube(integrator, damping=0.0):
    mesh = kl.box((0.5, 0.5, 0.5), origin=(-0.25, -0.25, -0.25))
    material = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)
    return kl.PseudoRigidBody(mesh, material, integrator=integrator, damping=damping)


def deformed(body, F):
    q = body.q.copy()
    q[:9] = np.ravel(F)
    body.set_configuration(q)
    return body


def seen_frequency(values, h):
    """Return the frequency of an undamped oscillation about 0 from three values: exact for a discrete one."""
    values = np.asarray(values)
    ratio = (values[2:] + values[:-2]) @ values[1:-1] / (2 * values[1:-1] @ values[1:-1])
    return np.arccos(ratio) / h


# ---- vibration -------------------------------------------------------------------------------------


def test_frequencies_of_a_cube():
    omega = cube("DEF_EXP").frequencies()
    assert np.abs(omega[:3]).max() < 1e-3
    np.testing.assert_allclose(omega[3:8], OMEGA_S, rtol=1e-12)
    assert omega[8] == pytest.approx(OMEGA_B, rel=1e-12)
    assert 2 * np.pi / OMEGA_B == pytest.approx(0.0181379936, rel=1e-8)


def test_frequencies_of_a_box(brick):
    body = brick(kl.PseudoRigidBody)
    squares = (11342.4435, 17435.8974, 33360.0426, 33461.5385, 41666.6667, 117284.6934)
    np.testing.assert_allclose(body.frequencies()[3:] ** 2, squares, rtol=1e-8)
    assert body.critical_step() == pytest.approx(5.8399526683e-3, rel=1e-9)
    lam, mu, V, E0 = 1e6 * 0.3 / 1.3 / 0.4, 1e6 / 2.6, 0.24, np.array([3.2, 7.2, 20.0])
    shear = [V * mu * (1 / E0[i] + 1 / E0[j]) for i, j in ((1, 2), (0, 2), (0, 1))]
    normal = np.linalg.eigvals(V * (lam * np.ones((3, 3)) + 2 * mu * np.eye(3)) / E0)
    np.testing.assert_allclose(body.frequencies()[3:] ** 2, np.sort([*shear, *normal]), rtol=1e-12)


@pytest.mark.parametrize(
    ("omega", "shape", "entry"),
    [(OMEGA_B, np.eye(3), 0), (OMEGA_S, np.eye(3)[[1, 0, 2]] - np.diag([0, 0, 1]), 1)],
    ids=["breathing", "shear"],
)
@each_integrator
def test_the_frequency_of_small_vibrations_is_that_of_the_step(integrator, omega, shape, entry):
    amplitude, h = 1e-7, 0.8 / OMEGA_B
    body, rest = deformed(cube(integrator), np.eye(3) + amplitude * shape), np.eye(3).ravel()[entry]
    seen = [amplitude] + [state.q[entry] - rest for state in kl.integrate(body, h, 40)]
    inverse = np.arcsin if integrator == "DEF_EXP" else np.arctan
    assert seen_frequency(seen, h) == pytest.approx(2 / h * inverse(omega * h / 2), rel=1e-6)


@each_integrator
def test_period_and_turning_point_of_large_breathing(integrator):
    body = deformed(cube(integrator), 1.1 * np.eye(3))
    period, lowest = 0.0182917027, np.sqrt(2 - 1.1**2)
    assert lowest == pytest.approx(0.8888194417, rel=1e-10)
    each, rates, sizes = 400, [0.0], [1.1]
    h = period / each
    for state in kl.integrate(body, h, each + 5):
        rates.append(state.u[0])
        sizes.append(state.q[0])
    i = int(np.argmin(sizes))
    assert min(sizes) == pytest.approx(lowest, rel=2e-4)
    assert i / each == pytest.approx(0.5, abs=0.01)
    (last,) = (k for k in range(i + 10, len(rates) - 1) if rates[k] >= 0 > rates[k + 1])
    crossing = h * (last + rates[last] / (rates[last] - rates[last + 1]))
    assert crossing == pytest.approx(period, rel=1e-4)
    shape = body.deformation
    np.testing.assert_allclose(shape, shape[0, 0] * np.eye(3), atol=1e-12)


def test_the_period_of_large_breathing_converges_with_the_second_power_of_the_step():
    at = 0.0363
    (size,) = motions.breathing(1e6, 0.3, 1000.0, side=0.5, stretch=1.1, times=[at])
    for integrator in INTEGRATORS:
        errors = [
            abs(end(deformed(cube(integrator), 1.1 * np.eye(3)), at / n, n).deformation[0, 0] - size)
            for n in (200, 400)
        ]
        assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.15)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_damping_takes_a_half_omega_squared_times_eta(integrator):
    eta = 2e-4
    body = deformed(cube(integrator, damping=eta), (1 + 1e-7) * np.eye(3))
    rate, h = eta * OMEGA_B**2 / 2, 5e-6
    steps = round(4 * np.pi / np.sqrt(OMEGA_B**2 - rate**2) / h)
    end(body, h, steps)
    assert (body.q[0] - 1) / 1e-7 == pytest.approx(np.exp(-rate * h * steps), rel=2e-3)


# ---- free rotation ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("integrator", "E", "steps", "error", "gain", "moment"),
    [
        ("DEF_EXP", 1e6, 1000, 1.68799e-3, 4.833e-5, 0.0),
        ("DEF_LIM", 1e6, 1000, 2.19968e-3, 4.807e-5, 3.574e-8),
        ("ENERGY_MOMENTUM", 1e6, 1000, 2.16e-3, 0.0, 0.0),
        ("DEF_LIM", 1e8, 1000, 5.32291e-4, 7.453e-5, 3.835e-6),
    ],
)
def test_errors_of_a_box_that_rotates_freely(integrator, E, steps, error, gain, moment, brick, drift):
    body = brick(kl.PseudoRigidBody, E, integrator=integrator)
    body.set_velocity(angular=SPIN)
    assert body.kinetic_energy() == pytest.approx(1160.047, rel=1e-13)
    np.testing.assert_allclose(body.angular_momentum(), MOMENTUM, rtol=1e-12)
    energies, momenta = [], []
    for _ in kl.integrate(body, 1 / steps, steps, every=max(1, steps // 1000)):
        energies.append(float(body.energy()))
        momenta.append(drift(MOMENTUM, body.angular_momentum()))
    assert np.linalg.norm(body.deformation - F_AT_1[E]) == pytest.approx(error, rel=0.05, abs=1e-7)
    changes = np.abs(np.array(energies) / 1160.047 - 1).max()
    assert changes < (1.05 * gain if gain else 1e-13)
    assert changes > 0.5 * gain
    assert max(momenta) < (1.05 * moment + 1e-14 if moment else 1e-13)
    np.testing.assert_allclose(body.linear_momentum(), 0, atol=1e-12)


@pytest.mark.parametrize(
    ("E", "stretches", "apart"), [(1e6, (0.99346, 1.01531), 1.0), (1e8, (0.999937, 1.000159), 0.0053)]
)
@compiled
def test_stretches_and_nearness_to_the_rigid_body(E, stretches, apart, brick):
    soft = brick(kl.PseudoRigidBody, E)
    rigid = brick(kl.RigidBody, E, integrator="RIG_IMP")
    low, high, far = 1.0, 1.0, 0.0
    for body in (soft, rigid):
        body.set_velocity(angular=SPIN)
    steps = 4000
    for one, _ in zip(
        kl.integrate(soft, 1 / steps, steps, every=10),
        kl.integrate(rigid, 1 / steps, steps, every=10),
        strict=True,
    ):
        U, s, Vt = np.linalg.svd(one.q[:9].reshape(3, 3))
        low, high = min(low, s.min()), max(high, s.max())
        far = max(far, np.abs(U @ Vt - rigid.rotation).max())
    low, high = 1 - low, high - 1  # the extremes of 3 s; most of them is seen in the first
    assert 0.95 * (1 - stretches[0]) < low < 1.03 * (1 - stretches[0])
    assert 0.95 * (stretches[1] - 1) < high < 1.03 * (stretches[1] - 1)
    assert far < 1.2 * apart


# ---- large steps -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("E", "h", "steps"), [(1e6, 5e-2, 15), (1e8, 2e-2, 97), (2e11, 1e-3, 50)])
def test_steps_that_blow_the_linearly_implicit_integrator_up(E, h, steps, brick, caplog):
    """What the warning is about: without damping the energy grows without bound."""
    body = brick(kl.PseudoRigidBody, E, integrator="DEF_LIM")
    body.set_velocity(angular=SPIN)
    highest = 0.0
    try:
        for _ in kl.integrate(body, h, 4 * steps):
            highest = max(highest, float(body.energy()))
            if highest > 5 * 1160:
                break
    except kl.SolveError:  # no longer finite
        highest = np.inf
    assert highest > 5 * 1160
    assert "may gain energy without bound" in caplog.text


def test_a_rotated_start_gives_the_rotated_motion(brick):
    """Nothing depends on how the axes of space lie."""
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    for integrator in INTEGRATORS:
        one, other = (
            brick(kl.PseudoRigidBody, integrator=integrator),
            brick(kl.PseudoRigidBody, integrator=integrator),
        )
        one.set_velocity((1, 2, 3), SPIN)
        deformed(other, turn)
        other.set_velocity(turn @ (1, 2, 3), turn @ SPIN)
        end(one, 2e-3, 50)
        end(other, 2e-3, 50)
        np.testing.assert_allclose(other.deformation, turn @ one.deformation, atol=1e-12)
        np.testing.assert_allclose(other.mass_center(), turn @ one.mass_center(), atol=1e-12)
