"""Transients of models from scripts and options: bit by bit those of Python, and what goes wrong."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from children import interrupted

import kratos_lite as kl

MATERIAL = {"E": 3e10, "nu": 0.2, "density": 2500.0}
SCENE = """import kratos_lite as kl
tower = kl.read("tower.mdpa")
tower.assign(kl.Isotropic3D(E=3e10, nu=0.2, density=2500.0))
tower.fix("z-")
tower.add(kl.Traction("z+", (1e5, 0.0, 0.0)))
case = kl.Case(tower, kl.TimeIntegration({time}), outputs=kl.Outputs({outputs}))
"""
WORDS = ("--material", "E=3e10,nu=0.2,density=2500", "--fix", "z-:xyz", "--traction", "z+:1e5,0,0")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder, the current one, with the mesh of a tower."""
    monkeypatch.chdir(tmp_path)
    mesh = kl.box((0.2, 0.2, 2.0), cells=(1, 1, 6))
    mesh = mesh.replace(parts={})
    kl.write("tower.mdpa", mesh)
    return tmp_path


def write(more="", outputs="", time="1e-3, 20, 5"):
    """Write the script of a tower, with more lines at its end."""
    with open("run.py", "w") as file:
        file.write(SCENE.format(time=time, outputs=outputs) + more)


def tower(load=None):
    model = kl.Model(kl.read("tower.mdpa").mesh, kl.Isotropic3D(**MATERIAL))
    model.fix("z-")
    model.add(kl.Traction("z+", (1e5, 0.0, 0.0)) if load is None else load)
    return model


def integrated(model, **options):
    transient = model.transient(**options)
    return [transient.state(), *kl.integrate(transient, dt=1e-3, steps=20, every=5)]


def assert_same(path, states):
    with np.load(path) as file:
        for name in ("time", "step", "u", "v", "a", "reactions"):
            expected = np.array([getattr(state, name) for state in states])
            assert np.array_equal(file[name], expected), name


# ---- the same as in Python ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("newmark", "kl.Newmark()"),
        ("newmark:0.3,0.6", "kl.Newmark(0.3, 0.6)"),
        ("hht", "kl.HHT()"),
        ("hht:-0.1", "kl.HHT(-0.1)"),
        ("bossak", "kl.Bossak()"),
        ("bossak:-0.2", "kl.Bossak(-0.2)"),
        ("generalized_alpha:0.5", "kl.GeneralizedAlpha(0.5)"),
    ],
)
def test_words_script_and_python_agree(run, folder, word, value):
    integrator = eval(value)
    expected = integrated(tower(), integrator=integrator, rayleigh=(0.5, 1e-5), lumped=True)
    options = ("--integrator", word, "--rayleigh", "0.5,1e-5", "--lumped")
    done = run("solve", "tower.mdpa", *WORDS, "--time", "1e-3:20:5", *options, "-o", "words.npz")
    assert (done.code, done.err) == (0, "")
    assert_same("words.npz", expected)
    time = f"1e-3, 20, 5, integrator={value}, rayleigh=(0.5, 1e-5), lumped=True"
    write(outputs="['file.npz'], json='a.json'", time=time)
    assert run("solve", "run.py").code == 0
    assert_same("file.npz", expected)
    end = json.loads((folder / "a.json").read_text())
    np.testing.assert_array_equal(list(end["displacement"].values()), expected[-1].u)


def test_central_differences(run, folder):
    write(outputs="['end.npz']", time="1e-5, 30, 30, integrator=kl.CentralDifference()")
    done = run("solve", "run.py")
    assert done.rows["integrator"] == "central_difference, lumped mass"
    transient = tower().transient(integrator=kl.CentralDifference())
    assert_same("end.npz", [transient.state(), *kl.integrate(transient, 1e-5, 30, every=30)])
    write(time="1e-3, 20, integrator=kl.CentralDifference()")
    assert run("solve", "run.py").refuses("central_difference is not stable", "the critical step is")


def test_options_win_over_the_file(run, folder):
    write(outputs="['file.npz']", time="1e-3, 20, 5, integrator=kl.HHT(), rayleigh=(9.0, 0.0)")
    words = ("--time", "2e-3:4:2", "--integrator", "bossak", "--rayleigh", "0,1e-6", "-o", "words.npz")
    done = run("solve", "run.py", *words)
    assert done.rows["integrator"] == "bossak(-0.3)"
    assert done.rows["damping"] == "0 1/s × M + 1e-06 s × K"
    transient = tower().transient(integrator=kl.Bossak(), rayleigh=(0.0, 1e-6))
    assert_same("words.npz", [transient.state(), *kl.integrate(transient, 2e-3, 4, every=2)])
    assert not (folder / "file.npz").exists()


def test_a_restart_goes_on_bit_by_bit(run, folder):
    write()
    run("solve", "run.py", "-o", "whole.npz")
    assert run("solve", "run.py", "--time", "1e-3:10", "--state", "half.npz").code == 0
    assert run("solve", "run.py", "--time", "1e-3:10:5", "--restart", "half.npz", "-o", "b.npz").code == 0
    write(outputs="['c.npz']", time="1e-3, 10, 5, restart='half.npz'")
    assert run("solve", "run.py").code == 0
    assert run("solve", "run.py", "--state", "half.npz").refuses("is an input or another output")
    with np.load("whole.npz") as whole, np.load("b.npz") as b, np.load("c.npz") as c:
        for name in ("time", "step", "u", "v", "a"):
            assert np.array_equal(whole[name][2:], b[name])
            assert np.array_equal(whole[name][2:], c[name])


# ---- outputs -------------------------------------------------------------------------------------


def test_a_summary_with_the_numbers(run, folder):
    write("tower.add(kl.Gravity((0, 0, -9.81)))\n")
    done = run("solve", "run.py")
    assert (done.code, done.err) == (0, "")
    model = tower()
    model.add(kl.Gravity((0, 0, -9.81)))
    transient = model.transient()
    states = [transient.state(), *kl.integrate(transient, dt=1e-3, steps=20, every=5)]
    largest = max(states, key=lambda state: np.linalg.norm(state.u, axis=1).max())
    size = np.linalg.norm(largest.u, axis=1)
    rows = done.rows
    assert rows["nodes"] == "28"
    assert rows["elements"].startswith("6 ")
    assert rows["unknowns"] == "72"
    assert rows["integrator"] == "newmark(0.25, 0.5)"
    assert rows["time"] == "0 … 0.02 s, 20 steps of 0.001 s"
    node = model.mesh.node_ids[size.argmax()]
    assert rows["largest displacement"] == (
        f"{size.max():.6e} m at node {node}, t = {largest.time:.6g} s, of {len(states)} kept"
    )
    assert rows["energy"] == f"0.000000e+00 J at the start, {transient.energy():.6e} J at the end"
    force = [float(f) for f in re.findall(r"-?[\d.]+(?:e[+-]\d+)?", rows["total reaction"])]
    np.testing.assert_allclose(force, states[-1].reactions.sum(axis=0), rtol=1e-5, atol=1e-8)
    assert re.match(r"\S+ s, \S+ s in all", rows["time per step"])
    assert run("solve", "run.py", "-q").out == ""


def test_a_still_run_is_told(run, folder):
    write("tower.loads.clear()\n")
    assert "nothing moves" in run("solve", "run.py").rows["warning"]


def test_frames_table_and_picture(run, folder):
    pytest.importorskip("matplotlib")
    write(outputs="['out/swing.pvd'], picture='out/end.png'")
    done = run("solve", "run.py", "--vtu", "ascii")
    assert done.code == 0
    names = sorted(path.name for path in (folder / "out").iterdir())
    assert names == ["end.png", "swing.pvd", *(f"swing_{i:05d}.vtu" for i in range(5))]
    assert b'format="ascii"' in (folder / "out" / "swing_00004.vtu").read_bytes()
    assert run("solve", "run.py", "-o", "t.csv").code == 0
    lines = (folder / "t.csv").read_text().splitlines()
    assert lines[0].startswith("time [s],energy [J]")
    assert [float(line.split(",")[0]) for line in lines[1:]] == pytest.approx([0, 0.005, 0.01, 0.015, 0.02])


def test_a_film_shows_all_states_and_needs_a_known_ending(run, folder):
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("matplotlib")
    write(outputs="picture='out/swing.gif'")
    assert run("solve", "run.py").code == 0
    with image.open(folder / "out" / "swing.gif") as film:
        assert film.n_frames == 5
    assert run("solve", "run.py", "--picture", "swing.avi").refuses(r"pictures cannot be written as .avi")


def test_info_and_check_know_the_steps(run, folder):
    write(time="1e-3, 20, 5, integrator=kl.Bossak()")
    assert "20 steps of 0.001 s by bossak(-0.3)" in run("info", "run.py").out
    done = run("check", "run.py")
    assert done.code == 0
    assert "run.py: 28 nodes, 6 elements, 20 steps of 0.001 s by bossak(-0.3), no errors" in done.out
    write("tower.assign(kl.Isotropic3D(E=3e10, nu=0.2))\n")
    done = run("check", "run.py")
    assert done.code == 2
    assert "error    Isotropic3D has density 0" in done.out
    write(time="1e-3, 20, integrator=kl.CentralDifference()")
    assert run("check", "run.py").refuses("the critical step is")
    write("free = kl.Model(tower.mesh, kl.Isotropic3D(3e10, 0.2, 2500.0))\ncase.subject = free\n")
    assert run("check", "run.py").code == 0  # inertia holds it


@pytest.mark.skipif(os.name != "posix", reason="Ctrl-C is sent as a signal")
def test_ctrl_c_keeps_the_series_and_the_state(folder):
    write(outputs="['t.csv']", time="1e-5, 10_000_000")
    code = "import sys; from kratos_lite.cli import main; sys.exit(main(sys.argv[1:]))"
    words = [sys.executable, "-c", code, "solve", "run.py", "--time", "1e-5:10000000", "-o", "out/t.pvd"]
    process = subprocess.Popen([*words, "--state", "s.npz"], stderr=subprocess.PIPE, text=True)
    _, err = interrupted(process, folder / "out" / "t_00003.vtu")
    assert process.returncode == 130
    assert "interrupted" in err
    frames = len(re.findall("<DataSet", (folder / "out" / "t.pvd").read_text()))
    assert kl.read_state("s.npz").step in (frames - 1, frames)


# ---- what goes wrong -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "fragments"),
    [
        (("--time", "1e-3"), ("--time: expected STEP:STEPS[:EVERY]",)),
        (("--time", "1e-3:2.5"), ("--time: a whole number ≥ 1 is needed; got '2.5'",)),
        (("--time", "1e-3:0"), ("--time: a whole number ≥ 1 is needed",)),
        (("--time", "x:3"), ("--time: 'x' is not a finite number",)),
        (("--time", "-1:3"), ("a step must be one number > 0, in s",)),
        (
            ("--time", "1:3", "--integrator", "euler"),
            ("integrator 'euler'", "There are "),
        ),
        (("--time", "1:3", "--integrator", "hht:a"), ("--integrator: 'a' is not a finite number",)),
        (("--time", "1:3", "--integrator", "hht:1,2"), ("hht takes 0 or 1 numbers; got 2",)),
        (("--time", "1:3", "--rayleigh", "1"), ("--rayleigh: expected ALPHA,BETA",)),
        (("--time", "1:3", "--rayleigh", "-1,0"), ("--rayleigh: expected ALPHA,BETA",)),
        (("--time", "1:3", "--restart", "no.npz"), ("no.npz: there is no such file",)),
        (("--time", "1:3", "--modes", "2"), ("--modes and --time: give one of them",)),
        (("--time", "1:3", "--buckling", "2"), ("--buckling and --time: give one of them",)),
        (("--modes", "1", "--buckling", "2"), ("--modes and --buckling: give one of them",)),
        (("--buckling", "2", "--error", "1%"), ("--error is for statics",)),
        (("--modes", "2", "--error", "1%"), ("--error is for statics",)),
        (("--time", "1:3", "--solver", "amg"), ("--solver is for statics",)),
        (("--time", "1:3", "--json", "a.csv"), ("a.csv: the ending must be .json",)),
        (("--time", "1:3", "-o", "a.vtu"), ("states in time are written as .pvd",)),
        (("--time", "1:3", "--vtu", "ascii", "-o", "a.csv"), ("add -o OUT.pvd",)),
        (("--time", "1:3", "--state", "a.csv"), ("a.csv: the ending must be .npz",)),
        (("--time", "1:3", "-o", "tower.mdpa"), ("is an input or another output",)),
        (("--time", "1:3", "-o", "a.npz", "--state", "a.npz"), ("is an input or another output",)),
        (("-o", "a.pvd"), ("a.pvd: .pvd holds states in time; add --time STEP:STEPS, or write .vtu",)),
        (("-o", "a.npz"), ("a.npz: .npz holds states in time",)),
        *(
            ((f"--{name}", *value), (f"--{name} belongs to a time integration; add --time STEP:STEPS",))
            for name, value in (
                ("integrator", ["hht"]),
                ("rayleigh", ["0,1"]),
                ("lumped", []),
                ("restart", ["a.npz"]),
                ("state", ["a.npz"]),
            )
        ),
    ],
)
def test_wrong_options_are_explained(run, folder, words, fragments):
    done = run("solve", "tower.mdpa", *WORDS, *words)
    assert done.refuses(*fragments)
    assert [path.name for path in folder.iterdir()] == ["tower.mdpa"]


def test_modes_are_written_as_a_series_and_a_picture(run, folder):
    meshio = pytest.importorskip("meshio")
    more = ("--modes", "3", "-o", "a.pvd", "--picture", "a.png", "--vtu", "ascii")
    told = run("solve", "tower.mdpa", *WORDS, *more)
    assert (told.code, told.err) == (0, "")
    assert told.rows["written"] == "a.png"  # the last of its lines
    assert (folder / "a.png").read_bytes()[:4] == b"\x89PNG"
    index = (folder / "a.pvd").read_text()
    assert re.findall(r'timestep="(\S+)" part="0" file="(\S+)"', index) == [
        (f"{i}.0", f"a_0000{i}.vtu") for i in (1, 2, 3)
    ]
    _, shapes = tower().modes(3)
    for i, shape in enumerate(shapes, 1):
        data = meshio.read(f"a_0000{i}.vtu").point_data["DISPLACEMENT"]
        expected = shape / np.linalg.norm(shape, axis=1).max()
        sign = np.sign((data * expected).sum())  # an eigenvector has none
        assert np.abs(data - sign * expected).max() < 1e-6


def test_a_response_to_loads_that_swing_is_told_and_written(run, folder):
    model = tower()
    model.add(kl.Traction("z+", (1e3, 0, 0)))
    response = model.harmonic(2 * np.pi * np.linspace(0, 4, 3), damping=0.02)
    words = ("--traction", "z+:1e3,0,0", "--harmonic", "0:4:3:2%", "-o", "a.csv")
    told = run("solve", "tower.mdpa", *WORDS, *words)
    largest = [np.linalg.norm(response.displacement(i), axis=1).max() for i in range(3)]
    found = [float(line.split()[2]) for line in told.out.splitlines()[1:4]]
    np.testing.assert_allclose(found, largest, rtol=1e-6)
    table = np.loadtxt("a.csv", delimiter=",", skiprows=1)
    assert abs(table[:, 2].max() / np.abs(response.displacement(2)[:, 0]).max() - 1) < 1e-9


def test_shapes_of_buckling_are_told_and_written_as_modes_are(run, folder):
    model = tower()
    model.add(kl.Traction("z+", (0, 0, -1e3)))
    factors, _ = model.buckling(2)
    words = (
        "--traction",
        "z+:0,0,-1e3",
        "--buckling",
        "2",
        "-o",
        "a.pvd",
        "-o",
        "a.html",
        "--picture",
        "a.png",
    )
    told = run("solve", "tower.mdpa", *WORDS, *words)
    assert (told.code, told.err) == (0, "")
    assert [float(line.split()[1]) for line in told.out.splitlines()[1:3]] == pytest.approx(factors, rel=1e-7)
    assert (folder / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert (folder / "a_00002.vtu").exists()
    assert (folder / "a.html").exists()
    assert run("check", "tower.mdpa", *WORDS, "--traction", "z+:0,0,-1e3", "--buckling", "2").code == 0
    with pytest.raises(kl.InputError, match="needs the number of its modes"):
        kl.run(kl.Case(model, buckling=True))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-o", "a.vtu"), "a.vtu: modes are written as .pvd (for ParaView), .html or .frd"),
        (("--json", "a.txt"), "a.txt"),
        (("--vtu", "ascii"), "--vtu ascii: there is no output to write so; add -o OUT.pvd"),
        (("--picture", "a.xyz"), "a.xyz: pictures cannot be written as .xyz"),
    ],
)
def test_files_that_hold_no_modes_are_refused_before_the_search(run, folder, words, said):
    assert run("solve", "tower.mdpa", *WORDS, "--modes", "2", *words).refuses(said)


def test_complex_modes_are_written_with_both_parts(run, folder):
    meshio = pytest.importorskip("meshio")
    kl.write("bar.mdpa", kl.box((4, 1, 1), (4, 1, 1)))
    motion = ("--translation", "x:10", "--boundaries", "fixed", "--material", "E=1e6,nu=0,density=1000")
    more = ("--fix", "z-:xyz", "--modes", "2", "-o", "a.pvd", "--picture", "a.png")
    told = run("solve", "bar.mdpa", *motion, *more)
    assert (told.code, told.err) == (0, "")
    data = meshio.read("a_00002.vtu").point_data
    both = data["DISPLACEMENT"] + 1j * data["DISPLACEMENT_IMAGINARY"]
    assert np.linalg.norm(both, axis=1).max() == pytest.approx(1.0)
    assert np.abs(both.imag).max() > 1e-3


def test_modes_of_a_file_in_time_are_those_of_its_model(run, folder):
    write()
    told = run("solve", "run.py", "--modes", "2")
    omega, _ = tower().modes(2)
    assert [float(line.split()[2]) for line in told.out.splitlines()[1:3]] == pytest.approx(omega, rel=1e-7)


def test_what_is_doubtful_is_told(run, folder):
    """Supports that jump at the start, and bodies that nothing but inertia holds."""
    held = ("--material", "E=1e6,nu=0.3,density=1000", "--time", "1e-3:3")
    told = run("solve", "tower.mdpa", *held, "--fix", "z-:xyz", "--fix", "z+:x=0.01").out
    assert "supports are displaced by 0.01 m at the start of a model at rest" in told
    told = run("solve", "tower.mdpa", *held, "--traction", "z+:1e3,0,0").out
    assert "rigid motions are held by inertia alone" in told
    assert "displaced" not in told
