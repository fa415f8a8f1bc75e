"""Loads on bodies: each on each kind against a closed form, and the forces of one kind against another's."""

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.bodies.rotations import exp

KINDS = (kl.RigidBody, kl.PseudoRigidBody, kl.FiniteElementBody)
each_kind = pytest.mark.parametrize("kind", KINDS)
soft_kind = pytest.mark.parametrize("kind", KINDS[1:])
TURN = exp([0.6, -1.1, 0.4])
SHIFT = np.array([3.0, -2.0, 1.0])
CENTER = np.array([0.5, 0.3, 0.2])


def at(*arm):
    """Return the point at an arm from the mass center."""
    return CENTER + np.array(arm)


def block(kind, **options):
    mesh = kl.box((0.4, 0.6, 1.0), (1, 2, 2), origin=tuple(CENTER - (0.2, 0.3, 0.5)))
    return kind(mesh, kl.Isotropic3D(E=1e5, nu=0.3, density=1000.0), **options)


def moved(body, F=TURN, shift=SHIFT):
    """Let a body be at x = F (X - X̄) + X̄ + shift."""
    center = body.center + shift
    if isinstance(body, kl.RigidBody):
        body.set_configuration(np.concatenate([F.T.ravel(), center]))
    elif isinstance(body, kl.PseudoRigidBody):
        body.set_configuration(np.concatenate([F.ravel(), center]))
    else:
        body.set_configuration((body.points - body.center) @ F.T + center - body.points)
    return body


def stirred(kind, seed=3):
    """Return a body at a configuration and with a velocity without any symmetry."""
    rng = np.random.default_rng(seed)
    body = moved(block(kind), TURN if kind is kl.RigidBody else TURN @ (np.eye(3) + 0.1 * rng.random((3, 3))))
    if kind is kl.FiniteElementBody:
        body.set_configuration(body.q + 0.02 * rng.uniform(-1, 1, body.q.shape))
    body.u[...] = rng.uniform(-1, 1, body.u.shape)
    return body


def on_its_way(body, t):
    """Return the configuration after a time at a constant velocity."""
    if not isinstance(body, kl.RigidBody):
        return body.q + t * body.u
    return np.concatenate([(body.rotation @ exp(t * body.u[:3])).T.ravel(), body.q[9:] + t * body.u[3:]])


def resultant(body):
    """Return force and torque about the mass center of the loads: their powers on six rigid motions."""
    load, u, powers = body.external_force(), body.u.copy(), []
    for unit in np.eye(6):
        body.set_velocity(unit[:3], unit[3:])
        powers.append(float(load @ body.u))
    body.u[...] = u
    return np.array(powers[:3]), np.array(powers[3:])


# ---- the generalized force is conjugate to the velocity --------------------------------------------


@each_kind
def test_the_power_of_nodal_forces_is_forces_times_velocities(kind):
    """That of a force on a point is checked by the kit."""
    body, rng = stirred(kind), np.random.default_rng(50)
    forces = rng.uniform(-1, 1, body.mesh.points.shape)
    power = (forces * body.velocity(body.mesh.points)).sum()
    assert body.generalized_nodal_force(forces, body.q) @ body.u == pytest.approx(power, rel=1e-11)


@each_kind
def test_the_velocity_is_the_rate_of_the_position(kind):
    body, X, h = stirred(kind), at(0.15, -0.2, 0.3), 1e-6
    ahead, behind = (body.position(X, on_its_way(body, t)) for t in (h, -h))
    np.testing.assert_allclose((ahead - behind) / (2 * h), body.velocity(X), atol=1e-9)


# ---- forces on points ------------------------------------------------------------------------------


@each_kind
@pytest.mark.parametrize(("frame", "turn"), [("spatial", np.eye(3)), ("follower", TURN)])
def test_a_force_has_its_moment_and_may_turn_with_the_body(kind, frame, turn):
    body, X, f = moved(block(kind)), at(0.2, -0.3, 0.5), np.array([1.0, 2.0, -3.0])
    body.add(kl.Force(X, f, frame=frame), amplitude=2.0)
    force, torque = resultant(body)
    np.testing.assert_allclose(force, 2 * turn @ f, rtol=1e-12)
    np.testing.assert_allclose(torque, np.cross(TURN @ (X - CENTER), 2 * turn @ f), rtol=1e-11)


@soft_kind
def test_a_force_in_the_body_stretches_with_it(kind):
    F = TURN @ np.diag([1.2, 0.9, 1.1])
    body = moved(block(kind), F)
    body.add(kl.Force(at(0.1, 0.1, 0.1), (1.0, 0, 0), frame="follower"))
    np.testing.assert_allclose(resultant(body)[0], F[:, 0], rtol=1e-12)


@pytest.mark.parametrize("frame", ["spatial", "follower"])
def test_a_torque_on_a_rigid_body(frame):
    body = moved(block(kl.RigidBody))
    t = np.array([1.0, -2.0, 4.0])
    body.add(kl.Torque(t, frame=frame))
    force, torque = resultant(body)
    assert np.abs(force).max() == 0
    np.testing.assert_allclose(torque, t if frame == "spatial" else TURN @ t, rtol=1e-13)


# ---- weight ----------------------------------------------------------------------------------------


@each_kind
def test_weight_pulls_at_the_mass_center(kind):
    body = moved(block(kind))
    body.add(kl.Gravity((1.0, 2.0, -9.81)))
    force, torque = resultant(body)
    np.testing.assert_allclose(force, 240 * np.array([1.0, 2.0, -9.81]), rtol=1e-12)
    np.testing.assert_allclose(torque, 0, atol=1e-10)


@each_kind
def test_weight_that_changes_in_time_accelerates_by_its_integral(kind):
    body = block(kind)
    body.add(kl.Gravity((0, 0, -10.0)), amplitude=kl.TimeSeries([0, 0.1, 0.2], [0, 1, 0]))
    body.add(kl.Gravity((2.0, 0, 0)), amplitude=lambda t: 3 * t * t)
    for _ in kl.integrate(body, 1e-3, 200, every=200):
        pass
    np.testing.assert_allclose(
        body.linear_momentum() / body.mass, (2 * 0.2**3, 0, -1.0), rtol=1e-5, atol=1e-12
    )


@each_kind
def test_loads_add_up_and_an_amplitude_multiplies(kind):
    body, single = moved(block(kind)), moved(block(kind))
    X = at(0.2, 0.3, 0.5)
    body.add(kl.Force(X, (1.0, 2, 3)), amplitude=2.0)
    body.add(kl.Force(X, (1.0, 2, 3)), amplitude=lambda t: 1 + t)
    single.add(kl.Force(X, (1.0, 2, 3)))
    np.testing.assert_allclose(
        body.external_force(time=0.5), 3.5 * single.external_force(), rtol=1e-13, atol=1e-13
    )


# ---- loads of models -------------------------------------------------------------------------------

MODEL_LOADS = [
    kl.Traction("x+", (10.0, -20.0, 5.0)),
    kl.Pressure("z+", 7.0),
    kl.PointLoad("y-", (1.0, 2.0, 3.0), each=True),
    kl.BodyForce((4.0, -5.0, 6.0)),
    kl.BodyForce(np.random.default_rng(1).uniform(-1, 1, (18, 3))),
    kl.Gravity((1.0, 2.0, 3.0), where=[0, 2]),
]


@each_kind
@pytest.mark.parametrize("load", MODEL_LOADS, ids=lambda load: type(load).__name__)
def test_loads_of_models_have_the_resultant_of_their_nodal_forces(kind, load):
    body = moved(block(kind))
    f = load.forces(body.mesh, block(kl.FiniteElementBody).groups)
    assert np.abs(f).max() > 0
    body.add(load)
    force, torque = resultant(body)
    arms = (body.mesh.points - CENTER) @ TURN.T
    np.testing.assert_allclose(force, f.sum(axis=0), rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(torque, np.cross(arms, f).sum(axis=0), rtol=1e-10, atol=1e-11)


# ---- pressure --------------------------------------------------------------------------------------

FACES = ("x-", "x+", "y-", "y+", "z-", "z+")
STRETCH = np.array([[0.2, 0.1, 0], [0, -0.1, 0.2], [0, 0, 0.1]])


@each_kind
def test_both_pressures_agree_on_the_undeformed_body(kind):
    """A positive one pushes into the body."""
    for face in FACES:
        dead, following = block(kind), block(kind)
        dead.add(kl.Pressure(face, 7.0))
        following.add(kl.FollowerPressure(face, 7.0))
        np.testing.assert_allclose(following.external_force(), dead.external_force(), atol=1e-13)
        inward = -np.eye(3)["xyz".index(face[0])] * (1 if face[1] == "+" else -1)
        assert resultant(dead)[0] @ inward > 0


@pytest.mark.parametrize(
    ("kind", "F"), [(kl.RigidBody, TURN), *((kind, TURN @ (np.eye(3) + STRETCH)) for kind in KINDS[1:])]
)
def test_pressure_all_around_gives_no_resultant(kind, F):
    body = moved(block(kind), F)
    for face in FACES:
        body.add(kl.FollowerPressure(face, 100.0))
    force, torque = resultant(body)
    np.testing.assert_allclose(force, 0, atol=1e-11)
    np.testing.assert_allclose(torque, 0, atol=1e-11)


@each_kind
def test_dead_pressure_keeps_its_direction_in_space_and_a_following_one_turns(kind):
    """All around a body that has turned it gives no force, but a torque."""
    body = moved(block(kind))
    for face in FACES:
        body.add(kl.Pressure(face, 100.0))
    force, torque = resultant(body)
    np.testing.assert_allclose(force, 0, atol=1e-11)
    exact = -100 * 0.24 * np.cross(TURN.T, np.eye(3)).sum(axis=0)
    np.testing.assert_allclose(torque, exact, rtol=1e-11)
    assert np.linalg.norm(exact) > 10
    for load, normal in ((kl.Pressure("z+", 100.0), np.eye(3)), (kl.FollowerPressure("z+", 100.0), TURN)):
        single = moved(block(kind))
        single.add(load)
        np.testing.assert_allclose(resultant(single)[0], -24 * normal[:, 2], rtol=1e-12, atol=1e-12)


def volume(body, q):
    if isinstance(body, kl.PseudoRigidBody):
        return 0.24 * np.linalg.det(q[:9].reshape(3, 3))
    x = kl.Mesh(body.points + q.reshape(-1, 3), body.mesh.blocks)
    return float(kl.RigidBody(x, body.material).mass_properties.volume)


@soft_kind
def test_following_pressure_works_by_the_change_of_volume(kind):
    body = stirred(kind)
    for face in FACES:
        body.add(kl.FollowerPressure(face, 30.0))
    du = 1e-5 * body.u
    change = volume(body, body.q + du) - volume(body, body.q - du)
    assert body.external_force() @ (2 * du) == pytest.approx(-30 * change, rel=1e-7)


# ---- potentials ------------------------------------------------------------------------------------

CONSERVATIVE = [
    kl.Gravity((1.0, 2.0, -9.81)),
    kl.Force(at(0.2, 0.3, 0.5), (10.0, -20.0, 30.0)),
    kl.Traction("x+", (10.0, -20.0, 5.0)),
    kl.Pressure("z+", 70.0),
    kl.Spring(at(0.2, 0.3, -0.5), (1.0, 1.0, 1.0), 200.0, length=0.4),
]


@each_kind
@pytest.mark.parametrize("load", CONSERVATIVE, ids=lambda load: type(load).__name__)
def test_a_load_is_the_slope_of_its_potential(kind, load):
    body, potentials = stirred(kind), []
    body.add(load, amplitude=1.5)
    slope, places = float(body.external_force() @ body.u), [on_its_way(body, t) for t in (1e-5, -1e-5)]
    for q in places:
        body.set_configuration(q)
        potentials.append(float(body.potential_energy()))
    assert (potentials[1] - potentials[0]) / 2e-5 == pytest.approx(slope, rel=1e-7)


@each_kind
def test_loads_that_change_have_no_potential(kind):
    body = block(kind)
    body.add(kl.Gravity((0, 0, -9.81)), amplitude=kl.TimeSeries([0, 1], [1, 2]))
    body.add(kl.FollowerPressure("z+", 5.0))
    body.add(kl.Force(CENTER, (1.0, 2, 3), frame="follower"))
    assert float(body.potential_energy()) == 0


# ---- series ----------------------------------------------------------------------------------------


def test_a_series_is_constant_outside_and_straight_inside():
    series = kl.TimeSeries([1.0, 2.0, 4.0], [3.0, 5.0, 1.0])
    assert [series(t) for t in (0, 1, 1.5, 2, 3, 4, 9)] == [3, 3, 4, 5, 3, 1, 1]
    assert series.integral(0, 5) == pytest.approx(3 + 4 + 6 + 1, rel=1e-15)
    assert series.integral(1.5, 1.5) == 0
    for a, b in ((0.2, 3.7), (1.0, 2.0), (3.3, 8.0)):
        assert series.integral(a, b) == pytest.approx(
            series.integral(a, 2.5) + series.integral(2.5, b) if a < 2.5 else series.integral(a, b)
        )
    assert kl.TimeSeries([0.0], [2.0])(7) == 2.0


def test_gravity_on_a_part_of_a_body_without_material_takes_its_mean_density():
    mesh = kl.box((2.0, 1.0, 1.0), (2, 1, 1))
    body = kl.RigidBody(mesh, mass_properties=kl.MassProperties(mass=8.0, inertia=np.eye(3)))
    body.add(kl.Gravity((0.0, 0.0, -10.0), where=[0]))  # one of two equal elements
    np.testing.assert_allclose(body.external_force()[3:], [0.0, 0.0, -40.0], atol=1e-12)


@each_kind
def test_a_load_that_a_function_of_time_gives_acts_as_the_one_of_that_time(kind):
    body, twin = block(kind), block(kind)
    body.add(kl.TimeDependentLoad(lambda t: kl.Traction("x+", (10.0 * t, 0, 5.0)) if t < 2 else None))
    twin.add(kl.Traction("x+", (15.0, 0, 5.0)))
    np.testing.assert_allclose(body.external_force(time=1.5), twin.external_force(), atol=1e-14)
    assert not body.external_force(time=3.0).any()
    assert float(body.potential_energy()) == 0
