"""The command line as a person uses it: commands, options, files in and out, and what goes wrong."""

import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import malformed
import numpy as np
import pytest
from children import FOREVER
from commands import Outcome

import kratos_lite as kl
from kratos_lite.cli import commands, main
from kratos_lite.native import threads
from kratos_lite.view import progress

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
GRAVITY_CUBE = EXAMPLES / "gravity_cube.mdpa"
SINKS = 7620 * 9.81 * 0.5 / (210e6 * 0.7 / (1.3 * 0.4))
"""Displacement of the top of the gravity cube, m."""
STEEL = "E=210e9,nu=0.3,density=7850"
LAW = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
HELD = ("--material", STEEL, "--fix", "z-:xyz")
COMMANDS = ("solve", "info", "check", "convert")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return an empty folder, which is the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def box(folder):
    """Return a small mesh that lies in the folder as box.vtu, box.msh and box.mdpa."""
    mesh = kl.box(cells=(2, 2, 2))
    for ending in ("vtu", "msh"):
        kl.write(f"box.{ending}", mesh)
    kl.write("box.mdpa", kl.Model(mesh, LAW))
    return mesh


def held(mesh):
    model = kl.Model(mesh, LAW)
    model.fix("z-")
    return model


def process(*words, **options):
    """Run a command in a process of its own."""
    command = [sys.executable, "-m", "kratos_lite", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=FOREVER, check=False, **options)


def displacement(path):
    return np.array(list(json.loads(Path(path).read_text())["displacement"].values()))


def same(first, second, tolerance=1e-12):
    return np.abs(first - second).max() <= tolerance * np.abs(second).max()


# ---- solve ---------------------------------------------------------------------------------------


def test_gravity_cube_from_the_shell(tmp_path):
    done = process("solve", GRAVITY_CUBE, "-o", "cube.vtu", "--json", "cube.json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    table = Outcome(0, done.stdout, "").rows
    assert table["nodes"] == "125"
    assert table["elements"] == "64 KinematicLinear3D8N"
    assert table["unknowns"] == "250"
    assert (table["volume"], table["mass"]) == ("1 m³", "7620 kg")
    assert table["total load"] == "(0, 0, -74752.2) N"
    assert table["total reaction"] == "(0, 0, 74752.2) N"
    assert table["largest displacement"].startswith("1.322148e-04 m at node")
    assert "written               cube.vtu" in done.stdout
    found = json.loads((tmp_path / "cube.json").read_text())
    assert found["largest_displacement"]["value"] == pytest.approx(SINKS, rel=1e-12)
    assert found["total_reaction"][2] == pytest.approx(7620 * 9.81, rel=1e-12)
    assert len(found["displacement"]) == found["nodes"] == 125
    assert found["units"] == "SI"
    assert found["warnings"] == []
    assert kl.read(tmp_path / "cube.vtu", materials=False).mesh.n_elements == 64
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cube.json", "cube.vtu"]


def test_a_picture_and_numbers_of_a_vtu_file_stored_as_asked(run, folder):
    pytest.importorskip("matplotlib")
    done = run("solve", GRAVITY_CUBE, "-q", "-o", "cube.vtu", "--vtu", "ascii", "--picture", "cube.png")
    assert (done.code, done.out, done.err) == (0, "", "")
    assert b'format="ascii"' in Path("cube.vtu").read_bytes()
    assert Path("cube.png").read_bytes().startswith(b"\x89PNG")


def test_a_mode_of_vtu_files_needs_such_a_file(run, folder):
    assert run("solve", GRAVITY_CUBE, "--vtu", "ascii").refuses(
        "--vtu ascii: there is no output", "-o OUT.vtu"
    )
    assert run("solve", GRAVITY_CUBE, "--vtu", "ascii", "-o", "a.json").refuses("a.json: only .vtu files are")
    assert list(folder.iterdir()) == []


def test_threads_are_told_to_the_kernels(run, folder, monkeypatch):
    monkeypatch.setenv("KRATOS_LITE_THREADS", "1")
    assert run("solve", GRAVITY_CUBE, "-q", "--threads", "3").code == 0
    assert threads() == 3
    assert run("solve", GRAVITY_CUBE, "--threads", "0").refuses(
        "--threads: a whole number ≥ 1 is needed; got '0'"
    )


def test_bench_runs_the_benchmarks_of_the_checkout_with_all_words(run, folder, monkeypatch):
    monkeypatch.setattr(commands, "ROOT", folder)
    assert run("bench").refuses(f"there are no benchmarks in {folder}", "pip install -e .")
    Path("benchmarks").mkdir()
    Path("benchmarks/__init__.py").touch()
    Path("benchmarks/__main__.py").write_text(
        "import sys\nopen('said', 'w').write(repr(sys.argv[1:]))\nsys.exit(5)"
    )
    assert run("bench", "run", "--cells", "3", "--help", "-q").code == 5
    assert Path("said").read_text() == "['run', '--cells', '3', '--help', '-q']"


@pytest.mark.parametrize("ending", ["vtu", "msh", "mdpa"])
def test_options_say_the_same_as_a_script(run, box, ending):
    words = "--gravity -1,0,-9.81 --traction z+:0,0,-1e5 --pressure x+:2e5 --resultant y+:-1,2,3".split()
    done = run("solve", f"box.{ending}", *HELD, "--fix", "z+:x=-1e-6", *words, "--json", "out.json")
    assert (done.code, done.err) == (0, "")
    model = held(box)
    model.fix("z+", "x", -1e-6)
    for load in (
        kl.Gravity((-1.0, 0.0, -9.81)),
        kl.Traction("z+", (0.0, 0.0, -1e5)),
        kl.Pressure("x+", 2e5),
        kl.Resultant("y+", (-1.0, 2.0, 3.0)),
    ):
        model.add(load)
    assert same(displacement("out.json"), model.solve().displacement())


def test_a_temperature_says_the_same_as_a_script(run, box):
    words = ["--material", f"{STEEL},alpha=12e-6", "--fix", "z-:xyz", "--temperature", "120:20"]
    assert run("solve", "box.vtu", *words, "--temperature", "5", "--json", "out.json").code == 0
    model = kl.Model(box, replace(LAW, alpha=12e-6))
    model.fix("z-")
    model.add(kl.Temperature(105.0))
    assert same(displacement("out.json"), model.solve().displacement())
    assert run("solve", "box.vtu", *words, "--temperature", "1:2:3").refuses("--temperature: ")


def test_ties_planes_of_symmetry_and_remote_points_say_the_same_as_a_script(run, folder):
    lower, upper = (kl.box((1, 1, 1), (n, n, n), "KinematicLinear3D8N", origin=(0, 0, n - 2)) for n in (2, 3))
    kl.write("two.mdpa", both := kl.join({"a": lower, "b": upper}))
    words = ["--material", STEEL, "--fix", "a.z_minus:z", "--symmetry", "x-", "--symmetry", "a.y_minus"]
    words += ["--tie", "a.z_plus:b.z_minus", "--remote", "b.x_plus:2,0.5,1.5:10,0,-20"]
    words += ["--rigid", "b.z_plus:0.5,0.5,4:100,0,-200,3,50,7", "--json", "out.json"]
    assert run("solve", "two.mdpa", *words).code == 0
    model = kl.Model(both, LAW)
    model.fix("a.z-", "z")
    model.symmetry("x-")
    model.symmetry("a.y-")
    model.tie("a.z+", "b.z-")
    model.add(model.distribute("b.x+", (2, 0.5, 1.5)).load((10, 0, -20)))
    model.add(model.rigid("b.z+", (0.5, 0.5, 4)).load((100, 0, -200), moment=(3, 50, 7)))
    assert same(displacement("out.json"), model.solve().displacement())
    assert run("solve", "two.mdpa", *words, "--symmetry", "b").refuses("b: a plane of symmetry needs three")


def test_material_by_property_and_by_law(run, box):
    wood = (
        "Orthotropic3D:E_x=11e9,E_y=2e9,E_z=1e9,nu_xy=0.4,nu_yz=0.3,nu_xz=0.35,"
        "G_xy=0.7e9,G_yz=0.2e9,YOUNG_MODULUS_X=11e9,G_xz=0.6e9"
    )
    assert run("solve", "box.vtu", "--material", wood).refuses("YOUNG_MODULUS_X is given twice")
    wood = wood.replace(",YOUNG_MODULUS_X=11e9", "")
    words = ["--fix", "z-:xyz", "--resultant", "z+:1,0,0", "--json", "out.json"]
    assert run("solve", "box.vtu", "--material", f"1:{wood}", *words).code == 0
    model = kl.Model(box, kl.Orthotropic3D(11e9, 2e9, 1e9, 0.4, 0.3, 0.35, 0.7e9, 0.2e9, 0.6e9))
    model.fix("z-")
    model.add(kl.Resultant("z+", (1.0, 0.0, 0.0)))
    assert same(displacement("out.json"), model.solve().displacement())


def test_elem_set_by_any_of_its_files_or_its_stem(run, box):
    model = held(box)
    model.add(kl.Gravity((0.0, 0.0, -9.81)))
    kl.write("set.elem", model)
    for name in ("set", "set.elem", "set.node"):
        assert run("solve", name, "--json", "set.json").code == 0
        assert same(displacement("set.json"), model.solve().displacement())


def test_the_formulation_of_the_elements_is_an_option(run, box):
    words = ["--traction", "z+:1e5,0,0", "--formulation", "b_bar", "--json", "out.json"]
    assert run("solve", "box.vtu", *HELD, *words).code == 0
    model = kl.Model(box, LAW, formulation="b_bar")
    model.fix("z-")
    model.add(kl.Traction("z+", (1e5, 0.0, 0.0)))
    assert same(displacement("out.json"), model.solve().displacement())
    found = json.loads(Path("out.json").read_text())
    assert found["formulation"].startswith("b_bar, as requested: ")


SCRIPT = """import kratos_lite as kl
box = kl.read({model!r})
box.assign(kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0))
box.fix("z-")
box.add(kl.Gravity((0, 0, {gravity})))
case = kl.Case(box, outputs=kl.Outputs({results}, json={target!r}), **{options})
"""


def script(target=None, results=(), model="box.vtu", gravity=0.0, **options):
    """Write the script of a box on its base."""
    given = {"model": model, "target": target, "results": list(results), "gravity": gravity}
    Path("run.py").write_text(SCRIPT.format(**given, options=options))


def test_a_script_says_the_same_as_options(run, box):
    script("by_file.json", gravity=-9.81)
    done = run("solve", "run.py")
    assert (done.code, done.err) == (0, "")
    assert run("solve", "box.vtu", *HELD, "--gravity", "0,0,-9.81", "--json", "by_options.json").code == 0
    assert same(displacement("by_file.json"), displacement("by_options.json"), 1e-14)
    told = run("info", "run.py")
    assert told.code == 0
    assert told.out.startswith("file         run.py\nnodes        27\n")
    assert "material     Isotropic3D(E=210000000000.0, nu=0.3, density=7850.0, alpha=0.0)" in told.out
    assert "fixed        27 components" in told.out
    assert "load         gravity force (0, 0, -9.81)" in told.out
    assert "volume       1 m³\nmass         7850 kg\ntotal load   (0, 0, -77008.5) N\n" in told.out
    assert run("check", "run.py").out.startswith("run.py: 27 nodes, 8 elements, no errors")
    assert run("convert", "run.py", "run.mdpa").code == 0
    assert run("solve", "run.mdpa", "--json", "again.json").code == 0
    assert same(displacement("again.json"), displacement("by_options.json"))


def test_options_win_over_the_script(run, box):
    script("file.json", gravity=-1.0, solver="dense", tolerance=1e-8)
    assert run("solve", "run.py", "--solver", "direct", "--json", "option.json").code == 0
    assert json.loads(Path("option.json").read_text())["solver"].startswith("direct")
    assert not Path("file.json").exists()


def test_broken_rows_are_read_when_asked_for(run, folder):
    text = GRAVITY_CUBE.read_text().replace("    1 0 0 0\n", "    1 0 0\n    0\n")
    Path("broken.mdpa").write_text(text)
    refused = run("solve", "broken.mdpa")
    assert refused.refuses("broken.mdpa:15:", "--lenient")
    assert "strict" not in refused.err  # as the option is called in Python
    assert run("solve", "broken.mdpa", "--lenient", "-q").code == 0


# ---- info, check, convert --------------------------------------------------------------------------


def test_info_tells_what_is_in_a_file(run, folder):
    done = run("info", GRAVITY_CUBE)
    assert (done.code, done.err) == (0, "")
    for text in (
        "nodes       125",
        "extent      [0, 1] × [0, 1] × [0, 1] m",
        "elements    64 ",
        "DENSITY 7620, YOUNG_MODULUS 2.1e+08, POISSON_RATIO 0.3, VOLUME_ACCELERATION [0, 0, -9.81] (line 6)",
    ):
        assert text in done.out
    in_mm = run("info", GRAVITY_CUBE, "--units", "mm N MPa t").out
    assert "[0, 1] × [0, 1] × [0, 1] mm" in in_mm
    assert "volume      1 mm³" in in_mm
    assert run("info", GRAVITY_CUBE, "--units", "mm").refuses("--units must be one of SI, mm N MPa t, ")


def test_check_tells_warnings_and_what_is_missing(run, folder):
    text = GRAVITY_CUBE.read_text()
    start = text.index("Begin NodalData")
    Path("loose.mdpa").write_text(text[:start].replace("Begin Nodes", "Begin Nodes\n    999 3 3 3"))
    done = run("check", "loose.mdpa")
    assert (done.code, done.err) == (2, "")
    assert done.out.splitlines()[0] == "loose.mdpa: 126 nodes, 64 elements, cannot be solved"
    assert "note     1 nodes belong to no element and carry no equations: 999" in done.out
    assert (
        "error    the supports leave rigid-body modes free: the body (125 nodes) can still move: " in done.out
    )
    assert "translation x, y, z; rotation about x, y, z" in done.out


def test_check_tells_all_that_is_missing_at_once(run, box):
    needs = [line for line in run("check", "box.vtu").out.splitlines() if line.startswith("error ")]
    assert len(needs) == 2
    assert "element 1 (Element3D8N) has no material" in needs[0]
    assert "can still move: translation x, y, z; rotation about x, y, z" in needs[1]


def test_check_does_not_take_the_supports_that_are_missing_for_those_that_carry_the_loads(run, box):
    done = run("check", "box.vtu", "--material", "E=1e9,nu=0.3", "--fix", "z-:z", "--traction", "z+:1e5,0,0")
    assert done.code == 2
    assert "can still move: translation x, y; rotation about z, and its loads do not balance" in done.out
    assert "nothing moves" not in done.out


def test_check_takes_the_options_of_solve(run, box):
    words = ("box.vtu", *HELD, "--pressure", "z+:1e5", "-o", "out.vtu")
    done = run("check", *words)
    extent = "extent   [0, 1] × [0, 1] × [0, 1] m"
    assert (done.code, done.out) == (0, f"box.vtu: 27 nodes, 8 elements, no errors\n{extent}\n")
    assert not Path("out.vtu").exists()
    assert run("check", *words, "-q").out == ""
    assert run("solve", *words).code == 0


@pytest.mark.parametrize("command", ["check", "solve"])
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--material", STEEL), "can still move: translation x, y, z; rotation about x, y, z"),
        (("--fix", "z-:xyz"), "has no material"),
        ((*HELD, "--material", "E=1e9,nu=0.3", "--modes", "2"), "has density 0"),
        ((*HELD, "--material", "E=1e9,nu=0.3", "--time", "1e-5:2"), "has density 0"),
        ((*HELD, "--traction", "Top:0,0,1"), "there is no part 'Top'"),
        ((*HELD, "-o", "none/out.vtu"), "the folder none does not exist"),
        ((*HELD, "--tolerance", "2"), "tolerance must be a number between 0 and 1"),
        (
            (*HELD, "--translation", "x:1", "--boundaries", "natural", "--material", "E=1,nu=0"),
            "has density 0",
        ),
        ((*HELD, "--time", "1e-3:2", "--integrator", "central_difference"), "the critical step is"),
    ],
)
def test_check_ends_with_2_where_solve_does_and_says_the_same(run, box, command, words, said):
    done = run(command, "box.vtu", *words)
    assert done.code == 2
    assert said in done.out + done.err


@pytest.mark.parametrize(
    ("name", "slip", "line"),
    [
        ("DISPLACEMENT_X", "DISPLACMENT_X", 208),
        ("VOLUME_ACCELERATION", "VOLUM_ACELERATION", 10),
        ("YOUNG_MODULUS", "YOUNGS_MODULUS", 8),
        ("DENSITY", "DENSTY", 7),
    ],
)
def test_a_misspelt_variable_of_a_file_is_named_with_the_right_word(run, folder, name, slip, line):
    Path("cube.mdpa").write_text(GRAVITY_CUBE.read_text().replace(name, slip))
    assert run("check", "cube.mdpa").refuses(
        f"cube.mdpa:{line}: unknown variable {slip}. Did you mean {name}?"
    )


def test_a_variable_of_another_application_is_a_note(run, folder):
    text = GRAVITY_CUBE.read_text().replace("    DENSITY", "    THERMAL_FACTOR 3\n    DENSITY")
    Path("cube.mdpa").write_text(text)
    done = run("solve", "cube.mdpa")
    assert done.code == 0
    assert "unknown variable THERMAL_FACTOR is kept, but not used" in done.out


def test_options_of_solve_are_refused_where_a_python_file_is_checked(run, folder):
    Path("mine.py").write_text((EXAMPLES / "my_wedge.py").read_text())
    assert run("check", "mine.py", "--fix", "z-:xyz").refuses("--fix is for models; mine.py defines elements")


def test_check_of_an_element_in_a_python_file(run, folder):
    good = (EXAMPLES / "my_wedge.py").read_text()
    Path("good.py").write_text(good)
    done = run("check", "good.py")
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith("MyWedge3D6N conforms: 32 checks passed, 2 not run\n  ok      definition: ")
    Path("bad.py").write_text(good.replace("L * (1 + t)", "L * (1 - t)"))
    done = run("check", "bad.py")
    assert (done.code, done.err) == (2, "")
    words = [line[:9].strip() for line in done.out.splitlines()[1:]]
    assert words == ["FAILED"] * 2 + ["ok"] * 8 + ["not run"]
    Path("empty.py").write_text("x = 1\n")
    assert run("check", "empty.py").refuses("empty.py")
    Path("wrong.py").write_text("x = (\n")
    assert run("check", "wrong.py").refuses("wrong.py")


@pytest.mark.parametrize("command", ["check", "verify"])
def test_a_python_file_imports_the_modules_beside_it(run, folder, command):
    """Its folder counts, not the present one; what it imports is forgotten, as another file may differ."""
    text = (EXAMPLES / "my_wedge.py").read_text()
    for name, sign in (("good", "+"), ("bad", "-")):
        Path(name).mkdir()
        Path(name, "beside_me.py").write_text(text.replace("L * (1 + t)", f"L * (1 {sign} t)"))
        Path(name, "mine.py").write_text(
            "from beside_me import KinematicLinear, MyWedge, wedge\n\n\n"
            "class Mine6N(KinematicLinear):\n    shape, rule = MyWedge, wedge(degree=2)\n"
        )
    before = list(sys.path)
    more = ["element/uniaxial"] if command == "verify" else []
    codes = [run(command, f"{name}/mine.py", *more).code for name in ("good", "bad", "good")]
    assert codes == [0, 2 if command == "check" else 1, 0]
    assert "beside_me" not in sys.modules
    assert sys.path == before


def test_conversions_keep_the_mesh_and_the_model(run, folder):
    shutil.copy(GRAVITY_CUBE, "a.mdpa")
    for first, second in (("a.mdpa", "b.elem"), ("b.elem", "c.mdpa"), ("c.mdpa", "d.vtu")):
        done = run("convert", first, second)
        assert (done.code, done.err) == (0, "")
        assert done.out.startswith(f"{second}: 125 nodes, 64 elements")
    assert "left out: properties" in done.out
    first = kl.read("a.mdpa")
    for name in ("b.elem", "c.mdpa", "d.vtu"):
        again = kl.read(name, materials=False)
        assert np.array_equal(again.mesh.points, first.mesh.points)
        assert np.array_equal(again.mesh.blocks[0].nodes, first.mesh.blocks[0].nodes)
    for name in ("b.elem", "c.mdpa"):
        assert same(kl.read(name).solve().displacement(), first.solve().displacement(), 1e-14)


def test_elements_that_a_format_cannot_hold_are_named(run, folder):
    text = GRAVITY_CUBE.read_text()
    (kind,) = {line.split()[2] for line in text.splitlines() if line.startswith("Begin Elements")}
    Path("odd.mdpa").write_text(text.replace(kind, "OddElement"))
    done = run("convert", "odd.mdpa", "odd.vtu")
    assert done.code == 0
    assert "note     left out, for their shape is unknown: 64 OddElement" in done.out
    assert run("convert", "odd.mdpa", "same.mdpa").code == 0
    assert "Begin Elements OddElement\n1 1 " in Path("same.mdpa").read_text()


# ---- help ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command_shows_an_example(run, command):
    done = run(command, "--help")
    assert (done.code, done.err) == (0, "")
    assert f"examples:\n  kratos-lite {command} " in done.out


def test_help_tells_commands_and_exit_codes(run):
    told = run("--help").out
    assert run("--version").out == f"kratos-lite {kl.__version__}\n"
    for command in COMMANDS:
        assert f"\n    {command} " in told
    for line in ("0    done", "1    a defect", "2    bad input", "3    solved, but", "130  interrupted"):
        assert f"\n  {line}" in told


def test_a_terminal_that_knows_ascii_only_shows_codes(box):
    ascii_only = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = process("solve", "box.vtu", *HELD, "--gravity", "0,0,-9.81", env=ascii_only)
    assert (done.returncode, done.stderr) == (0, "")
    assert "54 unknowns \\u2264 60" in done.stdout
    done = process("solve", "--help", env=ascii_only)
    assert (done.returncode, done.stderr) == (0, "")
    assert "m/s\\xb2" in done.stdout


# ---- what goes wrong -------------------------------------------------------------------------------

WRONG_OPTIONS = {
    "material without a constant": (["--material", "E=1e9"], "Isotropic3D needs nu (POISSON_RATIO)"),
    "unknown constant": (["--material", "E=1e9,nu=0.3,rho=1"], "constants of Isotropic3D are E, nu, density"),
    "name of a material": (["--material", "steel"], "got 'steel', where a constant and its value are needed"),
    "constant twice": (["--material", "E=1e9,E=1e9,nu=0.3"], "E is given twice"),
    "unknown law": (["--material", "x:Wood:E=1e9,nu=0.3"], "'Wood' is no material; have Anisotropic3D"),
    "constant out of bounds": (["--material", "E=1e9,nu=0.5"], "nu (POISSON_RATIO) 0.5 must be < 0.5"),
    "unknown property": (["--material", "7:" + STEEL], "no element has property 7"),
    "no number": ([*HELD, "--gravity", "0,0,down"], "--gravity: 'down' is not a finite number"),
    "underscore": ([*HELD, "--gravity", "0,0,9_81"], "'9_81' is not a finite number"),
    "a word": ([*HELD, "--tolerance", "small"], "--tolerance: 'small' is not a finite number"),
    "infinite": ([*HELD, "--traction", "z+:0,0,inf"], "--traction: 'inf' is not a finite number"),
    "two numbers": (
        [*HELD, "--gravity", "0,1"],
        "--gravity: expected X,Y,Z (acceleration in m/s²); got '0,1'",
    ),
    "no part": (
        [*HELD, "--pressure", "1e5"],
        "--pressure: expected PART:P (pressure in Pa, positive into the body); got '1e5'",
    ),
    "no second part": ([*HELD, "--tie", "x+"], "--tie: expected PART:PART (tie two surfaces, whose meshes"),
    "tied to itself": ([*HELD, "--tie", "x+:z+"], "cannot tie x+ to z+: both have node"),
    "no plane": ([*HELD, "--symmetry", "Top"], "there is no part 'Top'"),
    "no force at a point": ([*HELD, "--remote", "x+:1,2,3"], "--remote: expected PART:POINT:FORCE[,MOMENT]"),
    "half a moment": (
        [*HELD, "--rigid", "x+:1,2,3:4,5,6,7,8"],
        "--rigid: expected PART:POINT:FORCE[,MOMENT]",
    ),
    "unknown axis": (["--material", STEEL, "--fix", "z-:w"], "axes must be some of x, y, z"),
    "two values": ([*HELD, "--fix", "z-:z=1"], "z"),
    "unknown part": ([*HELD, "--fix", "Top:xyz"], "there is no part 'Top'"),
    "tolerance zero": ([*HELD, "--tolerance", "0"], "tolerance must be a number between 0 and 1; got 0.0"),
    "no faces": ([*HELD, "--traction", "one:0,0,1"], "'one'"),
    "no folder": ([*HELD, "-o", "none/out.vtu"], "none/out.vtu: the folder none does not exist"),
    "unknown ending": ([*HELD, "-o", "out.foo"], "out.foo: results cannot be written as '.foo'"),
    "no ending": ([*HELD, "-o", "out"], "out: give the file an ending"),
    "output is a folder": ([*HELD, "-o", "sub.vtu"], "sub.vtu: cannot be written: it is a folder"),
    "output twice": (
        [*HELD, "-o", "out.json", "--json", "./out.json"],
        "./out.json: is an input or another output",
    ),
    "output is the input": ([*HELD, "-o", "box.vtu"], "box.vtu: is an input or another output"),
    "no name": ([*HELD, "-o", ""], "an output has an empty name"),
    "mesh format": (
        [*HELD, "-o", "out.inp"],
        "out.inp: results cannot be written as '.inp'; .vtu .vtk .json",
    ),
    "other mesh format": ([*HELD, "-o", "out.msh"], "results cannot be written as '.msh'"),
    "json as vtu": ([*HELD, "--json", "out.vtu"], "out.vtu: the ending must be .json"),
    "unknown law or part": (
        ["--material", "Foo:E=1e9,nu=0.3"],
        "unknown law or part 'Foo'; laws are Anisotropic3D",
    ),
    "too large": (
        [*HELD, "--fix", "z+:xyz=1e300", "--json", "out.json"],
        "a prescribed displacement must be at most 1e+50 in size; got 1e+300",
    ),
    "squares too large": (
        [*HELD, "--fix", "z+:xyz=1e160", "--json", "out.json"],
        "a prescribed displacement must be at most 1e+50 in size; got 1e+160",
    ),
    "results too large": (
        ["--material", "Isotropic3D:E=1e-60,nu=0.3,density=1e49", "--fix", "z-:xyz", "--gravity", "0,0,1e50"],
        "numbers exceed what a computer holds",
    ),
    "no material": (["--fix", "z-:xyz"], "element 1 (Element3D8N) has no material"),
    "misspelt formulation": (
        [*HELD, "--formulation", "enhnced"],
        "--formulation: formulation must be one of b_bar, enhanced, ",
    ),
    "no such formulation": (
        [*HELD, "--formulation", "reduced"],
        "there is no formulation 'reduced' of elements with 8 nodes",
    ),
    "formulation of a body": ([*HELD, "--formulation", "modal"], "--formulation: formulation must be one of"),
}


@pytest.mark.parametrize("name", WRONG_OPTIONS)
def test_a_wrong_option_is_named_and_nothing_is_written(run, box, name):
    Path("sub.vtu").mkdir()
    before = sorted(Path().iterdir())
    words, text = WRONG_OPTIONS[name]
    assert run("solve", "box.vtu", *words).refuses(text)
    assert sorted(Path().iterdir()) == before


def test_words_that_are_no_options_are_refused_in_two_lines(run, box):
    for words, text in (
        (["solve", "box.vtu", "--solver", "magic"], "invalid choice: 'magic'"),
        (["solve"], "the following arguments are required: input"),
        (["dance"], "invalid choice: 'dance'"),
        ([], "the following arguments are required: COMMAND"),
    ):
        done = run(*words)
        assert done.code == 2
        assert text in done.err
        assert done.err.startswith("error: ")
        assert done.err.splitlines()[1].endswith("--help lists what there is")


def test_an_unknown_part_is_answered_with_the_nearest_name(run, folder):
    mesh = kl.box()
    mesh.add_part("Clamped", "z-")
    kl.write("a.mdpa", kl.Model(mesh, LAW))
    done = run("solve", "a.mdpa", "--fix", "Clampd:xyz")
    assert done.refuses("there is no part 'Clampd'", "Did you mean Clamped?")


@pytest.mark.parametrize("command", ["solve", "info", "check", "convert"])
def test_an_input_that_is_not_there_or_a_folder_is_refused(run, folder, command):
    rest = ["out.mdpa"] if command == "convert" else []
    for name in ("none.mdpa", "none.elem", "none.vtu", "none.json", "none"):
        assert run(command, name, *rest).refuses("none")
    Path("sub").mkdir()
    for name in (".", "sub", ".."):
        assert run(command, name, *rest).refuses("folder")
    assert not Path("out.mdpa").exists()


def test_a_folder_is_its_run_file_of_kratos(run, folder):
    shutil.copytree(EXAMPLES / "cantilever", "beam")
    by_folder, by_file = (
        run("solve", name, "--json", "a.json") for name in ("beam", "beam/ProjectParameters.json")
    )
    assert (by_folder.code, by_file.code) == (0, 0)
    assert by_folder.rows["largest displacement"] == by_file.rows["largest displacement"]
    for command in ("check", "info"):
        assert run(command, "beam").out == run(command, "beam/ProjectParameters.json").out != ""
    assert run("convert", "beam", "beam.vtu").code == 0
    assert kl.read("beam").mesh.n_nodes == kl.read("beam/cantilever.mdpa").mesh.n_nodes
    Path("beam/ProjectParameters.json").unlink()
    Path("beam/beam_parameters.json").write_text("{}")
    refused = run("solve", "beam")
    assert refused.refuses(
        "beam: is a folder without ProjectParameters.json; name a file in it, such as beam_param"
    )
    assert "beam: beam:" not in refused.err


def test_a_folder_beside_a_set_of_its_name_is_the_stem(run, folder):
    kl.write("cube.elem", kl.read(GRAVITY_CUBE))
    Path("cube").mkdir()
    Path("cube/ProjectParameters.json").write_text("{}")
    assert run("solve", "cube").code == 0


def fingerprints():
    return {path.name: path.read_bytes() for path in Path().iterdir() if path.is_file()}


def test_no_file_that_is_read_is_overwritten(run, box):
    kl.write("set.elem", held(box))
    script(model="set.elem", target="set.json", results=["./set.json"])
    shutil.copytree(EXAMPLES / "cantilever", ".", dirs_exist_ok=True)
    before = fingerprints()
    for words in (
        ("convert", "set.elem", "set.node"),
        ("convert", "set", "set.init"),
        ("convert", "set.cond", "./set.elem"),
        ("convert", "run.py", "set.prop"),
        ("solve", "run.py"),
        ("convert", "ProjectParameters.json", "cantilever.mdpa"),
        ("solve", "box.vtu", "-o", "box.vtu"),
        ("solve", "ProjectParameters.json", "--json", "StructuralMaterials.json"),
    ):
        assert run(*words).refuses("is an input or another output")
        assert fingerprints() == before


def test_links_in_a_circle_and_pipes_are_refused(run, box):
    for name in ("loop.mdpa", "loop.vtu"):
        Path(name).symlink_to(name)
        assert run("info", name).refuses(name)
    for name in ("pipe.mdpa", "pipe.vtu", "pipe.elem", "pipe.json"):
        os.mkfifo(name)
    for name in ("pipe.mdpa", "pipe.vtu", "pipe.elem"):
        assert run("info", name).refuses(f"{name}: is a pipe or a device")


@pytest.mark.parametrize("target", ["out", "out.json", "out.foo", "none/out.vtu", "box.mdpa"])
def test_a_conversion_to_nowhere_or_onto_itself_is_refused(run, box, target):
    assert run("convert", "box.mdpa", target).refuses(target)
    assert not list(Path().glob("out*"))


def test_a_folder_without_permission_is_refused(run, box):
    Path("shut").mkdir(mode=0o500)
    if os.access("shut", os.W_OK):
        pytest.skip("this user may write everywhere")
    assert run("solve", "box.vtu", *HELD, "-o", "shut/out.vtu").refuses("shut/out.vtu: cannot be written")


@pytest.mark.parametrize("command", [("solve", *HELD), ("info",)], ids=lambda words: words[0])
def test_a_full_disk_behind_the_output_is_an_error_in_one_line(box, command):
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full on this system")
    words = [sys.executable, "-m", "kratos_lite", command[0], "box.vtu", *command[1:]]
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            words, stdout=full, stderr=subprocess.PIPE, text=True, timeout=FOREVER, check=False
        )
    assert (done.returncode, done.stderr) == (2, "error: the output: No space left on device\n")


def test_a_file_that_fails_loses_no_summary(run, box, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    done = run("solve", "box.vtu", *HELD, "--json", "out.json")
    assert done.code == 2
    assert done.rows["unknowns"] == "54"
    assert "written" not in done.out
    assert done.err.startswith("error: out.json: cannot be written: No space left on device; ")


def test_a_terminal_that_fails_loses_no_file(box, monkeypatch):
    def closed(*_, **__):
        raise BrokenPipeError

    monkeypatch.setattr(kl.Outcome, "summary", closed)
    assert main(["solve", "box.vtu", *HELD, "--json", "out.json", "--gravity", "0,0,-9.81"]) == 0
    assert len(displacement("out.json")) == 27


def test_gravity_on_top_of_that_of_the_file_is_noted(run, folder):
    done = run("solve", GRAVITY_CUBE, "--gravity", "0,0,-9.81")
    assert done.rows["total load"] == "(0, 0, -149504) N"
    assert "--gravity is added to the gravity of the file" in done.out
    assert "--gravity is added" not in run("solve", GRAVITY_CUBE).out


def test_the_material_of_a_part_wins_in_either_order(run, box):
    pair = (["--material", "1:E=2e9,nu=0"], ["--material", "E=5e9,nu=0"])
    for number, words in enumerate(([*pair[0], *pair[1]], [*pair[1], *pair[0]], pair[0])):
        rest = ["--fix", "z-:xyz", "--traction", "z+:0,0,1e5", "--json", f"{number}.json"]
        assert run("solve", "box.vtu", *words, *rest).code == 0
    first, second, alone = (displacement(f"{number}.json") for number in range(3))
    assert np.array_equal(first, second)
    assert np.array_equal(first, alone)


def test_a_mesh_in_mm_is_scaled(run, box):
    extent = "extent   [0, 0.001] × [0, 0.001] × [0, 0.001] m"
    assert extent in run("check", "box.vtu", *HELD, "--gravity", "0,0,-9.81", "--scale", "mm").out
    assert run("solve", "box.vtu", *HELD, "--scale", "mil").refuses(
        "--scale: expected FACTOR", "or mm, cm, in, ft (1)); got 'mil'"
    )
    assert run("solve", "box.vtu", *HELD, "--scale", "0").refuses("scale must be", "> 0")


def test_forces_that_cancel_are_shown_as_zero(run, box):
    done = run("solve", "box.vtu", *HELD, "--traction", "x-:1e9,1,3e8", "--traction", "x+:-1e9,1,-3e8")
    assert done.rows["total load"] == "(0, 2, 0) N"
    assert done.rows["total reaction"] == "(0, -2, 0) N"
    assert re.search(
        r"Pa \(at a Gauss point\) in element \d around \(0\.\d*, 0\.\d*, 0\.\d*\) m at a clamped",
        done.rows["largest von Mises"],
    )


def test_a_defect_is_told_apart_from_bad_input(run, box, monkeypatch):
    monkeypatch.setattr(kl.Model, "solve", lambda *_, **__: 1 / 0)
    done = run("solve", "box.vtu", *HELD)
    assert done.code == 1
    assert done.err.startswith("internal error: ZeroDivisionError: division by zero\n")
    assert "report" in done.err


def test_want_of_memory_is_told(run, box, monkeypatch):
    def greedy(*_, **__):
        raise MemoryError

    monkeypatch.setattr(kl.Model, "solve", greedy)
    assert run("solve", "box.vtu", *HELD).refuses("not enough memory", "--solver amg")


def interrupt(*_, **__):
    signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("error", [KeyboardInterrupt, ImportError], ids=["itself", "told as another error"])
def test_ctrl_c_while_modules_are_imported_ends_with_130(run, box, monkeypatch, error):
    class Import:
        def find_spec(self, name, *_):
            if name == "kratos_lite.cli.apply_options":
                try:
                    interrupt()
                except KeyboardInterrupt:
                    raise error from None

    monkeypatch.delitem(sys.modules, "kratos_lite.cli.apply_options")
    monkeypatch.delattr("kratos_lite.cli.apply_options")
    monkeypatch.setattr(sys, "meta_path", [Import(), *sys.meta_path])
    done = run("check", "box.vtu")
    assert (done.code, done.out, done.err) == (130, "", "interrupted; nothing half-written is left\n")


def test_ctrl_c_while_solving_ends_with_130(run, box, monkeypatch):
    monkeypatch.setattr(kl.Model, "solve", interrupt)
    done = run("solve", "box.vtu", *HELD, "-o", "out.vtu")
    assert (done.code, done.out) == (130, "")
    assert done.err == "interrupted; nothing half-written is left\n"
    assert not Path("out.vtu").exists()


def test_ctrl_c_while_writing_leaves_the_old_file(run, box, monkeypatch):
    Path("out.vtu").write_text("old")
    before = sorted(Path().iterdir())
    monkeypatch.setattr(os, "fsync", interrupt)
    assert run("solve", "box.vtu", *HELD, "-o", "out.vtu").code == 130
    assert Path("out.vtu").read_text() == "old"
    assert sorted(Path().iterdir()) == before


def test_a_reader_that_goes_away_is_no_error(folder):
    mesh = kl.box().replace(parts={f"part_{i}": kl.Part(nodes=np.arange(8)) for i in range(800)})
    kl.write("parts.mdpa", mesh)
    command = [sys.executable, "-m", "kratos_lite", "info", "parts.mdpa"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as running:
        running.stdout.close()
        told = running.stderr.read()
        running.wait(timeout=FOREVER)
    assert (running.returncode, told) == (0, b"")


@pytest.mark.parametrize("command", ["info", "check"])
def test_several_files_stand_under_headings_and_the_worst_code_counts(run, box, command):
    script("by_file.json", gravity=-9.81)
    done = run(command, "run.py", "lost_and_gone.mdpa", "run.py")
    assert done.code == 2
    assert [line for line in done.out.splitlines() if line.startswith("==")] == [
        "== run.py",
        "== lost_and_gone.mdpa",
        "== run.py",
    ]
    assert done.err == "error: lost_and_gone.mdpa: there is no such file\n"
    assert run(command, "run.py", "run.py").code == 0
    assert run(command, "bx.mdpa").refuses("bx.mdpa: there is no such file. Did you mean box.mdpa?")


def test_most_unknowns_stop_a_requested_error(run, box):
    options = ("box.vtu", *HELD, "--gravity", "0,0,-9.81")
    few = run("solve", *options, "--error", "0.01%", "--most-unknowns", "60")
    assert (few.code, "was not reached" in few.out) == (3, True)
    assert "--most-unknowns belongs to --error" in run("solve", *options, "--most-unknowns", "60").err


# ---- files that are wrong on purpose -------------------------------------------------------------------

OTHER_JSON = ("60_good", "64_unknown_key", "65_wrong_type", "66_path_traversal", "68_missing_input",
              "69_directory_as_input")  # fmt: skip
REFUSED = {
    **{f"{name}.mdpa": "" for name in malformed.REFUSED},  # why, the reader's own tests show
    **dict.fromkeys((f"{name}.json" for name in OTHER_JSON), "is no run file of Kratos, which has 'solver_"),
    "61_trailing_comma.json": ":1:",
    "62_nan_literal.json": ": NaN is not a number in JSON",
    "63_duplicate_key.json": ": duplicate key 'E'",
    "67_deep.json": ": nesting deeper than 64",
    "70_bigint.json": "of 5001 digits is too long",
    "80_ragged.elem": ":1:1: unknown statement 'NODES'",
    "81_unknown_keyword.elem": ":1:1: unknown statement 'KinematicLinear3D11N'",
    "90_pickle_in_npz.npz": ": unknown ending '.npz'",
    "91_pickle_named_restart.rest": ": unknown ending '.rest'",
}
"""Files that no command takes, with place and error."""

DESCRIBED = {
    "04_unknown_element.mdpa": ":22: unknown element 'SmallDisplacementElement3D9N'",
    "12_negative_density.mdpa": ":5: Properties 1: density (DENSITY) -7620 must be ≥ 0",
    "13_nu_half.mdpa": ":7: Properties 1: nu (POISSON_RATIO) 0.5 must be < 0.5",
    "14_E_zero.mdpa": ":6: Properties 1: E (YOUNG_MODULUS) 0 must be > 0 Pa",
    "20_unknown_variable.mdpa": ":6: unknown variable YOUNGS_MODULUS. Did you mean YOUNG_MODULUS?",
    "23_inverted.mdpa": ":22: element 1 (SmallDisplacementElement3D8N): det J = -0.125 at Gauss point 1",
}
"""Files that read well and mean nonsense: ``info`` describes them, nothing else takes them."""


NOTED = {
    "06_duplicate_node_id_same_coords.mdpa": "line 19: node 8 is already defined at line 18, the same",
    "43_unknown_block.mdpa": "line 33: block Wibble is skipped",
    "47_unreferenced_node.mdpa": "1 nodes belong to no element and carry no equations: 9",
}
READ = [name for name in map("{}.mdpa".format, malformed.ACCEPTED) if name not in DESCRIBED]
"""Files to be read; what is noted about some of them."""


@pytest.fixture
def bad(malformed, tmp_path, monkeypatch):
    """Return the folder of bad files; a command on one of them that takes 5 s is an error."""

    def late(*_):
        raise TimeoutError("a bad file took more than 5 s")

    monkeypatch.chdir(tmp_path)
    old = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, 5)
    yield malformed
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, old)


def test_every_bad_file_is_in_a_table(malformed):
    names = {path.name for path in malformed.iterdir() if path.is_file()}
    assert names == {*READ, *REFUSED, *DESCRIBED}


@pytest.mark.parametrize("name", READ)
def test_an_odd_file_that_can_be_read_is_solved_and_described(run, bad, name):
    solved, described = run("solve", "--fix", "z-:xyz", bad / name), run("info", bad / name)
    assert (solved.code, solved.err, described.code, described.err) == (0, "", 0, "")
    assert NOTED.get(name, "") in solved.out
    assert solved.rows["unknowns"] == "12"


@pytest.mark.parametrize("name", REFUSED)
def test_a_bad_file_is_refused_with_place_and_cause(run, bad, name):
    for command in ("check", "info"):
        assert run(command, bad / name).refuses(name, REFUSED[name])


@pytest.mark.parametrize("name", DESCRIBED)
def test_a_file_that_means_nonsense_is_described_alone(run, bad, name):
    assert run("check", bad / name).refuses(name, DESCRIBED[name])
    done = run("info", bad / name)
    assert (done.code, done.err) == (0, "")
    assert "nodes       8\n" in done.out


# ---- progress ----------------------------------------------------------------------------------------


class Terminal(io.StringIO):
    def __init__(self, is_terminal):
        super().__init__()
        self.is_terminal = is_terminal

    def isatty(self):
        return self.is_terminal


def shown(monkeypatch, is_terminal, seconds, **options):
    """Return what is shown of some work that takes so long."""
    screen = Terminal(is_terminal)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(progress, "PATIENCE", 0.02)
    with progress.in_terminal("read", **options) as line:
        if line:
            line("assemble", 0.5)
        time.sleep(seconds)
    return screen.getvalue()


def test_progress_shows_in_a_terminal_after_a_while_and_is_wiped(monkeypatch):
    said = shown(monkeypatch, True, 0.3)
    assert re.match(r"\rassemble     50%     0\.\d s\r", said)
    assert re.search(r"\r +\r$", said)


def test_progress_of_a_short_work_or_without_a_terminal_is_not_shown(monkeypatch):
    assert shown(monkeypatch, False, 0.1) == ""


@pytest.mark.parametrize(
    ("share", "affordable", "code", "words"),
    [("15%", None, 0, "of the energy norm, from"), ("0.1%", 600, 3, "was not reached")],
)
def test_an_error_asked_for_is_reached_or_missed(share, affordable, code, words, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if affordable:
        monkeypatch.setattr("kratos_lite.analysis.adaptive._affordable", lambda: affordable)
    kl.write("bar.vtu", kl.box((4, 1, 1), (4, 1, 1)))
    bar = ["--material", "E=1e9,nu=0.3", "--fix", "x-:xyz", "--traction", "x+:0,0,1e3"]
    done = run("solve", "bar.vtu", *bar, "--error", share, "-o", "fine.vtu")
    assert done.code == code
    assert words in done.out
    assert done.out.count("refinement") >= 2
    assert Path("fine.vtu").exists()


@pytest.mark.parametrize("share", ["0", "100%", "much", "nan"])
def test_an_error_that_is_no_share_is_refused(run, tmp_path, monkeypatch, share):
    monkeypatch.chdir(tmp_path)
    kl.write("bar.vtu", kl.box())
    done = run("solve", "bar.vtu", "--material", "E=1e9,nu=0.3", f"--error={share}")
    assert done.refuses("--error: ", "is not a finite number" if share in ("much", "nan") else "below 1")
