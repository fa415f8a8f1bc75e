"""Rigid tops: free, tumbling about the intermediate axis, heavy and nutating.

Reference values: the equations of motion solved with 12 digits; Jacobi's elliptic functions for the periods.
"""

import motions
import numpy as np
import pytest
from motions import end

import kratos_lite as kl
from kratos_lite.bodies.rotations import exp

INTEGRATORS = ("RIG_POS", "RIG_NEG", "RIG_IMP")
EXACT = ("RIG_NEG", "RIG_IMP")
each_integrator = pytest.mark.parametrize("integrator", INTEGRATORS)

FREE_AT_1 = np.array(
    [
        [-0.9997933439831747, 0.02025752864553756, -0.0017034846756190068],
        [-0.008836223646996058, -0.5085081331683603, -0.8610118464070836],
        [-0.018308207955001106, -0.8608188607568308, 0.5085820469566709],
    ]
)
"""Rotation of the free top after 1 s."""


def top(J, W, integrator, rotation=None):
    body = kl.RigidBody(
        mass_properties=kl.MassProperties(mass=1.0, inertia=np.diag(np.array(J, dtype=float))),
        integrator=integrator,
    )
    if rotation is not None:
        body.rotate(rotation)
    body.u[:3] = W
    return body


def free(integrator):
    return top((5, 10, 1), (8, 0.02, 0), integrator)


def heavy(integrator, W=50.0, angle=0.05):
    """Return a symmetric top under its weight, and its energy as a function of a state."""
    body = top((5, 5, 1), (0, 0, W), integrator, exp([angle, 0, 0]))
    body.add(kl.Callback(lambda q, u, t: np.r_[0, 0, 0, -20 * q[7], 20 * q[6], 0, 0, 0, 0]))
    return body, lambda state: float((state.u[:3] ** 2 @ [5, 5, 1]) / 2 + 20 * state.q[8])


def gains(body, dt, steps, energy=None):
    """Return relative changes of the energy over a motion, at every tenth step."""
    energy = energy or (lambda state: float((state.u[:3] ** 2 @ body.mass_properties.inertia.diagonal()) / 2))
    start = energy(kl.State.of(body))
    return np.array([energy(state) for state in kl.integrate(body, dt, steps, every=10)]) - start


# ---- free top --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("integrator", "error", "gain"),
    [("RIG_POS", 1.0558e-2, 7.755e-4), ("RIG_NEG", 3.3565e-2, -7.736e-4), ("RIG_IMP", 2.6796e-3, -5.306e-7)],
)
def test_errors_of_the_free_top_after_one_second(integrator, error, gain, drift):
    body = free(integrator)
    E, pi = body.energy(), body.angular_momentum()
    assert E == pytest.approx(160.002, rel=1e-15)
    end(body, 0.01, 100)
    assert np.linalg.norm(body.rotation - FREE_AT_1) == pytest.approx(error, rel=0.01)
    assert body.energy() / E - 1 == pytest.approx(gain, rel=0.01)
    if integrator in EXACT:
        assert drift(pi, body.angular_momentum()) < 1e-12
    else:
        assert drift(pi, body.angular_momentum()) == pytest.approx(7.206e-3, rel=0.01)
    assert np.abs(body.rotation.T @ body.rotation - np.eye(3)).max() < 1e-13


def test_the_implicit_integrator_keeps_the_energy_over_twenty_seconds():
    body = free("RIG_IMP")
    change = gains(body, 0.01, 2000) / 160.002
    assert abs(change[-1]) < 1e-6
    assert change.min() == pytest.approx(-1.595e-3, rel=0.05)
    assert change.max() < 1e-12


def test_the_implicit_integrator_retraces_its_way():
    body = free("RIG_IMP")
    q = body.q.copy()
    end(body, 0.01, 100)
    body.u = -body.u
    end(body, 0.01, 100)
    np.testing.assert_allclose(body.q, q, atol=1e-10)
    np.testing.assert_allclose(body.u[:3], (-8, -0.02, 0), atol=1e-9)


def test_the_motion_of_the_free_top_follows_eulers_equations():
    times = np.linspace(0, 1, 11)
    rotations, spins = motions.top((5, 10, 1), (8, 0.02, 0), np.eye(3), times)
    np.testing.assert_allclose(rotations[-1], FREE_AT_1, atol=1e-9)
    body = free("RIG_IMP")
    states = list(kl.integrate(body, 1e-3, 1000, every=100))
    for i, state in enumerate(states, 1):
        R = state.q[:9].reshape(3, 3).T
        assert np.linalg.norm(R - rotations[i]) < 1.5e-4
        np.testing.assert_allclose(state.u[:3], spins[i], atol=6e-4)


@pytest.mark.parametrize(
    ("integrator", "gain"), [("RIG_POS", 1.2586e-2), ("RIG_NEG", -2.6140e-2), ("RIG_IMP", 0.0)]
)
def test_the_free_top_after_twenty_seconds(integrator, gain, drift):
    """The energy goes as the names of two say; by two of them the momentum in space stays."""
    body = free(integrator)
    end(body, 0.01, 2000)
    assert body.energy() / 160.002 - 1 == pytest.approx(gain, rel=0.02, abs=1e-5)
    assert drift(np.array([40, 0.2, 0]), body.angular_momentum()) < 1e-12 or integrator not in EXACT


@each_integrator
def test_a_top_turns_over_at_the_times_of_jacobi(integrator):
    body = top((1, 2, 3), (1e-3, 2, 1e-3), integrator)
    E, pi = body.energy(), body.angular_momentum()
    assert E == pytest.approx(4.000002, rel=1e-15)
    np.testing.assert_allclose(pi, (1e-3, 4, 3e-3), rtol=1e-15)
    h, times, last = 0.02, [], body.u[1]
    for state in kl.integrate(body, h, 1200):
        if last * state.u[1] < 0:
            times.append(state.time - h * state.u[1] / (state.u[1] - last))
        last = state.u[1]
    assert times[0] == pytest.approx(8.05358, abs=0.005)
    if integrator == "RIG_IMP":  # the others leave the separatrix: the energy of theirs is another
        np.testing.assert_allclose(times, (8.05358, 23.01950), atol=0.01)
        assert np.diff(times)[0] == pytest.approx(29.93199027029713 / 2, abs=0.01)
        assert body.energy() == pytest.approx(E, rel=1e-4)
    if integrator in EXACT:
        np.testing.assert_allclose(body.angular_momentum(), pi, atol=4e-12)


# ---- heavy top -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("integrator", "change", "low", "high"),
    [
        ("RIG_POS", 7.4212e-4, 0.0, 7.4212e-4),
        ("RIG_NEG", -9.2999e-4, -9.2999e-4, 0.0),
        ("RIG_IMP", -1.5411e-4, -1.5487e-4, 0.0),
    ],
)
def test_energy_of_the_heavy_top(integrator, change, low, high):
    """H - H0 over 10 s in steps of 9 ms: at the end, lowest, highest."""
    body, energy = heavy(integrator)
    assert energy(kl.State.of(body)) == pytest.approx(1269.97500520790, rel=1e-13)
    vertical = body.angular_momentum()[2]
    found = gains(body, 0.009, 1111, energy)
    assert 1.05 * low - 1e-9 < found.min()
    assert found.max() < 1.05 * high + 1e-9
    assert found[-1] == pytest.approx(change, rel=0.05)
    assert body.u[2] == pytest.approx(50, rel=1e-5)
    if integrator in EXACT:
        assert abs(body.angular_momentum()[2] / vertical - 1) < 1e-12


@pytest.mark.parametrize(
    ("integrator", "error"), [("RIG_POS", 2.1240517e-4), ("RIG_NEG", 1.1136200e-4), ("RIG_IMP", 1.1426867e-4)]
)
def test_the_axis_of_the_heavy_top_after_one_second(integrator, error):
    axis = np.array([0.021541104974233692, -0.05001033548338187, 0.9985163729961212])
    errors = []
    for steps in (100, 200):
        body, _ = heavy(integrator)
        errors.append(np.linalg.norm(end(body, 1 / steps, steps).rotation[:, 2] - axis))
    assert errors[0] == pytest.approx(error, rel=0.05)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.06)


def vertex(times, values, i):
    """Return the time of the extremum of the parabola through three values about i."""
    a, b, c = values[i - 1 : i + 2]
    return times[i] + (times[1] - times[0]) * (a - c) / (2 * (a - 2 * b + c))


@pytest.mark.parametrize(("W", "angle", "steps"), [(50.0, 0.05, 700), (25.0, 0.5, 1000)])
def test_the_heavy_top_nods_and_turns_as_lagrange_says(W, angle, steps):
    """With u = cos θ: u'² = (u0 - u) (8 (1 - u²) - s² (u0 - u)) and φ' = s (u0 - u) / (1 - u²), s = W / 5."""
    body, energy = heavy("RIG_IMP", W, angle)
    vertical, s, highest = body.angular_momentum()[2], W / 5, np.cos(angle)
    assert energy(kl.State.of(body)) == pytest.approx(W**2 / 2 + 20 * highest, rel=1e-12)
    assert vertical == pytest.approx(W * highest, rel=1e-13)
    lowest, beyond = np.sort(np.roots([8, -(s**2), s**2 * highest - 8]))
    u = (lowest + highest) / 2 + (highest - lowest) / 2 * np.cos(np.pi * (np.arange(64) + 0.5) / 64)
    rates = np.sqrt(8 * (beyond - u))
    states = list(kl.integrate(body, 2e-3, steps))
    times, theta = np.array([state.time for state in states]), np.arccos([state.q[8] for state in states])
    assert theta.min() > angle - 1e-5
    assert theta.max() == pytest.approx(np.arccos(lowest), abs=1e-4)
    period = 2 * np.pi * (1 / rates).mean()
    back = vertex(times, theta, int(np.argmin(theta + (np.abs(times - period) > period / 2))))
    assert back == pytest.approx(period, abs=5e-4)
    turn = np.unwrap([np.arctan2(state.q[7], state.q[6]) for state in states])
    expected = 2 * np.pi * (s * (highest - u) / (1 - u**2) / rates).mean()
    assert np.interp(back, times, turn) + np.pi / 2 == pytest.approx(expected, abs=2e-3)
    assert abs(body.angular_momentum()[2] / vertical - 1) < 1e-12


# ---- torques ---------------------------------------------------------------------------------------


@each_integrator
def test_a_torque_about_a_principal_axis_spins_the_body_up(integrator):
    body = top((5, 10, 1), (0, 0, 0), integrator)
    body.add(kl.Torque((0, 3.0, 0), frame="follower"), amplitude=kl.TimeSeries([0, 1], [0, 2]))
    end(body, 0.01, 100)
    np.testing.assert_allclose(body.u[:3], (0, 0.3, 0), rtol=1e-13, atol=1e-15)
    assert body.external_work == pytest.approx(body.kinetic_energy(), rel=1e-12)
    angle = np.arctan2(body.rotation[0, 2], body.rotation[0, 0])
    assert angle == pytest.approx(0.1, rel=1e-4)  # W = 0.3 t²


@each_integrator
def test_a_tower_of_callbacks_in_nine_or_six_numbers_is_the_same(integrator):
    nine, _ = heavy(integrator, 25.0, 0.5)
    six, _ = heavy(integrator, 25.0, 0.5)
    six.loads.clear()

    def referential(q, u, t):
        R = q[:9].reshape(3, 3).T
        return np.r_[R.T @ (-20 * np.cross(q[6:9], [0, 0, 1])), 0, 0, 0]

    six.add(kl.Callback(referential))
    end(nine, 0.01, 20)
    end(six, 0.01, 20)
    np.testing.assert_allclose(nine.q, six.q, atol=1e-13)
    np.testing.assert_allclose(nine.u, six.u, atol=1e-12)
