"""Many bodies at once: as lists, and as one object that holds them all."""

import numpy as np
import pytest
from motions import end

import kratos_lite as kl
from kratos_lite.bodies.batched import batch, groups_of

INTEGRATORS = [
    *((kl.RigidBody, integrator) for integrator in ("RIG_POS", "RIG_NEG", "RIG_IMP")),
    *((kl.PseudoRigidBody, integrator) for integrator in ("DEF_EXP", "DEF_LIM", "ENERGY_MOMENTUM")),
]
each = pytest.mark.parametrize(("kind", "integrator"), INTEGRATORS)


def herd(kind, integrator, count=5, damping=0.0):
    """Return bodies of unlike sizes, materials, loads and velocities."""
    rng, bodies = np.random.default_rng(8), []
    for i in range(count):
        mesh = kl.box(tuple(rng.uniform(0.5, 1.5, 3)))
        material = kl.Isotropic3D(E=1e5 * (1 + i), nu=0.1 * (i % 4), density=500.0 + 100 * i)
        options = {"damping": damping} if kind is kl.PseudoRigidBody else {}
        body = kind(mesh, material, integrator=integrator, **options)
        body.set_velocity(rng.uniform(-1, 1, 3), rng.uniform(-3, 3, 3))
        if i % 2:
            body.add(kl.Gravity((0, 0, -9.81)))
            frame = "follower" if kind is kl.RigidBody else "spatial"  # F stretches a follower
            body.add(kl.Force(mesh.points[3], rng.uniform(-9, 9, 3), frame=frame), amplitude=2.0)
        if i == 3:
            body.add(kl.Force(body.center, (1.0, 2, 3)))
        if i == 4 and kind is kl.RigidBody:
            body.add(kl.Torque((1.0, 2, 3)))
            body.add(kl.Torque((3.0, 2, 1), frame="follower"))
        bodies.append(body)
    return bodies


@pytest.mark.parametrize("damping", [0.0, 1e-3])
@each
def test_each_moves_as_if_it_were_alone(kind, integrator, damping):
    bodies, alone = herd(kind, integrator, damping=damping), herd(kind, integrator, damping=damping)
    states = list(kl.integrate(bodies, 2e-3, 20, every=10)) + list(kl.integrate(bodies, 2e-3, 10, every=10))
    assert [state.step for state in states] == [10, 20, 30]
    assert states[-1].q.shape == (5, 12)
    for i, body in enumerate(alone):
        end(body, 2e-3, 30)
        np.testing.assert_allclose(states[-1].q[i], body.q, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(bodies[i].q, body.q, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(bodies[i].u, body.u, rtol=1e-10, atol=1e-10)
        assert bodies[i].time == body.time
        assert bodies[i].step == 30
        assert float(bodies[i].energy()) == pytest.approx(float(body.energy()), rel=1e-10)
        assert float(bodies[i].external_work) == pytest.approx(float(body.external_work), rel=1e-9, abs=1e-9)


def test_one_object_holds_many():
    many = kl.RigidBody(
        mass_properties=kl.MassProperties.box([[1.0, 2, 3], [0.4, 0.6, 1]], [1.0, 1000.0]),
        integrator="RIG_IMP",
    )
    many.set_velocity([[1, 0, 0], [0, 1, 0]], [[0, 0, 2], [0.05, 10, 0.05]])
    many.add(kl.Gravity((0, 0, -9.81)))
    L, E = many.angular_momentum(), many.energy()
    end(many, 1e-3, 100)
    assert many.q.shape == (2, 12)
    np.testing.assert_allclose(many.angular_momentum(), L, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(many.energy(), E, rtol=1e-6)
    np.testing.assert_allclose(many.mass_center()[:, 2], -9.81 * 0.01 / 2, rtol=1e-12)


STIFF = kl.Isotropic3D(E=1e12, nu=0.3, density=800.0)
SOFT = kl.Isotropic3D(E=1e5, nu=0.3, density=800.0)
POINT = (0.5, 0.5, 0.5)


def mixed():
    """Return bodies of all kinds: two batches, and others alone."""
    brick = kl.box((0.5, 0.6, 0.7))
    bodies = [
        kl.RigidBody(brick, SOFT),
        kl.FiniteElementBody(brick, SOFT, damping=1e-4),
        kl.PseudoRigidBody(brick, SOFT, integrator="explicit"),
        kl.RigidBody(brick, SOFT),
        kl.FixedBody(brick),
        kl.FiniteElementBody(brick, SOFT, formulation="corotational"),
        kl.PseudoRigidBody(brick, SOFT, integrator="explicit"),
        kl.RigidBody(brick, SOFT),
        kl.PseudoRigidBody(brick, SOFT),
    ]
    for i, body in enumerate(bodies):
        body.set_velocity((i, 0, 1.0), (0, 1.0, 0.1 * i))
        if not isinstance(body, kl.FixedBody):
            body.add(kl.Gravity((0, 0, -9.81)))
    bodies[3].add(kl.Spring(bodies[3].center, POINT, 100.0))
    bodies[7].set_velocity((0, 0, 0))
    bodies[7].constrain(kl.FixPoint(bodies[7].center))
    return bodies


def test_bodies_of_any_kinds_move_as_if_they_were_alone():
    bodies, alone, h = mixed(), mixed(), 1e-3
    runs = [*kl.integrate(bodies, h, 5, every=2), *kl.integrate(bodies, h, 4, every=4, substeps="auto")]
    assert [[state.step for state in states] for states in runs] == [[i] * 9 for i in (2, 4, 5, 9)]
    for body, single, state in zip(bodies, alone, runs[-1], strict=True):
        end(single, h, 9)
        assert (state.kind, state.time) == (single.kind, single.time)
        for name in ("q", "u", "external_work"):
            np.testing.assert_array_equal(getattr(state, name), getattr(body, name))
            np.testing.assert_allclose(getattr(body, name), getattr(single, name), rtol=1e-12, atol=1e-12)


def test_a_list_goes_on_from_states():
    bodies, others = mixed(), mixed()
    *_, half = kl.integrate(bodies, 1e-3, 4)
    for state, body in zip(half, others, strict=True):
        state.restore(body)
    ends = [
        list(kl.integrate(some, 1e-3, 3, until=lambda states: states[0].step == 6))
        for some in (bodies, others)
    ]
    assert len(ends[0]) == 2
    for one, other in zip(ends[0][-1], ends[1][-1], strict=True):
        assert (one.step, one.q.tolist(), one.u.tolist()) == (6, other.q.tolist(), other.u.tolist())


@pytest.mark.parametrize("stop", [KeyboardInterrupt, kl.SolveError])
def test_a_list_that_is_stopped_stays_together(stop):
    """All bodies are in the states yielded last, and go on from there."""
    bodies, whole = mixed(), mixed()
    runs = kl.integrate(bodies, 1e-3, 6, every=2)
    first = next(runs)

    def fail(*_):
        raise stop("stopped")

    bodies[5].external_force = fail
    with pytest.raises(
        stop, match="stopped" if stop is KeyboardInterrupt else "^body 5 of the list: stopped"
    ):
        next(runs)
    del bodies[5].external_force
    for body, state in zip(bodies, first, strict=True):
        assert (body.time, body.step, body.q.tolist()) == (state.time, 2, state.q.tolist())
    for some, steps in ((bodies, 4), (whole, 6)):
        *_, last = kl.integrate(some, 1e-3, steps, every=2)
    for body, state in zip(bodies, last, strict=True):
        assert body.q.tolist() == state.q.tolist()


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (lambda bodies: bodies.clear(), kl.InputError, "there is no body to advance"),
        (lambda bodies: bodies.append(bodies[0]), kl.InputError, "a body occurs twice in a list"),
        (
            lambda b: setattr(b[1], "time", 3.0),
            kl.InputError,
            "same time and number of steps: body 0 is at 0 s after 0, body 1 at 3 s after 0",
        ),
        (lambda b: b.append("body"), kl.InputError, "bodies alone; body 2 is 'body'"),
        (
            lambda b: b.append(kl.PseudoRigidBody(kl.box(), STIFF, integrator="explicit")),
            kl.InputError,
            "body 2 of the list: the explicit integrator is not stable",
        ),
    ],
)
def test_lists_that_are_refused(change, error, words):
    bodies = herd(kl.RigidBody, "RIG_NEG", count=2)
    change(bodies)
    before = [body.q.tolist() for body in bodies if isinstance(body, kl.Body)]
    with pytest.raises(error, match=words):
        list(kl.integrate(bodies, 1e-3, 3))
    assert [body.q.tolist() for body in bodies if isinstance(body, kl.Body)] == before


@pytest.mark.parametrize(
    "change",
    [
        lambda b: setattr(b[1], "integrator", "RIG_IMP"),
        lambda b: b[1].constrain(kl.FixPoint(b[1].center)),
        lambda b: b[1].add(kl.Gravity((0, 0, 1.0)), amplitude=kl.TimeSeries([0, 1], [0, 1])),
        lambda b: b[1].add(kl.Force((0.1, 0.1, 0.1), (0, 0, 1.0))),
        lambda b: b.__setitem__(1, kl.FiniteElementBody(kl.box(), SOFT)),
        lambda b: b.__setitem__(1, kl.PseudoRigidBody(kl.box(), SOFT)),
    ],
)
def test_what_is_no_batch(change):
    bodies = herd(kl.RigidBody, "RIG_NEG", count=2)
    change(bodies)
    assert len(groups_of(bodies)) == 2
    with pytest.raises(kl.ModelError, match="body 1 does not form a batch with the others"):
        batch(bodies)
