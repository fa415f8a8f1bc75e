"""Motions of the material from run files of Kratos and from the command line, and tables of modes."""

import json
import re

import numpy as np
import pytest
from run_files import materials, process, run_file, write

import kratos_lite as kl
from kratos_lite.cli import main
from kratos_lite.io.files import read_case
from kratos_lite.io.kratos.motion import add_motion
from kratos_lite.io.settings import read_settings

RUBBER = {"E": 1e6, "nu": 0.3, "density": 1000.0}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder, the current one, with the meshes of a wheel and of a bar."""
    monkeypatch.chdir(tmp_path)
    meshes = {
        "wheel": kl.annulus(0.3, 1.0, 0.1, cells=(1, 12, 1)),
        "bar": kl.box((4.0, 0.5, 0.5), cells=(8, 1, 1)),
    }
    for name, mesh in meshes.items():
        parts = {key: part for key, part in mesh.parts.items() if key in ("inner", "outer")}
        bed = kl.Part(nodes=mesh.nodes("z-"))
        kl.write(f"{name}.mdpa", mesh.replace(parts=parts or {"bed": bed}))
    return tmp_path


def run(*words):
    return main(["solve", *words])


def project(folder, mesh, ale, *parts):
    """Write a run file of Kratos that clamps some parts, and its materials; return its path."""
    (folder / "materials.json").write_text(json.dumps(materials("Structure", 1000.0, 1e6, 0.3)))
    held = [
        process("assign_vector_variable_process", f"Structure.{part}", "DISPLACEMENT", value=[0.0, 0.0, 0.0])
        for part in parts
    ]
    return write(folder, run_file(held, [], mesh=mesh, step=1.0) | {"ale": ale})


def motion_of(folder, ale, time=None):
    """Return the motion that a section gives to a wheel."""
    model = wheel()
    add_motion(model, read_settings(write(folder, {"ale": ale}, "run.json")), time)
    return model.motion


def wheel(**motion):
    model = kl.Model(kl.annulus(0.3, 1.0, 0.1, cells=(1, 12, 1)), kl.Isotropic3D(**RUBBER))
    model.fix("inner")
    if motion:
        model.add(kl.ale.Rotation(**motion))
    return model


def about_z(**motion):
    return {"rotation": {"axis": "z", "rate": 1.0, **motion}}


RUBBER_IN_WORDS = ("--material", "E=1e6,nu=0.3,density=1000", "-q")
WORDS = (*RUBBER_IN_WORDS, "--fix", "inner:xyz")


def in_words_and_in_a_file(folder, mesh, words, ale, parts, more=()):
    """Solve a mesh with its clamped parts twice; return the contents of both .json files."""
    held = [word for part in parts for word in ("--fix", f"{part}:xyz")]
    assert run(f"{mesh}.mdpa", *RUBBER_IN_WORDS, *held, *more, *words, "--json", "words.json") == 0
    path = project(folder, mesh, ale, *parts)
    assert run(str(path), "-q", *more, "--json", "file.json") == 0
    return [json.loads((folder / name).read_text()) for name in ("words.json", "file.json")]


def displaced_by(result, expected):
    found = np.array(list(result["displacement"].values()))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_a_rotation_in_words_in_a_run_file_and_in_python_are_the_same(folder):
    motion = {"rate": 6.0, "damping": 2.0, "acceleration": 3.0, "center": [0, 0, 0.5], "stiffening": True}
    expected = wheel(axis="z", **motion).solve().u
    words = ("--rotation", "z:6:3", "--center", "0,0,0.5", "--stiffening", "--damping", "2")
    ale = {"rotation": {"axis": "z", "skew": True, **motion}}
    for result in in_words_and_in_a_file(folder, "wheel", words, ale, ["inner"]):
        displaced_by(result, expected)
        assert result["motion"]["rate"] == 6.0
        assert result["motion"]["acceleration"] == 3.0
        assert 0 < result["motion"]["margin"] < 1


def test_the_summary_tells_rate_critical_rate_and_what_the_hub_carries(folder, capsys):
    words = [word for word in WORDS if word != "-q"]
    assert run("wheel.mdpa", *words, "--rotation", "0,0,-1:-8") == 0
    out = capsys.readouterr().out
    assert re.search(r"^rotation +-8 rad/s \(0, 0, -1\)$", out, re.M)
    critical = (
        r"^critical rate +\d\.\d+ rad/s on this mesh, about 18\.\d+ rad/s by wave speeds, margin -\d+\.\d%$"
    )
    assert re.search(critical, out, re.M)
    assert re.search(r"^force of supports +\(.*\) N$", out, re.M)
    assert re.search(r"^moment of supports +\(.*\) N m$", out, re.M)


def test_a_translation_in_words_and_in_a_run_file_are_the_same(folder):
    words = ("--translation", "x:-5", "--boundaries", "fixed")
    ale = {"translation": {"direction": [1, 0, 0], "rate": -5, "boundaries": "fixed"}}
    weight = ("--gravity", "0,0,-9.81")
    first, second = in_words_and_in_a_file(folder, "bar", words, ale, ["bed"], weight)
    assert first["displacement"] == second["displacement"]
    assert first["motion"]["kind"] == "translation"
    ends = [first["displacement"][str(i + 1)] for i in kl.read("bar.mdpa").mesh.nodes("x+")]
    assert np.abs(ends).max() == 0.0
    assert np.abs(list(first["displacement"].values())).max() > 0


def test_a_section_of_a_run_file_is_no_note_and_its_mistakes_are_located(folder):
    path = project(folder, "wheel", {"rotation": {"axis": "z", "rate": 8.0}}, "inner")
    model = read_case(path).model
    u = wheel(axis="z", rate=8.0).solve().u
    np.testing.assert_allclose(model.solve().u, u, rtol=0, atol=1e-12 * np.abs(u).max())
    assert not any("ale" in note for note in model.notes)
    path = project(folder, "wheel", {"rotation": {"axis": "z", "rate": 8.0, "speed": 1.0}}, "inner")
    with pytest.raises(kl.InputError, match=r"json: unknown key 'ale.rotation.speed'"):
        read_case(path)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--rotation", "z"), "expected AXIS:RATE"),
        (("--rotation", "z:1:2:3"), "expected AXIS:RATE"),
        (("--rotation", "w:1"), "an axis is 'x', 'y', 'z' or a vector; got 'w'"),
        (("--rotation", "z:fast"), "--rotation: 'fast' is not a finite number"),
        (("--rotation", "z:1", "--translation", "x:1"), "a model has one motion"),
        (("--center", "-1,0,0"), "--center belongs to --rotation"),
        (("--stiffening", "--translation", "x:1"), "--stiffening belongs to --rotation"),
        (("--boundaries", "fixed"), "--boundaries belongs to --translation"),
        (("--rotation", "x:1"), "not one of revolution about the axis"),
        (("--rotation", "-z:30"), "--rotation: an axis is 'x', 'y', 'z' or a vector; got '-z'"),
        (("--rotation", "z:1", "--damping", "-2"), "a damping must be one number ≥ 0, in 1/s; got -2.0"),
        (("--damping", "2"), "--damping belongs to --rotation or --translation"),
        (("--harmonic", "0:1:2", "--json", "a.json"), "does not hold modes or responses; -o OUT does"),
        (("--center-velocity", "1,0,0"), "--center-velocity belongs to --rotation; give that too"),
        (
            ("--moving-part", "x-"),
            "--moving-part belongs to --rotation or --translation; give one of them too",
        ),
        (("--rotation", "z:1", "--moving-part", "nowhere"), "there is no part 'nowhere'"),
        (("--rotation", "z:1", "--center-velocity", "1,2"), "--center-velocity"),
    ],
)
def test_options_that_are_wrong_end_in_one_line(folder, capsys, words, message):
    assert run("wheel.mdpa", *WORDS, *words) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("ale", "message"),
    [
        ({}, "one of 'rotation' and 'translation' is needed"),
        ({"rotation": {"rate": 1}, "translation": {"rate": 1}}, "one of 'rotation' and 'translation'"),
        ({"rotation": {"rat": 1}}, "unknown key 'ale.rotation.rat'"),
        ({"rotation": {"axis": "z"}}, "key 'ale.rotation.rate' is missing"),
        ({"rotation": {"rate": "1"}}, "ale.rotation.rate must be a number"),
        ({"rotation": {"rate": 1, "axis": [0, 0]}}, "ale.rotation.axis must be a list of three numbers"),
        ({"rotation": {"rate": 1, "axis": "q"}}, "ale.rotation: an axis is 'x', 'y', 'z'"),
        ({"rotation": {"rate": 1, "axis": "x"}}, "ale.rotation: the body is not one of revolution"),
        ({"translation": {"rate": 1, "direction": "x", "ends": "fixed"}}, "It is called boundaries here"),
        ({"rotation": {"rate": 1, "skew": 1}}, "ale.rotation.skew must be true or false"),
        ({"rotation": {"rate": 1, "damping": -1}}, "ale.rotation: a damping must be"),
        ({"rotation": {"rate": {"times": [0, 0], "values": [1, 2]}}}, "ale.rotation.rate: times of a series"),
        ({"translation": {"rate": 1, "boundaries": "open"}}, "ale.translation: boundaries must be one of"),
        (about_z(center_velocity=3), "must be a list of three numbers"),
        (about_z(center_velocity={"times": [0, 1], "values": [1, 2]}), "must be a list of [x, y, z]"),
        (
            about_z(center_acceleration={"times": [0], "values": [[1, 2, 3], [1, 2, 3]]}),
            "as many values as times",
        ),
        (about_z(part=3), "must be a string"),
        (about_z(part="nowhere"), "there is no part 'nowhere'"),
    ],
)
def test_a_wrong_section_is_refused_with_its_line(folder, ale, message):
    with pytest.raises(kl.KratosLiteError, match=r"run\.json: ") as caught:
        motion_of(folder, ale)
    assert message in str(caught.value)


def test_a_rate_and_the_velocity_of_a_center_may_be_tables(folder):
    table = {"times": [0, 2], "values": [0, 10]}
    places = {"times": [0, 2], "values": [[0, 1, 2], [10, 1, -2]]}
    motion = motion_of(folder, about_z(rate=table, acceleration=5, center_velocity=places))
    assert motion.rate(1.0) == 5.0
    assert motion.acceleration(1.0) == 5.0
    assert not motion.steady
    velocity, acceleration = motion.center_rates(1.0)
    assert (velocity.tolist(), acceleration.tolist()) == ([5.0, 1.0, 0.0], [5.0, 0.0, -2.0])


def test_the_center_of_a_rotor_travels_in_files_and_in_words_as_in_python(folder):
    motion = {"rate": 6.0, "center_velocity": [1.0, 0.0, 0.0], "center_acceleration": [2.0, -3.0, 1.0]}
    expected = wheel(axis="z", **motion).solve().u
    words = ("--rotation", "z:6", "--center-velocity", "1,0,0", "--center-acceleration", "2,-3,1")
    for result in in_words_and_in_a_file(folder, "wheel", words, about_z(**motion), ["inner"]):
        displaced_by(result, expected)
        assert result["motion"].items() >= motion.items()


def test_a_part_that_moves_beside_one_at_rest_in_files_and_in_words(folder):
    wheel_mesh, block = kl.annulus(0.3, 1.0, 0.1, cells=(1, 12, 1)), kl.box((0.5, 0.5, 0.1))
    n = wheel_mesh.n_nodes
    (cells,) = block.blocks
    cells = kl.Block(cells.name, cells.nodes + n, cells.ids + 12, cells.properties, cells.shape)
    parts = {
        "wheel": kl.Part(nodes=np.arange(n), elements=np.arange(12)),
        "hub": kl.Part(nodes=wheel_mesh.nodes("inner")),
        "block": kl.Part(nodes=np.arange(n, n + 8)),
    }
    points = np.vstack([wheel_mesh.points, np.add(block.points, (2, 0, 0))])
    mesh = kl.Mesh(points, [*wheel_mesh.blocks, cells], parts=parts)
    kl.write("two.mdpa", mesh)
    model = kl.Model(mesh, kl.Isotropic3D(**RUBBER))
    for part in ("hub", "block"):
        model.fix(part)
    model.add(kl.ale.Rotation("z", rate=6.0, part="wheel"))
    expected = model.solve().u
    words = ("--rotation", "z:6", "--moving-part", "wheel")
    ale = about_z(rate=6.0, part="wheel")
    for result in in_words_and_in_a_file(folder, "two", words, ale, ["hub", "block"]):
        displaced_by(result, expected)


def test_a_rate_table_is_taken_at_the_time_of_the_solution(folder):
    """Kratos run files are solved at their end; a rate that is still changing then is taken as it is."""
    table = {"times": [0.0, 1.0], "values": [0.0, 8.0]}
    ale = {"rotation": {"axis": "z", "rate": table}}
    motions = [motion_of(folder, ale, time) for time in (None, 1.0, 0.5)]
    rates = [(motion.rate(0.0), motion.acceleration(0.0)) for motion in motions]
    assert rates == [(0.0, 8.0), (8.0, 0.0), (4.0, 0.0)]


def test_modes_are_those_of_python(folder, capsys):
    held = ("--material", "E=1e6,nu=0.3,density=1000", "--fix", "inner:xyz", "--modes", "4")
    assert run("wheel.mdpa", *held) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()[:5]]
    assert rows[0] == ["mode", "frequency", "Hz", "rad/s"]
    model = kl.Model(kl.read("wheel.mdpa").mesh, kl.Isotropic3D(**RUBBER))
    model.fix("inner")
    omega, _ = model.modes(4)
    found = np.array([[float(word) for word in row[1:]] for row in rows[1:]])
    np.testing.assert_allclose(found[:, 1], omega, rtol=1e-7)
    np.testing.assert_allclose(found[:, 0] * 2 * np.pi, omega, rtol=1e-7)
    assert run("wheel.mdpa", *held, "--rotation", "z:5") == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()[:5]]
    model.add(kl.ale.Rotation("z", rate=5.0))
    values = np.array([value for value in model.complex_modes(8)[0] if value.imag > 0])
    assert len(values) == 4 == len(rows) - 1
    found = np.array([[float(word) for word in row[1:]] for row in rows[1:]])
    assert rows[0][-2:] == ["growth", "1/s"]
    np.testing.assert_allclose(np.sort(found[:, 1]), np.sort(values.imag), rtol=1e-6)
    assert np.abs(found[:, 2]).max() < 1e-6 * np.abs(values).max()


def test_a_free_rotor_of_many_unknowns_does_not_grow_in_the_table(folder, capsys):
    kl.write("rotor.mdpa", kl.annulus(0.3, 1.0, 0.2, cells=(2, 16, 1)))
    words = ("--material", "E=210e6,nu=0.3,density=7620", "--rotation", "z:30", "--stiffening")
    assert run("rotor.mdpa", *words, "--modes", "8") == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines() if re.match(r" +\d+  ", line)]
    assert len(rows) == 8
    assert max(abs(float(row[-1])) for row in rows) < 2e-4
