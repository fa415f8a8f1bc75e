"""States: a body that stops and goes on from a file does bit by bit what it would have done."""

import numpy as np
import pytest

import kratos_lite as kl

BODIES = [
    *((kl.RigidBody, integrator, {}) for integrator in ("RIG_POS", "RIG_NEG", "RIG_IMP")),
    *((kl.PseudoRigidBody, integrator, {}) for integrator in ("DEF_EXP", "DEF_LIM", "ENERGY_MOMENTUM")),
    *((kl.FiniteElementBody, integrator, {}) for integrator in ("DEF_EXP", "DEF_LIM", "ENERGY_MOMENTUM")),
    *(
        (kl.FiniteElementBody, integrator, {"formulation": "corotational"})
        for integrator in ("DEF_EXP", "DEF_LIM")
    ),
    (kl.FiniteElementBody, "DEF_LIM", {"formulation": "modal", "modes": 15}),
]
LOADS = ("free", "constant", "changing", "held")
each = pytest.mark.parametrize(
    ("kind", "integrator", "options"),
    BODIES,
    ids=[f"{k.__name__}-{s}-{o.get('formulation', '')}" for k, s, o in BODIES],
)


def body_of(brick, kind, integrator, options, loads):
    if kind is not kl.RigidBody:
        options = {**options, "damping": 1e-4}
    body = brick(kind, cells=(1, 1, 2), integrator=integrator, **options)
    body.set_velocity((1, 2, 3), (0.5, 8, -0.3))
    if loads != "free":
        body.add(kl.Gravity((0, 0, -9.81)))
        body.add(kl.Force((0.2, 0.3, 0.5), (10.0, 0, 5), frame="follower"))
    if loads == "changing":
        body.add(
            kl.Force((0.2, 0.3, 0.5), (0, 30.0, 5)), amplitude=kl.TimeSeries([0, 0.004, 0.008], [0, 1, -1])
        )
        body.add(kl.Spring((0.2, -0.3, 0.5), (1, 1, 1), 300.0, damping=2.0, length=0.8))
    if loads == "held":
        body.set_velocity()
        body.constrain(kl.FixPoint((0.2, 0.3, 0.5)))
        body.constrain(
            kl.PrescribedDisplacement((-0.2, 0.3, 0.5), (0, 0, 1), kl.TimeSeries([0, 0.008], [0, 0.0016]))
        )
    return body


def end(body, steps, **options):
    for _ in kl.integrate(body, 1e-3, steps, **{"every": steps, **options}):
        pass
    return kl.State.of(body)


def assert_same(one, other):
    assert (one.kind, one.time, one.step) == (other.kind, other.time, other.step)
    assert one.q.tolist() == other.q.tolist()
    assert one.u.tolist() == other.u.tolist()
    assert float(one.external_work) == pytest.approx(float(other.external_work), rel=1e-13, abs=1e-13)


@pytest.mark.parametrize("loads", LOADS)
@each
def test_going_on_from_a_file_changes_no_bit(kind, integrator, options, loads, brick, tmp_path):
    whole = body_of(brick, kind, integrator, options, loads)
    part = body_of(brick, kind, integrator, options, loads)
    end(part, 3)
    kl.write(tmp_path / "rest.npz", kl.State.of(part))
    fresh = body_of(brick, kind, integrator, options, loads)
    kl.read_state(tmp_path / "rest.npz").restore(fresh)
    assert_same(end(fresh, 4, every=3), end(whole, 7))


@pytest.mark.parametrize("loads", ["constant", "changing"])
@each
def test_substeps_are_shorter_steps(kind, integrator, options, loads, brick):
    parts = end(body_of(brick, kind, integrator, options, loads), 4, substeps=3)
    body = body_of(brick, kind, integrator, options, loads)
    for _ in kl.integrate(body, 1e-3 / 3, 12, every=12):
        pass
    assert parts.step == 4
    assert parts.time == pytest.approx(body.time, rel=1e-13)
    np.testing.assert_allclose(parts.q, body.q, atol=1e-13)
    np.testing.assert_allclose(parts.u, body.u, atol=1e-10)


def test_states_come_after_every_so_many_steps_and_at_the_end(brick):
    body, shares = brick(kl.RigidBody), []
    states = list(
        kl.integrate(body, 0.1, 7, every=3, progress=lambda what, share: shares.append((what, share)))
    )
    assert [state.step for state in states] == [3, 6, 7]
    np.testing.assert_allclose([state.time for state in states], [0.3, 0.6, 0.7], rtol=1e-14)
    assert shares == [("integrate", 3 / 7), ("integrate", 6 / 7), ("integrate", 1.0)]
    more = list(kl.integrate(body, 0.1, 2))
    assert [state.step for state in more] == [8, 9]


def test_an_integration_ends_where_it_is_told_to(brick):
    body = brick(kl.RigidBody)
    body.set_velocity((1, 0, 0))
    states = list(kl.integrate(body, 0.1, 100, until=lambda state: state.q[9] > 0.45))
    assert [round(float(state.q[9]), 12) for state in states] == [0.1, 0.2, 0.3, 0.4, 0.5]  # copies
    assert body.time == states[-1].time


def test_a_file_holds_no_objects(brick, tmp_path):
    path = tmp_path / "rest.npz"
    kl.write(path, kl.State.of(brick(kl.PseudoRigidBody)))
    with np.load(path, allow_pickle=False) as file:
        assert {"kind", "q", "u", "time", "step", "external_work"} <= set(file.files)
        assert all(file[name].dtype != object for name in file.files)


def test_a_state_of_another_body_is_refused(brick):
    state = kl.State.of(brick(kl.RigidBody))
    for other in (brick(kl.PseudoRigidBody), brick(kl.FiniteElementBody)):
        with pytest.raises(kl.InputError, match="this is the state of a rigid body"):
            state.restore(other)
    with pytest.raises(kl.InputError, match="does not fit"):
        kl.State.of(brick()).restore(brick(cells=(1, 1, 2)))
