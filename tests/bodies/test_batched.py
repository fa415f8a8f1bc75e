"""Many bodies at once: as lists, and as one object that holds them all."""

import numpy as np
import pytest
from motions import end

import kratos_lite as kl

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
    single = kl.RigidBody(
        mass_properties=kl.MassProperties.box((0.4, 0.6, 1.0), 1000.0), integrator="RIG_IMP"
    )
    single.set_velocity((0, 1, 0), (0.05, 10, 0.05))
    single.add(kl.Gravity((0, 0, -9.81)))
    end(single, 1e-3, 100)
    np.testing.assert_allclose(many.q[1], single.q, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (lambda bodies: bodies.clear(), kl.InputError, "there is no body to advance"),
        (lambda bodies: bodies.append(bodies[0]), kl.InputError, "a body occurs twice in a batch"),
        (
            lambda b: setattr(b[1], "integrator", "RIG_IMP"),
            kl.InputError,
            "same integrator.*body 1 'implicit'",
        ),
        (lambda b: setattr(b[1], "time", 3.0), kl.InputError, "need the same time"),
        (lambda b: b[1].constrain(kl.FixPoint(b[1].center)), kl.ModelError, "body 1 has constraints"),
        (
            lambda b: b[1].add(kl.Gravity((0, 0, 1.0)), amplitude=kl.TimeSeries([0, 1], [0, 1])),
            kl.ModelError,
            "body 1 has constraints or loads that change",
        ),
        (
            lambda b: b[1].add(kl.Force((0.1, 0.1, 0.1), (0, 0, 1.0))),
            kl.ModelError,
            "or as it turns, as the moment of a spatial force off the mass center does",
        ),
        (
            lambda b: b.append(kl.FiniteElementBody(kl.box(), kl.Isotropic3D(1.0, 0.0, 1.0))),
            kl.ModelError,
            "only single rigid and pseudo-rigid bodies form a batch",
        ),
        (
            lambda b: b.append(kl.PseudoRigidBody(kl.box(), kl.Isotropic3D(1.0, 0.0, 1.0))),
            kl.InputError,
            "need the same kind",
        ),
        (lambda b: b.append("body"), kl.ModelError, "only single rigid and pseudo-rigid bodies form a batch"),
    ],
)
def test_bodies_that_cannot_advance_together(change, error, words):
    bodies = herd(kl.RigidBody, "RIG_NEG", count=2)
    change(bodies)
    before = [body.q.tolist() for body in bodies if isinstance(body, kl.Body)]
    with pytest.raises(error, match=words):
        list(kl.integrate(bodies, 1e-3, 3))
    assert [body.q.tolist() for body in bodies if isinstance(body, kl.Body)] == before
