"""Bodies on the command line: summary, files, restart, interruption, and what goes wrong."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest
from children import interrupted

import kratos_lite as kl

SCENE = """import kratos_lite as kl
body = kl.{kind}(kl.box((0.4, 0.6, 1.0), (1, 2, 2)), kl.Isotropic3D(1e6, 0.3, 1000.0){options})
body.set_velocity((1, 2, 3), (0.05, 10, 0.05))
body.add(kl.Gravity((0, 0, -9.81)))
dt, steps, every = 0.005, 20, 5
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write()
    return tmp_path


def write(more="", name="box.py", kind="PseudoRigidBody", options=""):
    with open(name, "w") as file:
        file.write(SCENE.format(kind=kind, options=options) + more)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_summary_with_the_numbers(run, folder):
    done = run("solve", "box.py")
    assert (done.code, done.err) == (0, "")
    rows = done.rows
    assert rows["body"] == "pseudo-rigid, 12 velocities, energy_momentum"
    assert rows["mass"] == "240 kg"
    assert rows["time"] == "0 … 0.1 s, 20 steps"
    assert rows["linear momentum"] == f"(240, 480, {240 * (3 - 0.981):.6g}) kg m/s"
    assert rows["angular momentum"].startswith("(1.36, 232, 0.52) kg m²/s")
    assert rows["mass center"] == f"(0.3, 0.5, {0.5 + 0.3 - 9.81 / 200:.6g}) m"
    # ½ m v² + 1160.047 J of the spin + m g z
    assert rows["sum of energies"] == f"{120 * 14 + 1160.047 + 240 * 9.81 * 0.5:.7g} J"
    assert abs(float(rows["energy drift"].split()[0])) < 1e-13
    fallen = 3 * 0.1 - 9.81 / 200
    assert rows["external work"].startswith(f"{-240 * 9.81 * fallen:.7g} J, of all loads")
    assert "dissipated" not in rows
    assert re.match(r"\S+ s, \S+ s in all", rows["time per step"])
    assert names(folder) == ["box.py"]


def test_with_damping_the_loss_is_no_drift(run, folder):
    write("body.loads.clear()\n", options=", damping=1e-3")
    scene, rows = run("info", "box.py").rows, run("solve", "box.py").rows
    lost = float(scene["energy"].split()[0]) - float(rows["sum of energies"].split()[0])
    assert lost > 1
    assert float(rows["dissipated"].split()[0]) == pytest.approx(lost, rel=1e-3)
    assert "energy drift" not in rows


def test_missing_folders_are_made_by_a_run_alone(run, folder):
    words = ("box.py", "-o", "a/b/o.csv", "--state", "c/end.npz", "-q")
    write("output = {'csv': 'x/o.csv'}\n")
    assert run("check", "box.py").code == 0
    assert names(folder) == ["box.py"]
    assert run("solve", *words).code == 0
    assert names(folder) == ["a", "box.py", "c"]
    assert (folder / "a" / "b" / "o.csv").is_file()


def test_all_outputs_of_a_scene_lie_beside_it(run, folder):
    pytest.importorskip("matplotlib")
    keys = {"pvd": "o.pvd", "csv": "o.csv", "npz": "o.npz", "picture": "o.png", "state": "end.npz"}
    (folder / "inner").mkdir()
    write(f"output = {keys}\n", "inner/box.py")
    done = run("solve", "inner/box.py")
    assert done.code == 0
    frames = [f"o_0000{i}.vtu" for i in range(5)]  # the start, and four states
    assert names(folder / "inner") == sorted(["box.py", *keys.values(), *frames])
    assert done.out.count("written") == 5
    assert (folder / "inner" / "o.png").read_bytes()[:4] == b"\x89PNG"
    assert np.load(folder / "inner" / "o.npz")["step"].tolist() == [0, 5, 10, 15, 20]
    assert kl.read_state(folder / "inner" / "end.npz").step == 20


def test_options_win_over_the_scene(run, folder):
    write("output = {'csv': 'a.csv'}\n")
    assert run("solve", "box.py", "-o", "b.csv", "--steps", "3", "-q").out == ""
    assert names(folder) == ["b.csv", "box.py"]
    assert [line.split(",")[0] for line in (folder / "b.csv").read_text().splitlines()[1:]] == [
        "0.0",
        "0.015",
    ]


def test_a_restart_comes_to_the_same_end(run, folder):
    run("solve", "box.py", "-q", "--state", "whole.npz")
    run("solve", "box.py", "-q", "--steps", "10", "--state", "half.npz")
    done = run("solve", "box.py", "--restart", "half.npz", "--steps", "10", "--state", "end.npz")
    assert done.rows["time"] == "0.05 … 0.1 s, 10 steps"
    whole, end = kl.read_state("whole.npz"), kl.read_state("end.npz")
    assert (whole.time, whole.step) == (end.time, end.step)
    np.testing.assert_array_equal(whole.q, end.q)
    write("case = kl.Case(body, kl.TimeIntegration(dt, 10, restart='half.npz'))\n")
    assert run("solve", "box.py", "--state", "again.npz", "-q").code == 0
    np.testing.assert_array_equal(kl.read_state("again.npz").u, end.u)


def test_a_restart_of_another_kind_is_refused(run, folder):
    run("solve", "box.py", "-q", "--state", "half.npz")
    write(kind="RigidBody")
    assert run("solve", "box.py", "--restart", "half.npz").refuses("state of a pseudo-rigid body")
    assert run("solve", "box.py", "--restart", "none.npz").refuses("none.npz: there is no such file")


def test_an_explicit_step_that_is_too_long_is_refused_before_any_output(run, folder):
    stiff, time = ", integrator='DEF_EXP'", "dt, steps = 0.1, 5\n"
    write(time, options=stiff)
    for command in ("solve", "check"):
        assert run(command, "box.py").refuses("explicit integrator is not", "the critical step is 0.00584 s")
    write(f"{time}substeps = 'auto'\n", options=stiff)
    assert run("solve", "box.py", "-q").code == 0


def test_what_exists_is_kept_when_a_run_fails(run, folder):
    with open("fails.py", "w") as file:
        file.write(
            "import numpy as np\nimport kratos_lite as kl\n"
            "body = kl.RigidBody(kl.box(), kl.Isotropic3D(1e6, 0.3, 1.0))\n"
            "body.add(kl.Callback(lambda q, u, t: np.full(6, np.nan if t > 0.2 else 0.0)))\n"
            "dt, steps = 0.1, 10\n"
        )
    done = run("solve", "fails.py", "-o", "a.csv", "--state", "s.npz")
    assert done.code == 2
    assert "error: what a callback returns at t = 0.25 s must be finite" in done.err
    assert len((folder / "a.csv").read_text().splitlines()) == 4
    assert kl.read_state("s.npz").step == 2


@pytest.mark.skipif(os.name != "posix", reason="Ctrl-C is sent as a signal")
def test_ctrl_c_keeps_what_is_there(folder):
    write("dt, steps, every = 0.001, 1_000_000, 1\n", kind="FiniteElementBody")
    words = [sys.executable, "-m", "kratos_lite", "solve", "box.py", "-o", "o.pvd", "--state", "end.npz"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    out, err = interrupted(process, folder / "o_00003.vtu")
    assert (process.returncode, out) == (130, "")
    assert "interrupted" in err
    index = re.findall(r'file="(\S+)"', (folder / "o.pvd").read_text())
    assert len(index) >= 4
    assert all((folder / name).exists() for name in index)
    step = kl.read_state("end.npz").step
    again = subprocess.run(
        [*words[:5], "--restart", "end.npz", "--steps", "1"], capture_output=True, text=True, check=True
    )
    assert f"{step / 1000:.6g} …" in again.stdout


def test_progress_is_shown_where_asked_for(run, folder):
    write("dt, steps, every = 1e-4, 3000, 1\n")
    done = run("solve", "box.py", "-q", "--progress")
    assert done.out == ""
    assert re.search(r"\rintegrate +\d+%", done.err)


def test_check_and_info(run, folder):
    done = run("check", "box.py")
    assert (done.code, done.err) == (0, "")
    assert done.out == "box.py: pseudo-rigid body, 20 steps of 0.005 s, no errors\n"
    done = run("info", "box.py")
    assert done.rows["file"] == "box.py"
    assert done.rows["inertia xx, yy, zz"] == "27.2, 23.2, 10.4 kg m²"
    assert done.rows["critical step"].startswith("0.00584 s")
    assert done.rows["time"] == "from 0 s, 20 steps of 0.005 s"
    write("body.add(kl.Gravty())\n")
    for command in ("check", "info", "solve"):
        assert run(command, "box.py").refuses("box.py:6: AttributeError: ", "'Gravty'")


def test_a_script_sees_no_options_of_the_command(run, folder, monkeypatch):
    with open("spin.py", "w") as file:
        file.write(
            "import sys\nimport kratos_lite as kl\n"
            "body = kl.RigidBody(kl.box(), kl.Isotropic3D(1e6, 0.3, 1000.0))\n"
            "assert sys.argv == ['spin.py'], sys.argv\n"
            "dt, steps = 0.1, 2\n"
        )
    words = ["kratos-lite", "solve", "spin.py"]
    monkeypatch.setattr(sys, "argv", words)
    assert run("solve", "spin.py").err == ""
    assert sys.argv is words


def test_many_bodies_of_a_script(run, folder):
    with open("many.py", "w") as file:
        file.write(
            "import kratos_lite as kl\n"
            "body = kl.RigidBody(mass_properties=kl.MassProperties.box([(1, 1, 1)] * 5, density=2.0))\n"
            "body.set_velocity((1, 0, 0))\n"
            "dt, steps = 0.1, 10\n"
        )
    done = run("solve", "many.py", "-o", "many.npz")
    assert done.rows["body"] == "5 × rigid, 6 velocities, momentum_conserving"
    assert done.rows["kinetic energy"] == "5 J"
    assert np.load("many.npz")["q"].shape == (11, 5, 12)
    assert run("solve", "many.py", "-o", "a.csv").refuses("a.csv: only a single body")


def test_bad_targets_are_refused_before_the_run(run, folder):
    write("dt, steps = 1e-9, 10**9\n")
    assert run("solve", "box.py", "-o", "box.py/o.pvd").refuses("the folder box.py does not exist")
    assert run("solve", "box.py", "-o", "none/o.txt").refuses("none/o.txt: states in time are written")
    assert run("solve", "box.py", "-o", "o.vtu").refuses("o.vtu: states in time are written")
    assert run("solve", "box.py", "--state", "o.csv").refuses("o.csv: the ending must be .npz")
    assert run("solve", "box.py", "-o", "o.npz", "--state", "o.npz").refuses("another output")
    assert run("solve", "box.py", "--steps", "0").refuses("--steps: a whole number ≥ 1 is needed; got '0'")
    assert names(folder) == ["box.py"]


def test_what_bodies_do_not_take_is_refused(run, folder):
    assert run("convert", "box.py", "a.mdpa").refuses("describes a body; only meshes and models")
    assert run("solve", "none.py").refuses("none.py")
    for words in (["--fix", "z-:xyz"], ["--modes", "3"], ["--rotation", "z:1"], ["--integrator", "hht"]):
        assert run("solve", "box.py", *words).refuses(f"{words[0]} is for models; box.py describes a body")
    assert run("solve", "box.py", "--json", "a.json").refuses("a body has no summary in .json")
    with pytest.raises(kl.InputError, match=r"box\.py: describes a body; read it with kl\.read_case"):
        kl.read("box.py")


def test_debug_shows_the_traceback(run, folder):
    write("kl.Rigit()\n")
    with pytest.raises(kl.InputError, match="Rigit"):
        run("solve", "box.py", "--debug")


@pytest.mark.parametrize("command", ["info", "check"])
def test_help_of_other_commands_names_scenes(run, command):
    text = " ".join(run(command, "--help").out.split())
    assert "a .py script with a case, or with body, dt and steps" in text
    assert re.search(rf"kratos-lite {command} examples/bodies/\w+\.py", text)
