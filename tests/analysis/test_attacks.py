"""What is easily lost or accepted: initial stress, changed models, nonsense from functions."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.analysis.equations_of_motion import EquationsOfMotion
from kratos_lite.analysis.modal import critical_rate


def wheel(motion=None):
    model = kl.Model(
        kl.annulus(0.3, 1.0, 0.25, cells=(2, 24, 1), element="KinematicLinear3D8N"),
        kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0),
    )
    model.fix("inner")
    if motion is not None:
        model.add(motion)
    return model


def strained(model, how):
    if how == "prestress":
        model.add_prestress((1e3, 1e3, 1e3, 0, 0, 0))
    else:
        model.set_stress_free_state(1e-3 * model.mesh.points)
    return model


@pytest.mark.parametrize("how", ["prestress", "stress-free"])
def test_initial_stress_acts_in_motion_too(how):
    plain = strained(wheel(), how).solve()
    slow = strained(wheel(kl.ale.Rotation("z", 1e-9)), how).solve()
    np.testing.assert_allclose(slow.u, plain.u, rtol=0, atol=1e-9 * np.abs(plain.u).max())
    np.testing.assert_allclose(slow.von_mises("node"), plain.von_mises("node"), rtol=1e-6)
    *_, late = kl.integrate(strained(wheel(), how).transient(rayleigh=(400.0, 0.0)), 2e-3, 400, every=400)
    np.testing.assert_allclose(late.u, plain.u, rtol=0, atol=1e-6 * np.abs(plain.u).max())


def spring(force=0.0):
    model = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0, density=1000.0))
    model.fix(lambda X: np.ones(len(X), dtype=bool), "xy")
    model.fix("z-", "z")
    model.add(kl.Traction("z+", (0, 0, 1e3)), amplitude=lambda t: np.sin(20 * t))
    model.add(kl.Traction("z+", (0, 0, force)))
    return model


@pytest.mark.parametrize(
    "integrator", [kl.HHT(-0.1), kl.Bossak(), kl.GeneralizedAlpha(0.5), kl.Newmark(0.3025, 0.6)]
)
def test_what_is_let_go_begins_with_the_acceleration_of_its_new_load(integrator, tmp_path):
    """A state of another load, put or read from a file, is the start of a new transient from there."""
    model = spring(1e3)
    *_, state = kl.integrate(model.transient(integrator=integrator), 1e-3, 30, every=30)
    kl.write(tmp_path / "loaded.npz", state)
    ends = []
    for given in (state, kl.read_state(tmp_path / "loaded.npz")):
        released = spring(-2e3).transient(integrator=integrator)
        given.restore(released)
        *_, end = kl.integrate(released, 1e-3, 10, every=10)
        ends.append(end.u)
    np.testing.assert_array_equal(*ends)
    e = EquationsOfMotion(spring(-2e3))
    balance = e.load(0.03) - e.times_stiffness(e.system.gather(state.u), 0.0)
    put = spring(-2e3).transient(integrator=integrator)
    state.restore(put)
    kl.integrate(put, 1e-3, 1)
    free = e.system.constraint_map.free
    assert e.mass.times(put.a)[free] == pytest.approx(balance[free], rel=1e-9)
    again = model.transient(integrator=integrator)
    state.restore(again)  # the same load: as it was, so that restarts are bitwise
    kl.integrate(again, 1e-3, 1)
    np.testing.assert_array_equal(again.a, e.system.gather(state.a))


def test_supports_that_rest_elsewhere_fit_their_own_states():
    """A constant displacement of all supports is no movement of the free nodes."""
    model = kl.Model(kl.box(cells=(1, 1, 2)), kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0))
    model.fix("z-", "x", 1e-3)
    model.fix("z-", "yz")
    transient = model.transient(displacement=model.solve().u)
    transient.state().restore(transient)
    *_, end = kl.integrate(transient, 1e-3, 20, every=20)
    end.restore(transient)
    np.testing.assert_allclose(end.u[:, 0], 1e-3, rtol=1e-9)
    assert not transient.equations.warnings
    (warning,) = model.transient().equations.warnings
    assert "supports are displaced by 0.001 m at the start of a model at rest" in warning


def test_functions_of_places_get_places_of_their_own():
    model = kl.Model(kl.box(), kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0))

    def scaled(X):
        X *= 1e3
        return X[:, 0] * 0 + 1.0

    before = model.mesh.points.copy()
    force = kl.Pressure("x+", scaled).forces(model.mesh, model.element_groups())
    np.testing.assert_allclose(force.sum(axis=0), [-1.0, 0, 0], atol=1e-14)

    def shifted(X):
        X -= 0.5
        return X[:, 2] < 0

    model.fix(shifted)
    np.testing.assert_array_equal(model.mesh.points, before)
    assert model.supports.fixed.sum() == 12


def test_a_transient_of_a_model_that_is_held_everywhere():
    model = wheel(kl.ale.Rotation("z", 5.0))
    model.fix(range(model.mesh.n_nodes))
    *_, end = kl.integrate(model.transient(), 1e-3, 3)
    assert not end.u.any()


@pytest.mark.parametrize(
    ("before", "force"),
    [(kl.Newmark(), 1e3), (kl.GeneralizedAlpha(0.5), 0.0), (kl.HHT(-0.3), 0.0)],
    ids=["another load", "generalized-α", "hht"],
)
def test_states_of_another_load_or_integrator_come_to_balance(before, force):
    *_, state = kl.integrate(spring().transient(integrator=before), 1e-3, 30, every=30)
    after = spring(force).transient()
    state.restore(after)
    e = after.equations
    for _ in kl.integrate(after, 1e-3, 20):
        left = e.mass.times(after.a) + e.times_stiffness(after.u, 0.0) - e.load(after.time)
        assert np.abs(e.system.constraint_map.reduce(left)).max() < 1e-9 * np.abs(e.mass.times(after.a)).max()


def test_states_that_do_not_fit_are_refused():
    model = spring()
    transient = model.transient()
    (state,) = kl.integrate(transient, 1e-3, 1)
    off = state.u.copy()
    off[0, 0] = 1.0
    for field, value, words in (
        ("step", 1.5, "the steps of a state must be a whole number ≥ 0; got 1.5"),
        ("u", off, "at t = 0.001 s the state does not fit the supports: node 1 along x is 1 m off"),
        ("a", off.astype(complex), "a of a state must be made of real numbers"),
    ):
        wrong = {"values": {**state.values, field: value}} if field in "uva" else {field: value}
        with pytest.raises(kl.InputError, match=words):
            replace(state, **wrong).restore(transient)


def test_damaged_files_of_moments_end_in_one_error(tmp_path):
    (state,) = kl.integrate(spring().transient(), 1e-3, 1)
    kl.write(tmp_path / "state.npz", state)
    whole, path = (tmp_path / "state.npz").read_bytes(), tmp_path / "damaged.npz"
    rng = np.random.default_rng(0)
    for trial in range(60):
        data = bytearray(whole[: rng.integers(len(whole))] if trial % 2 else whole)
        if not trial % 2:
            data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        if data != whole:
            with suppress(kl.InputError):  # a flip of a bit that no one reads does not matter
                kl.read_state(path)
    (tmp_path / "text.npz").write_text("time,energy")
    with pytest.raises(kl.InputError, match=r"not a state that kl\.write wrote, or not all of it$"):
        kl.read_state(tmp_path / "text.npz")
    with pytest.raises(kl.InputError, match="there is no such file"):
        kl.read_state(tmp_path / "none.npz")


def test_arguments_of_solutions_are_checked_with_a_motion_too():
    model = wheel(kl.ale.Rotation("z", 1.0))
    for options, words in (
        ({"solver": "foo"}, "foo"),
        ({"tolerance": -1}, "tolerance must be a number between 0 and 1"),
        ({"progress": 3}, "progress must be a function"),
    ):
        with pytest.raises(kl.InputError, match=words):
            model.solve(**options)
    with pytest.raises(kl.InputError, match="progress must be a function"):
        model.transient(progress=3)
    with pytest.raises(kl.InputError, match="a Result or a State is needed; got NoneType"):
        kl.reaction_resultant(model, None)
    with pytest.raises(kl.InputError, match="one for each unknown; got 100000"):
        critical_rate(model, 100_000)


def test_nonsense_is_told():
    assert kl.ale.Rotation((1e49, 0, 0)).direction.tolist() == [1, 0, 0]
    for value in (lambda t: None, lambda t: "fast", lambda t: [1.0, 2.0], lambda t: np.nan):
        with pytest.raises(kl.InputError, match="a rate at t = 0 s must be"):
            wheel(kl.ale.Rotation("z", rate=value)).solve()
    with pytest.raises(kl.InputError, match="count must be"):
        critical_rate(wheel(kl.ale.Rotation("z", 1.0)), -1)
    bar = kl.Model(kl.box((4, 1, 1), (4, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.3, density=1e3))
    with pytest.raises(kl.ModelError, match="not straight along the axis"):
        bar.add(kl.ale.Translation((1, 1, 0), 2.0))
