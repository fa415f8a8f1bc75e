"""Scripts: what they define, and what is refused with its place."""

import re

import pytest

import kratos_lite as kl
from kratos_lite.io.files import read_case
from kratos_lite.io.run import describe_case, prepare
from kratos_lite.io.script import is_script

SCRIPT = """
import kratos_lite as kl
from helper import density
body = kl.RigidBody(kl.box(), kl.Isotropic3D(1e6, 0.3, density))
body.set_velocity((1, 0, 0))
dt, steps = 0.1, 10
output = {"csv": "out.csv"}
"""


BOX = """
import kratos_lite as kl
body = kl.PseudoRigidBody(kl.box((0.4, 0.6, 1.0), (1, 2, 2)), kl.Isotropic3D(1e6, 0.3, 1000.0))
body.set_velocity(angular=(0.05, 10, 0.05))
dt, steps = 0.01, 10
"""


def last(states):
    *_, state = states
    return state


@pytest.fixture
def script(tmp_path):
    (tmp_path / "helper.py").write_text("density = 7.0\n")

    def write(text):
        path = tmp_path / "swing.py"
        path.write_text(text)
        return path

    return write


def test_a_script_defines_a_scene(script, tmp_path):
    path = script(SCRIPT)
    assert is_script(path)
    found = read_case(path)
    assert found.files == [path]
    assert float(found.body.mass) == pytest.approx(7.0, rel=1e-14)
    assert found.outputs.results == [str(tmp_path / "out.csv")]
    assert last(prepare(found)[1]).q[9] == pytest.approx(1.5)


def test_a_script_may_hold_many_bodies(script):
    found = read_case(script(SCRIPT + "body = [body, kl.RigidBody(body.mesh, body.material)]\noutput = {}\n"))
    assert last(prepare(found)[1]).q.shape == (2, 12)


def test_a_script_may_define_a_case(script, tmp_path):
    kl.write(tmp_path / "box.mdpa", kl.Model(kl.box(), kl.Isotropic3D(1e6, 0.3, 1000.0)))
    mesh = str(tmp_path / "box.mdpa")
    path = script(f"import kratos_lite as kl\ncase = kl.Case(kl.read({mesh!r}), modes=2)\n")
    assert is_script(path)
    case = read_case(path)
    assert (case.analysis, case.files) == ("modal", [path, tmp_path / "box.mdpa"])
    assert kl.read(path).notes == case.model.notes


def test_a_description_says_what_is_doubtful(script):
    text = describe_case(read_case(script(BOX.replace("1e6, 0.3, 1000.0", "210.0, 0.3, 7850.0"))))
    assert re.search(r"^warning +the speed of waves .* 0\.164 m/s", text, flags=re.MULTILINE)


def test_a_description_says_what_there_is(script):
    more = "body.constrain(kl.FixPoint((0, 0, 0)))\noutput = {'csv': 'a.csv'}\n"
    text = describe_case(read_case(script(BOX + more)))
    for words in (
        "pseudo-rigid, 12 velocities, energy_momentum",
        "240 kg",
        "27.2, 23.2, 10.4 kg m²",
        "0.00584 s",
        "FixPoint (3)",
        "10 steps of 0.01 s",
        "a.csv",
    ):
        assert words in text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("case = 3\n", "case must be a kl.Case; got 3"),
        ("body = 1 / 0\n", r"swing\.py:1: ZeroDivisionError: division by zero"),
        ("body = (\n", r"swing\.py:1: "),
        ("import kratos_lite as kl\nbody = kl.box((1, 1, 0))\n", r"swing\.py:2: size must be three lengths"),
        ("body = 1\ndt = 1\n", "a script defines case, or body, dt, steps; 'steps' is missing"),
        ("body = 1\ndt = 1\nsteps = 1\n", "body must be a body such as kl.RigidBody"),
        (SCRIPT + "dt = 0\n", r"swing\.py: a step must be one number > 0, in s"),
        (SCRIPT + "output = 3\n", "output must be a dict"),
        (SCRIPT + "output = {'pdv': 'a'}\n", "unknown output 'pdv'. Did you mean pvd"),
    ],
)
def test_mistakes_in_scripts_have_their_place(script, text, message):
    with pytest.raises(kl.InputError, match=message):
        read_case(script(text))


def test_what_is_a_script_of_a_body(script, tmp_path):
    assert not is_script(script("body = 1\n"))
    assert not is_script(script("body = (\n"))
    assert not is_script(tmp_path / "none.py")
    with pytest.raises(kl.InputError, match="there is no such file"):
        read_case(tmp_path / "a.py")
