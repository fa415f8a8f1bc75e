"""Cases: every input becomes one, a file is parsed once, and one function runs them all."""

import json

import numpy as np
import pytest

import kratos_lite as kl
from kratos_lite.io.case import Outputs, TimeIntegration
from kratos_lite.io.run import ANALYSES, prepare

MATERIAL = {"E": 1e6, "nu": 0.3, "density": 1000.0}
BODY = """import kratos_lite as kl
body = kl.RigidBody(kl.box(), kl.Isotropic3D(1e6, 0.3, 1000.0))
dt, steps, every = 0.1, 4, 2
"""
RUN = """import kratos_lite as kl
model = kl.read("box.mdpa")
model.assign(kl.Isotropic3D(1e6, 0.3, 1000.0))
model.fix("z-")
model.add(kl.Gravity((0, 0, -10)))
case = kl.Case(model)
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh = kl.box()
    mesh = mesh.replace(parts={})
    kl.write("box.mdpa", mesh)
    return tmp_path


def written(text, name="run.py"):
    with open(name, "w") as file:
        file.write(text)
    return name


def held():
    model = kl.Model(kl.box(), kl.Isotropic3D(**MATERIAL))
    model.fix("z-")
    model.add(kl.Gravity((0, 0, -10)))
    return model


def test_every_input_is_a_case_with_its_analysis(folder):
    inputs = {
        "box.mdpa": "static",
        written(RUN, "static.py"): "static",
        written(RUN + "model.add(kl.ale.Translation('x', 1.0))\n", "steady.py"): "steady",
        written(RUN + "case.time = kl.TimeIntegration(0.1, 3)\n", "time.py"): "transient",
        written(RUN + "case.time = kl.TimeIntegration(1, 3, quasi_static={})\n", "steps.py"): "quasi_static",
        written(BODY, "body.py"): "bodies",
    }
    cases = {name: kl.read_case(name) for name in inputs}
    assert {name: case.analysis for name, case in cases.items()} == inputs
    assert {str(case.files[0]) for case in cases.values()} == set(inputs)
    assert [path.name for path in cases["static.py"].files] == ["static.py", "box.mdpa"]
    others = kl.Case(held(), modes=2), kl.Case(held(), harmonic={"omega": [1.0]})
    assert {*(case.analysis for case in others), *inputs.values()} == set(ANALYSES)


def test_a_case_of_python_is_run_and_written(folder):
    case = kl.Case(held(), outputs=kl.Outputs(["a.vtu"], json="a.json"))
    outcome = kl.run(case)
    assert not list(folder.glob("a.*"))
    assert outcome.write() == ["a.vtu", "a.json"]
    np.testing.assert_array_equal(outcome.result.u, held().solve().u)
    found = json.loads((folder / "a.json").read_text())["largest_displacement"]["value"]
    assert f"largest displacement  {found:.6e} m" in str(outcome)


def test_what_a_solution_did_without_is_behind_verbose(run, folder):
    outcome = kl.run(kl.Case(held()))
    assert not any(line.startswith("skipped") for line in outcome.summary())
    assert any(line.startswith("skipped") for line in outcome.summary(verbose=True))
    assert "skipped" not in run("solve", written(RUN)).rows
    assert "prescribed" in run("solve", "run.py", "--verbose").rows["skipped"]


def test_expected_values_are_compared_with_the_end(folder):
    case = kl.Case(held(), kl.TimeIntegration(1e-3, 4, every=4))
    case.expected.append(lambda result: f"check top passed ({result.u[-1, 2]:.3e})")
    outcome = kl.run(case)
    assert outcome.compare() == [f"check top passed ({outcome.result.u[-1, 2]:.3e})"]
    assert kl.run(kl.Case(held(), modes=1)).compare() == []


@pytest.mark.parametrize("analysis", [{"modes": 1}, {"harmonic": {"frequencies": [1.0]}}])
def test_modes_and_harmonic_responses_say_odd_constants_as_statics_does(analysis):
    body = held()
    body.assign(kl.Isotropic3D(E=210.0, nu=0.3, density=7850.0))
    assert any("is E in Pa" in text for _, text in kl.run(kl.Case(body, **analysis)).rows)


def test_states_of_a_case_come_without_files(folder):
    body, states = prepare(kl.read_case(written(BODY + "output = {'csv': 'a.csv'}\n")))
    assert [state.step for state in states] == [2, 4]
    assert body.step == 4
    assert [path.name for path in folder.iterdir() if path.suffix == ".csv"] == []
    with pytest.raises(kl.ModelError, match="this case is not in time"):
        prepare(kl.Case(held()))


def test_a_case_is_of_a_model_or_of_a_body(folder):
    with pytest.raises(kl.ModelError, match="it has no body"):
        kl.Case(held()).body  # noqa: B018
    with pytest.raises(kl.ModelError, match="it has no model"):
        kl.read_case(written(BODY)).model  # noqa: B018


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"step": 0.0, "steps": 1}, "a step must be one number"),
        ({"step": 1.0, "steps": 0}, "steps must be a whole number"),
        ({"step": 1.0, "steps": 1, "every": 0.5}, "every must be a whole number"),
        ({"step": 1.0, "steps": 1, "lumped": 1}, "lumped must be True or False"),
    ],
)
def test_wrong_time_integration_is_refused(numbers, message):
    with pytest.raises(kl.InputError, match=message):
        kl.TimeIntegration(**numbers)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda body: "run.json", "a case is run"),
        (lambda body: kl.Case(None), "needs a model or a body"),
        (kl.Case, "a body needs a time integration"),
        (lambda body: kl.Case(body, modes=2), "a body needs a time integration"),
        (lambda body: kl.Case(body, TimeIntegration(1e-3, 3, lumped=True)), "set them on the body"),
        (lambda body: kl.Case(body, TimeIntegration(1e-3, 3, integrator="explicit")), "set them on the body"),
        (lambda body: kl.Case(body, TimeIntegration(1e-3, 3), outputs=Outputs("q.vtu")), "list of paths"),
    ],
)
def test_a_case_that_means_nothing_is_refused(make, text):
    body = kl.RigidBody(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    with pytest.raises(kl.InputError, match=text):
        kl.run(make(body))
