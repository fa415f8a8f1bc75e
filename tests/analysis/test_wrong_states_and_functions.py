"""States of other subjects, changes during a run, functions of wrong arguments: one clear error each."""

import re

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.errors import InputError, ModelError

SOIL = kl.Isotropic3D(E=1e7, nu=0.3, density=2000.0)


def model(cells=(1, 1, 1)):
    found = kl.Model(kl.box(cells=cells), SOIL)
    found.fix("z-")
    return found


def body(kind=kl.RigidBody):
    return kind(kl.box(), SOIL)


STATES = {
    "of a body": (lambda: kl.State.of(body()), "this is the state of a rigid body; one of a model is needed"),
    "of another mesh": (
        lambda: kl.State.of(model((2, 1, 1)).transient()),
        "u of a model has shape (8, 3) here",
    ),
    "a number": (lambda: 3, "a State of a model is needed"),
    "none at all": (lambda: kl.State("model", "newmark", 0.0, 0, {}), "has shape (8, 3) here; got none"),
}


@pytest.mark.parametrize("use", ["result", "energy", "material_velocity", "material_acceleration", "restore"])
@pytest.mark.parametrize("what", STATES)
def test_a_transient_takes_its_own_states_alone(what, use):
    make, words = STATES[what]
    with pytest.raises(InputError, match=re.escape(words)):
        getattr(model().transient(), use)(make())


OTHERS = r"this is the state of|a State of|this state does not fit"


@pytest.mark.parametrize("name", ["a.npz", "a.csv", "a.pvd"])
def test_a_series_takes_states_of_its_owner_alone(name, tmp_path):
    for owner, others in (
        (model().transient(), [make() for make, _ in STATES.values()]),
        (body(), [kl.State.of(body(kl.PseudoRigidBody)), kl.State.of(model().transient()), 3]),
    ):
        with kl.SeriesWriter(tmp_path / name, owner) as series:
            for other in others:
                with pytest.raises(InputError, match=OTHERS):
                    series.add(other)
        assert not (tmp_path / name).exists()


def test_a_path_is_drawn_from_states_of_the_body_alone(tmp_path):
    for owner, states, words in (
        (body(), [kl.State.of(model().transient())], "this is the state of a model"),
        (body(), [3], "a State of a rigid body is needed"),
        (body(), 3, "states in the order of time are needed; got 3"),
        (model().transient(), [], "there is no state to draw"),
    ):
        with pytest.raises(InputError, match=words):
            kl.plot(owner, tmp_path / "path.png", states=states)


@pytest.mark.parametrize("subject", [None, [body()], model(), 3])
def test_what_has_no_states(subject):
    words = r"a body, or a model in time, model.transient\(\), has states; got"
    with pytest.raises(InputError, match=words):
        kl.State.of(subject)
    with pytest.raises(InputError, match=words):
        kl.State.of(body()).restore(subject)


def spoiled(state, **changes):
    head = {name: changes.pop(name, getattr(state, name)) for name in ("kind", "integrator", "time", "step")}
    values = {name: value for name, value in {**state.values, **changes}.items() if value is not None}
    return kl.State(**head, values=values)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"time": np.nan}, "the time of a state must be finite|not finite"),
        ({"time": -1.0}, "the time of a state must be one number ≥ 0"),
        ({"step": -1}, "the steps of a state must be a whole number"),
        ({"q": np.full(12, np.nan)}, "q of a state must be finite|not finite"),
        ({"q": np.zeros(3)}, r"q of a rigid body has shape \(12,\) here; got \(3,\)"),
        ({"external_work": None}, "external_work of a rigid body has shape|no external_work|holds no"),
    ],
)
def test_a_body_goes_on_from_sound_states_alone(changes, words, tmp_path):
    subject = body()
    state = spoiled(kl.State.of(subject), **changes)
    with pytest.raises(InputError, match=words):
        state.restore(subject)
    head = {name: getattr(state, name) for name in ("kind", "integrator", "time", "step", "substeps")}
    np.savez(tmp_path / "s.npz", **head, **state.values)
    with pytest.raises(InputError, match=f"{words}|s.npz"):
        kl.read_state(tmp_path / "s.npz").restore(subject)
    assert np.isfinite(subject.q).all()


@pytest.mark.parametrize("name", ["u", "v", "a", "reactions", "imbalance"])
def test_a_model_goes_on_from_finite_states_alone(name):
    transient = model().transient()
    state = transient.state()
    with pytest.raises(InputError, match=f"{name} of a state must be finite"):
        transient.restore(spoiled(state, **{name: state.values[name] * np.nan}))


def test_substeps_are_part_of_a_written_state(tmp_path):
    *_, state = kl.integrate(body(), 0.1, 2, substeps=3)
    kl.write(tmp_path / "s.npz", state)
    assert kl.read_state(tmp_path / "s.npz").substeps == 3


@pytest.mark.parametrize(
    "change",
    [
        lambda m: m.fix("x+"),
        lambda m: m.fix("z-", "z", 1e-3, override=True),
        lambda m: m.add(kl.Gravity((0, 0, -9.81))),
        lambda m: m.loads.clear(),
    ],
)
def test_a_change_of_the_model_before_or_during_a_run_is_refused(change):
    subject = model()
    subject.add(kl.Gravity((0, 0, -1.0)))
    transient = subject.transient()
    states = kl.integrate(transient, 1e-3, 5)
    next(states)
    change(subject)
    with pytest.raises(ModelError, match="the model has changed since this analysis was made"):
        next(states)
    with pytest.raises(ModelError, match="the model has changed since this analysis was made"):
        kl.integrate(transient, 1e-3, 2)


def test_a_motion_comes_by_add_alone():
    subject = model()
    with pytest.raises(ModelError, match=r"give it to model\.add"):
        subject.motion = kl.ale.Translation("x", 1.0)
    assert subject.motion is None


WRONG = (lambda: 1.0, lambda t, u: 1.0, kl.TimeSeries)


@pytest.mark.parametrize("amplitude", WRONG)
def test_an_amplitude_is_a_function_of_the_time(amplitude):
    for subject in (model(), body()):
        with pytest.raises(InputError, match=r"the amplitude of a load must be a function of the time alone"):
            subject.add(kl.Gravity((0, 0, -9.81)), amplitude=amplitude)


@pytest.mark.parametrize("function", [*WRONG, 3.0, kl.Traction("x+", (0, 0, 1.0)), None])
def test_a_load_in_time_is_a_function_of_the_time(function):
    with pytest.raises(InputError, match="a function of time that returns a load is needed"):
        kl.TimeDependentLoad(function)


def test_compiled_functions_are_functions_too():
    subject = body()
    subject.add(kl.Force(subject.center, (1.0, 0, 0)), amplitude=np.sin)
    assert subject.external_force(time=1.0)[3] == pytest.approx(np.sin(1.0))


def test_until_takes_a_state_and_returns_one_answer():
    with pytest.raises(InputError, match="until must be a function of a state"):
        kl.integrate(body(), 0.1, 3, until=lambda: True)
    with pytest.raises(InputError, match=r"(?s)until must return True or False; got array.*use \.any"):
        list(kl.integrate(body(), 0.1, 3, until=lambda state: state.q > 0))


def test_statics_take_one_load_or_several():
    load = kl.Gravity((0, 0, -9.81))
    analysis = model().static()
    np.testing.assert_array_equal(analysis.solve(load).u, analysis.solve([load]).u)
    for wrong in (3, "z", {load: 1}):
        with pytest.raises(InputError, match="a load, or a list of them, is needed"):
            analysis.solve(wrong)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: model().transient(integrator="HHT"), "Did you mean hht"),
        (lambda: model().transient(integrator="central-difference"), "Did you mean central_difference"),
        (lambda: kl.PseudoRigidBody(kl.box(), SOIL, integrator="def_lim"), "Did you mean DEF_LIM"),
        (lambda: kl.RigidBody(kl.box(), SOIL, integrator="Explicit"), "Did you mean explicit"),
        (lambda: kl.FiniteElementBody(kl.box(), SOIL, formulation="bc_modal"), "Did you mean modal"),
        (lambda: kl.FiniteElementBody(kl.box(), SOIL, formulation="tl"), "Did you mean TL"),
    ],
)
def test_names_that_are_nearly_right_are_told(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize("path", [None, 3, [], b"a.json"])
def test_a_path_is_text(path):
    for use in (kl.read, kl.read_case, lambda path: kl.write(path, kl.box())):
        with pytest.raises(InputError, match="a path to a file must be text"):
            use(path)
