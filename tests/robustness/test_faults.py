"""Faults that really happen while the command line runs: signals, full disks, no memory, files that vanish.

Each run is a process of its own in which one function is the place of the fault, see ``fixtures/faults.py``.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from children import FOREVER

import kratos_lite as kl

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and limits are those of Unix")
DRIVER = Path(__file__).parent.parent / "fixtures" / "faults.py"
HELD = ("--fix", "z-:xyz", "--gravity", "0,0,-9.81")
STATIC = ("solve", "cube.mdpa", *HELD)
MOTION = (*STATIC, "--time", "1e-5:1000000")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a model, and an older result of the same name as the new one."""
    monkeypatch.chdir(tmp_path)
    model = kl.Model(kl.box(cells=(6, 6, 6)), kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0))
    kl.write("cube.mdpa", model)
    kl.write("cube.msh", model.mesh)
    Path("out.vtu").write_text("old")
    return tmp_path


def run(fault, *words, cwd=None):
    """Return the run of a command with a fault; nothing that it started is alive afterwards."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, DRIVER, json.dumps(fault), *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        cwd=cwd,
        start_new_session=True,
    )
    try:
        out, err = process.communicate(timeout=FOREVER)
    finally:
        process.kill()
        process.wait()
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)
    assert "at" not in fault or err.startswith("fault\n"), "the place of the fault was never reached"
    return subprocess.CompletedProcess(process.args, process.returncode, out, err.removeprefix("fault\n"))


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def refused(done, *fragments):
    """Show that a run ended with one error that says all fragments."""
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("error: "), done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.count("error:") == 1
    for fragment in fragments:
        assert fragment in done.stderr
    return True


# ---- signals ---------------------------------------------------------------------------------------

PHASES = {
    "reading": ("kratos_lite.io.files:read_document", STATIC),
    "reading by meshio": ("kratos_lite.io.formats.meshio:read_foreign", ("convert", "cube.msh", "out.vtu")),
    "checking": ("kratos_lite.model.checks:check_geometry", STATIC),
    "assembling": ("kratos_lite.solvers.constrained_system:assemble_stiffness", STATIC),
    "factorizing": ("kratos_lite.solvers.direct:factorize", (*STATIC, "--solver", "direct")),
    "multigrid set-up": ("kratos_lite.solvers.multigrid:multigrid", (*STATIC, "--solver", "amg")),
    "multigrid iterations": (
        "kratos_lite.solvers.linear_solver:LinearSolver._iterate",
        (*STATIC, "--solver", "amg"),
    ),
    "frequencies": ("kratos_lite.solvers.eigen:dense_modes", (*STATIC, "--modes", "3")),
    "stresses": ("kratos_lite.io.runners.outcome:Outcome.summary", STATIC),
    "writing": ("os:fsync", STATIC),
    "replacing": ("os:replace", STATIC),
    "writing of another format": ("os:fsync", ("convert", "cube.mdpa", "out.vtu")),
}


@pytest.mark.parametrize("phase", PHASES)
def test_ctrl_c_in_any_phase_ends_the_run_and_leaves_files_as_they_were(folder, phase):
    place, words = PHASES[phase]
    before = contents(folder)
    words = words if words[0] == "convert" or "--modes" in words else (*words, "-o", "out.vtu")
    done = run({"at": place, "signal": "SIGINT"}, *words)
    assert done.returncode == 130
    assert done.stderr == "interrupted; nothing half-written is left\n"
    after = contents(folder)
    if phase == "replacing":  # the signal comes before or after
        found = after.pop("out.vtu")
        assert found == before.pop("out.vtu") or found.rstrip().endswith(b"</VTKFile>")
    assert after == before


@pytest.mark.parametrize(
    ("name", "code", "phase"),
    [("SIGTERM", 143, "assembling"), ("SIGTERM", 143, "writing"), ("SIGHUP", 129, "checking")],
)
def test_a_request_to_end_is_cleaned_up_as_ctrl_c_is(folder, phase, name, code):
    place, words = PHASES[phase]
    before = contents(folder)
    done = run({"at": place, "signal": name}, *words, "-o", "out.vtu")
    assert (done.returncode, done.stderr) == (code, "terminated; nothing half-written is left\n")
    assert contents(folder) == before


@pytest.mark.parametrize(
    ("name", "code"), [("SIGINT", 130), ("SIGTERM", 143)], ids=["Ctrl-C", "request to end"]
)
@pytest.mark.parametrize(
    ("place", "call"),
    [
        ("kratos_lite.analysis.transient:TransientAnalysis.advance", 4),
        ("kratos_lite.io.writers.series:write_vtu", 4),
    ],
    ids=["step", "file"],
)
def test_a_run_through_time_that_ends_early_can_be_continued(folder, name, code, place, call):
    fault = {"at": place, "call": call, "signal": name}
    done = run(fault, *MOTION, "-o", "out.pvd", "--state", "end.npz")
    assert done.returncode == code
    frames = re.findall(r'file="(\S+)"', Path("out.pvd").read_text())
    assert len(frames) >= 3
    assert all(Path(frame).read_bytes().rstrip().endswith(b"</VTKFile>") for frame in frames)
    assert {path.name for path in folder.glob("*.vtu")} - {*frames, "out.vtu"} <= {
        f"out_{len(frames):05}.vtu"
    }
    assert kl.read_state("end.npz").step >= len(frames) - 1
    assert not list(folder.glob(".*"))


# ---- disks and folders -----------------------------------------------------------------------------

FIRST = {"copy.elem": "copy.node"}
"""The file that comes first of those that an output has."""
OUTPUTS = {
    "out.vtu": (*STATIC, "-o", "out.vtu"),
    "out.json": (*STATIC, "--json", "out.json"),
    "out.png": (*STATIC, "--picture", "out.png"),
    "copy.mdpa": ("convert", "cube.mdpa", "copy.mdpa"),
    "copy.vtu": ("convert", "cube.mdpa", "copy.vtu"),
    "copy.elem": ("convert", "cube.mdpa", "copy.elem"),
    "copy.msh": ("convert", "cube.mdpa", "copy.msh"),
}


@pytest.mark.parametrize("output", OUTPUTS)
def test_a_disk_that_fills_up_is_one_error_and_nothing_half_written(folder, output):
    before = contents(folder)
    done = run({"at": "kratos_lite.atomic:os.urandom", "file_size": 1000}, *OUTPUTS[output])
    assert refused(done, f"{FIRST.get(output, output)}: cannot be written: ")
    assert contents(folder) == before


def test_a_disk_that_fills_up_in_a_run_through_time_keeps_what_is_there(folder):
    place = "kratos_lite.analysis.transient:TransientAnalysis.advance"
    done = run({"at": place, "call": 4, "file_size": 1000}, *MOTION, "-o", "out.pvd")
    assert refused(done, "out_00004.vtu: cannot be written: File too large; raise the limit")
    frames = re.findall(r'file="(\S+)"', Path("out.pvd").read_text())
    assert len(frames) == 4
    assert all(Path(frame).read_bytes().rstrip().endswith(b"</VTKFile>") for frame in frames)
    assert not list(folder.glob(".*"))


@pytest.mark.parametrize("output", ["out.csv", "out.npz"])
def test_a_disk_that_is_full_at_the_end_of_a_run_through_time_gets_no_half_table(folder, output):
    before = contents(folder)
    place = "kratos_lite.analysis.transient:TransientAnalysis.advance"
    done = run({"at": place, "file_size": 1000}, *STATIC, "--time", "1e-5:20", "-o", output)
    assert refused(done, f"{output}: cannot be written: File too large; raise the limit")
    assert contents(folder) == before


@pytest.mark.parametrize("output", ["out.vtu", "out.json", "copy.elem", "copy.msh"])
def test_a_folder_where_nothing_may_be_written_is_named(folder, output):
    Path("shut").mkdir(mode=0o555)
    *words, name = OUTPUTS[output]
    before = contents(folder)
    done = run({"at": "kratos_lite.atomic:replacing", "nobody": True}, *words, f"shut/{name}")
    assert refused(done, f"shut/{FIRST.get(name, name)}: cannot be written: Permission denied")
    assert contents(folder) == before


def test_a_file_that_may_not_be_read_is_named(folder):
    Path("cube.mdpa").chmod(0o000)
    assert refused(run({"nobody": True}, *STATIC), "cube.mdpa", "Permission denied")


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("kratos_lite.io.files:read_document", STATIC),
        ("kratos_lite.io.formats.meshio:read_foreign", ("convert", "cube.msh", "out.vtu")),
    ],
)
def test_a_file_that_vanishes_before_it_is_read_is_named(folder, place, words):
    done = run({"at": place, "remove": [words[1]]}, *words)
    assert refused(done, words[1])
    assert Path("out.vtu").read_text() == "old"


def test_a_folder_of_outputs_that_vanishes_is_named(folder):
    Path("results").mkdir()
    place = "kratos_lite.solvers.constrained_system:assemble_stiffness"
    done = run({"at": place, "remove": ["results"]}, *STATIC, "-o", "results/out.vtu")
    assert refused(done, "results/out.vtu: cannot be written: there is no folder")
    assert "total load" in done.stdout  # what was computed is still told


# ---- memory ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    """A file whose model needs some hundred megabytes."""
    path = tmp_path_factory.mktemp("large") / "large.mdpa"
    model = kl.Model(kl.box(cells=(20, 20, 20)), kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0))
    kl.write(path, model)
    return path


@pytest.mark.parametrize("solver", ["auto", "direct"])
@pytest.mark.parametrize("megabytes", [5, 200])
def test_too_little_memory_is_one_error(large, tmp_path, megabytes, solver):
    """How much is enough depends on the machine: a run ends well, or with one error and no file."""
    words = ("solve", large, *HELD, "--solver", solver, "-q", "-o", "out.vtu")
    done = run({"memory": megabytes * 10**6}, *words, cwd=tmp_path)
    if megabytes > 5 and done.returncode == 0:
        assert (tmp_path / "out.vtu").read_bytes().rstrip().endswith(b"</VTKFile>")
        return
    assert done.returncode == 2, done.stderr
    *_, text = done.stderr.partition("error: ")  # SuperLU itself may say something before
    assert "memory" in text
    assert text.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_enough_memory_is_enough(folder):
    done = run({"memory": 2 * 10**9}, *STATIC, "-o", "out.vtu")
    assert done.returncode == 0, done.stderr
