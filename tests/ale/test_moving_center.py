"""Rotors whose center travels: Ż and Z̈ against gravity, other frames and paths of material points."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.ale import Rotation
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.bodies.rotations import exp

A = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
PULL = np.array([3.0, -7.0, 2.0])


def rotor(wheels, radial=2, around=16, element="8N", **options):
    mesh = kl.annulus(0.3, 1.0, 0.2, (radial, around, 1), f"KinematicLinear3D{element}")
    model = kl.Model(mesh, wheels.steel)
    model.fix("inner")
    model.add(Rotation("z", **options))
    return model


@pytest.mark.parametrize("rate", [0.0, 30.0])
def test_a_steady_acceleration_of_the_center_is_a_gravity_against_it(rate, wheels):
    carried = rotor(wheels, rate=rate, center_acceleration=PULL).solve()
    still = rotor(wheels, rate=rate)
    still.add(kl.Gravity(-PULL))
    expected = still.solve().u
    np.testing.assert_allclose(carried.u, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_the_hub_pulls_the_whole_mass_along(wheels):
    model = rotor(wheels, rate=30.0, center_acceleration=PULL)
    mass = 7620.0 * 0.2 * (1.0 - 0.3**2) * 8 * np.sin(np.pi / 8)  # of a ring with 16 corners
    force, _ = kl.reaction_resultant(model, model.solve(), "inner")
    np.testing.assert_allclose(force, mass * PULL, rtol=1e-11)


def test_a_constant_velocity_of_the_center_adds_to_that_of_the_material_alone(wheels):
    still, carried = rotor(wheels, rate=30.0), rotor(wheels, rate=30.0, center_velocity=PULL)
    u = still.solve().u
    np.testing.assert_array_equal(carried.solve().u, u)
    shift = kl.material_velocity(carried, u) - kl.material_velocity(still, u)
    np.testing.assert_allclose(shift, np.tile(PULL, (len(u), 1)), rtol=1e-13)
    np.testing.assert_array_equal(kl.material_acceleration(carried, u), kl.material_acceleration(still, u))


def test_a_wheel_that_rolls_stands_where_it_touches_the_ground(wheels):
    """Ż = b s along x for a clockwise turn: 0 below, twice Ż above, Ż turned down in front."""
    model = rotor(wheels, rate=30.0, center_velocity=(30.0, 0.0, 0.0))
    X = model.mesh.points
    v = kl.material_velocity(model, np.zeros_like(X))
    for place, expected in (((0, -1), (0, 0)), ((0, 1), (60, 0)), ((1, 0), (30, -30))):
        at = np.abs(X[:, :2] - place).max(axis=1) < 1e-9
        assert at.sum() == 2
        np.testing.assert_allclose(v[at], [(*expected, 0.0)] * 2, atol=1e-10)


def shaken(t):
    """Return Z of the center at a time."""
    return np.array([2e-3 * np.sin(90 * t), 3e-3 * (1 - np.cos(60 * t)), -1.5 * t * t])


VELOCITY = (lambda t: 0.18 * np.cos(90 * t), lambda t: 0.18 * np.sin(60 * t), lambda t: -3.0 * t)
ACCELERATION = (lambda t: -16.2 * np.sin(90 * t), lambda t: 10.8 * np.cos(60 * t), -3.0)


def test_a_shaken_rotor_is_one_under_gravity_that_changes(wheels):
    model = rotor(wheels, rate=30.0, center_velocity=VELOCITY, center_acceleration=ACCELERATION)
    still = rotor(wheels, rate=30.0)
    for axis, given in enumerate(ACCELERATION):
        still.add(kl.Gravity(-np.eye(3)[axis]), amplitude=given)
    *_, one = kl.integrate(model.transient(), 1e-3, 20)
    *_, other = kl.integrate(still.transient(), 1e-3, 20)
    np.testing.assert_allclose(one.u, other.u, rtol=0, atol=1e-11 * np.abs(other.u).max())


def test_the_acceleration_of_the_center_is_the_change_of_its_velocity(wheels):
    """Steps carry over the whole change of Ż, wherever its kinks lie: Σ Δt Z̈ = ΔŻ."""
    ramp = kl.TimeSeries([0.0, 0.0023, 0.0101], [0.0, 0.4, 0.1])
    model = rotor(wheels, rate=5.0, center_velocity=(0.0, ramp, 0.0))
    transient, h = model.transient(), 1e-3
    found = [transient.equations.center_rates(0.0)[1]]
    for state in kl.integrate(transient, h, 20):
        found.append(transient.equations.center_rates(state.time)[1])
        assert transient.equations.center_rates(state.time)[0][1] == ramp(state.time)
    total = h * sum(found[1:]) + h / 2 * found[0]
    assert total[1] == pytest.approx(0.1, rel=1e-11)
    assert total[[0, 2]].tolist() == [0.0, 0.0]
    assert model.motion.center_rates(0.001)[1][1] == pytest.approx(0.4 / 0.0023)


@pytest.mark.parametrize(("element", "tolerance"), [("8N", 1e-3), ("20N", 8e-5)])
def test_axes_that_turn_with_the_body_see_the_acceleration_turned_back(element, tolerance, wheels):
    """u(T, X) = R w(T, Rᵀ X) after an eighth of a turn, with Rᵀ Z̈ as the inertia of the body's own axes."""
    rate, steps, around = 30.0, 100, 16
    T = 2 * np.pi / 8 / rate
    model = rotor(wheels, 2, around, element, rate=rate, center_acceleration=ACCELERATION)
    plain = rotor(wheels, 2, around, element)
    mass = EquationsOfMotion(plain).mass.nodal

    def load(angle, t):
        pull = turned(angle).T @ [a(t) if callable(a) else a for a in ACCELERATION]
        return -mass[:, None] * pull

    w = wheels.lagrangian(plain, lambda t: rate * t, lambda t: rate, lambda t: 0.0, load, T / steps, steps)
    *_, state = kl.integrate(model.transient(), T / steps, steps, every=steps)
    R, X = exp(np.array([0.0, 0.0, -rate * T])), model.mesh.points
    distance = np.abs((X @ R)[:, None] - X[None]).max(axis=2)
    assert distance.min(axis=1).max() < 1e-6
    seen = w[distance.argmin(axis=1)] @ R.T
    assert np.abs(state.u - seen).max() < tolerance * np.abs(seen).max()


def turned(angle):
    return exp(np.array([0.0, 0.0, -angle]))


def test_the_velocity_is_that_of_material_points_on_their_way(wheels):
    """Central differences of x(t) = R Y + u(t, R Y) + Z(t) at unsymmetric positions in a transient."""
    h, rate, T = 5e-4, 40.0, 0.01
    options = {"rate": rate, "center_velocity": VELOCITY, "center_acceleration": ACCELERATION}
    model = rotor(wheels, 3, 24, "20N", **options)
    Y = np.array([[0.41, 0.33, 0.031], [-0.62, 0.17, 0.142], [0.23, -0.71, 0.087]])
    transient, places = model.transient(), []
    for state in kl.integrate(transient, h, round(T / h) + 1):
        X = Y @ turned(rate * state.time).T
        here = model.mesh.locate(X, required=True)
        places.append(X + here.interpolate(state.u) + shaken(state.time))
        if state.step == round(T / h):
            velocity = here.interpolate(transient.material_velocity(state))
    expected = (places[-1] - places[-3]) / (2 * h)
    assert np.abs(velocity - expected).max() < 2e-3 * np.abs(expected).max()


def strained(t, X):
    """Return an affine displacement that changes with time, which every element has exactly."""
    L = np.array([[0.3, -0.1, 0.2], [0.4, 0.1, -0.3], [-0.2, 0.5, 0.1]]) * np.sin(11 * t + np.arange(3))
    return X @ L.T + [np.sin(5 * t), t * t, np.cos(7 * t)]


@pytest.mark.parametrize("element", ["8N", "20N", "27N"])
def test_velocity_and_acceleration_are_exact_for_affine_displacements(element, wheels):
    """Differences of order 4 of the way of each material point; the rate changes and the center travels."""
    T, h, center = 0.07, 1e-3, np.array([0.0, 0.0, 0.4])
    model = rotor(
        wheels,
        2,
        12,
        element,
        rate=lambda t: 20 + 300 * t,
        acceleration=300.0,
        center=center,
        center_velocity=VELOCITY,
        center_acceleration=ACCELERATION,
    )
    X = model.mesh.points - center

    def way(t):
        at = X @ turned(20 * (t - T) + 150 * (t * t - T * T)).T
        return at + strained(t, at + center) + shaken(t)

    x = [way(T + k * h) for k in (-2, -1, 0, 1, 2)]
    u = [strained(T + k * h, model.mesh.points) for k in (-2, -1, 0, 1, 2)]
    first = lambda y: (y[0] - 8 * y[1] + 8 * y[3] - y[4]) / (12 * h)  # noqa: E731
    second = lambda y: (-y[0] + 16 * y[1] - 30 * y[2] + 16 * y[3] - y[4]) / (12 * h * h)  # noqa: E731
    transient = model.transient()
    values = {"u": u[2], "v": first(u), "a": second(u), "reactions": 0 * X, "imbalance": 0.0}
    state = kl.State("model", "any", T, 70, values)
    for found, expected in (
        (transient.material_velocity(state), first(x)),
        (transient.material_acceleration(state), second(x)),
    ):
        assert np.abs(found - expected).max() < 2e-5 * np.abs(expected).max()


def test_a_turned_and_shifted_scene_gives_turned_results(wheels):
    """Mesh, axis, center, Ż and Z̈ turned together, in time, with a rate that changes."""
    Q, shift, found = exp(np.array([0.5, -1.2, 0.8])), np.array([3.0, -20.0, 7.0]), []
    field = np.random.default_rng(8).standard_normal(192)
    for R, place in ((np.eye(3), np.zeros(3)), (Q, shift)):
        mesh = kl.annulus(0.3, 1.0, 0.2, (2, 16, 1), "KinematicLinear3D8N")
        assert mesh.n_nodes == 96
        model = kl.Model(mesh.replace(points=mesh.points @ R.T + place), wheels.steel)
        model.fix(mesh.nodes("inner"))
        rates = {"rate": kl.TimeSeries([0.0, 1.0], [10.0, 60.0]), "damping": 2.0}
        carried = {"center_velocity": R @ (0.1, 0.2, 0.3), "center_acceleration": R @ PULL}
        model.add(Rotation(R[:, 2], center=place, **rates, **carried))
        transient = model.transient()
        *_, state = kl.integrate(transient, 1e-3, 12, every=12)
        vectors = [state.u, transient.material_velocity(), transient.material_acceleration()]
        derived = kl.material_derivative(model, field.reshape(96, 2), order=2, time=0.1)
        found.append((*(v @ R for v in vectors), derived))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * np.abs(one).max())


def test_reports_tell_what_the_center_does(wheels):
    result = rotor(wheels, rate=3.0, center_velocity=(1.0, 0, 0), center_acceleration=(0, 2.0, 0)).solve()
    assert result.report.motion["center_velocity"] == [1.0, 0.0, 0.0]
    assert result.report.motion["center_acceleration"] == [0.0, 2.0, 0.0]
    assert ("center", "velocity (1, 0, 0) m/s, acceleration (0, 2, 0) m/s²") in result.table()
    assert "center_velocity" not in rotor(wheels, rate=3.0).solve().report.motion
    assert not result.report.notes
    changing = rotor(wheels, rate=3.0, center_acceleration=(0.0, lambda t: 2 + t, 0.0)).solve()
    assert "the acceleration of the center changes; it is taken as at the time 0" in changing.report.notes
    np.testing.assert_allclose(changing.u, result.u, rtol=0, atol=1e-15)


@pytest.mark.parametrize("value", [1.0, (1.0, 2.0), "abc", (1.0, 2.0, "x"), (0.0, np.nan, 0.0)])
def test_velocities_of_the_center_have_three_components(value):
    with pytest.raises(kl.InputError, match=r"a center velocity|three components"):
        Rotation("z", center_velocity=value)
