"""Faults that really happen while the command line runs: signals, full disks, no memory, files that vanish.

Each run is a fork of one process in which one function is the place of the fault, see ``fixtures/faults.py``.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import kratos_lite as kl

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and limits are those of Unix")
STEEL = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
DRIVER = Path(__file__).parent.parent / "fixtures" / "faults.py"
HELD = ("--fix", "z-:xyz", "--gravity", "0,0,-9.81")
STATIC = ("solve", "cube.mdpa", *HELD)
MOTION = (*STATIC, "--time", "1e-5:1000000")


@pytest.fixture(scope="module")
def server():
    """The process that runs all requests."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [sys.executable, DRIVER], stdin=pipe, stdout=pipe, text=True, env=environment
    ) as process:
        yield process
        process.stdin.close()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a model, and an older result of the same name as the new one."""
    monkeypatch.chdir(tmp_path)
    model = kl.Model(kl.box(cells=(6, 6, 6)), STEEL)
    kl.write("cube.mdpa", model)
    kl.write("cube.msh", model.mesh)
    Path("out.vtu").write_text("old")
    return tmp_path


@pytest.fixture
def run(server, tmp_path):
    """Return what comes of a command with a fault; nothing that it started is alive afterwards."""

    def run(fault, *words):
        request = {"fault": fault, "words": [str(word) for word in words], "cwd": str(tmp_path)}
        server.stdin.write(json.dumps(request) + "\n")
        server.stdin.flush()
        pid, code, out, err = json.loads(server.stdout.readline())
        with pytest.raises(ProcessLookupError):
            os.killpg(pid, 0)
        assert "at" not in fault or err.startswith("fault\n"), "the place of the fault was never reached"
        return SimpleNamespace(returncode=code, stdout=out, stderr=err.removeprefix("fault\n"))

    return run


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def refused(done, *fragments):
    """Whether a run ended with one error that says all fragments."""
    assert (done.returncode, done.stderr[:7], done.stderr.count("error:")) == (2, "error: ", 1), done.stderr
    assert "Traceback" not in done.stderr
    return all(fragment in done.stderr for fragment in fragments)


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
    "frequencies": ("kratos_lite.analysis.modal:dense_modes", (*STATIC, "--modes", "3")),
    "stresses": ("kratos_lite.io.runners.outcome:Outcome.summary", STATIC),
    "writing": ("os:fsync", STATIC),
    "replacing": ("os:replace", STATIC),
    "writing of another format": ("os:fsync", ("convert", "cube.mdpa", "out.vtu")),
}


FRAME = re.compile(r'file="(\S+)"')
END = b"</VTKFile>"
SAID = {"SIGINT": (130, "interrupted"), "SIGTERM": (143, "terminated"), "SIGHUP": (129, "terminated")}


@pytest.mark.parametrize(
    ("name", "phase"),
    [
        *(("SIGINT", phase) for phase in PHASES),
        *(("SIGTERM", "assembling"), ("SIGTERM", "writing"), ("SIGHUP", "checking")),
    ],
)
def test_a_signal_in_any_phase_ends_the_run_and_leaves_files_as_they_were(folder, run, name, phase):
    place, words = PHASES[phase]
    before = contents(folder)
    words = words if words[0] == "convert" or "--modes" in words else (*words, "-o", "out.vtu")
    done = run({"at": place, "signal": name}, *words)
    code, how = SAID[name]
    assert (done.returncode, done.stderr) == (code, f"{how}; nothing half-written is left\n")
    after = contents(folder)
    if phase == "replacing":  # the signal comes before or after
        found = after.pop("out.vtu")
        assert found == before.pop("out.vtu") or found.rstrip().endswith(END)
    assert after == before


ADVANCE = "kratos_lite.analysis.transient:TransientAnalysis.advance"


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("place", [ADVANCE, "kratos_lite.io.writers.series:write_vtu"], ids=["step", "file"])
def test_a_run_through_time_that_ends_early_can_be_continued(folder, run, name, place):
    fault = {"at": place, "call": 4, "signal": name}
    assert run(fault, *MOTION, "-o", "out.pvd", "--state", "end.npz").returncode == SAID[name][0]
    frames = whole_frames(folder)
    assert len(frames) >= 3
    others = {path.name for path in folder.glob("*.vtu")} - {*frames, "out.vtu"}
    assert others <= {f"out_{len(frames):05}.vtu"}
    assert kl.read_state("end.npz").step >= len(frames) - 1


def whole_frames(folder):
    """Return the files of the series out.pvd, which are whole; no temporary file is left."""
    frames = FRAME.findall(Path("out.pvd").read_text())
    assert all(Path(frame).read_bytes().rstrip().endswith(END) for frame in frames)
    assert not list(folder.glob(".*"))
    return frames


# ---- disks and folders -----------------------------------------------------------------------------

WRITING = "kratos_lite.atomic:os.urandom"
OUTPUTS = {
    "out.vtu": (*STATIC, "-o", "out.vtu"),
    "out.json": (*STATIC, "--json", "out.json"),
    "out.png": (*STATIC, "--picture", "out.png"),
    "copy.mdpa": ("convert", "cube.mdpa", "copy.mdpa"),
    "copy.vtu": ("convert", "cube.mdpa", "copy.vtu"),
    "copy.node": ("convert", "cube.mdpa", "copy.elem"),  # the first file of the set
    "copy.msh": ("convert", "cube.mdpa", "copy.msh"),
}


@pytest.mark.parametrize("output", OUTPUTS)
def test_a_disk_that_fills_up_is_one_error_and_nothing_half_written(folder, run, output):
    before = contents(folder)
    done = run({"at": WRITING, "file_size": 1000}, *OUTPUTS[output])
    assert refused(done, f"{output}: cannot be written: ")
    assert contents(folder) == before


def test_a_disk_that_fills_up_in_a_run_through_time_keeps_what_is_there(folder, run):
    done = run({"at": ADVANCE, "call": 4, "file_size": 1000}, *MOTION, "-o", "out.pvd")
    assert refused(done, "out_00004.vtu: cannot be written: File too large; raise the limit")
    assert len(whole_frames(folder)) == 4


@pytest.mark.parametrize("output", ["out.csv", "out.npz"])
def test_a_disk_that_is_full_at_the_end_of_a_run_through_time_gets_no_half_table(folder, run, output):
    before = contents(folder)
    done = run({"at": ADVANCE, "file_size": 1000}, *STATIC, "--time", "1e-5:20", "-o", output)
    assert refused(done, f"{output}: cannot be written: File too large; raise the limit")
    assert contents(folder) == before


@pytest.mark.parametrize("output", ["out.vtu", "out.json", "copy.node", "copy.msh"])
def test_a_folder_where_nothing_may_be_written_is_named(folder, run, output):
    Path("shut").mkdir(mode=0o555)
    *words, name = OUTPUTS[output]
    before = contents(folder)
    done = run({"at": WRITING, "nobody": True}, *words, f"shut/{name}")
    assert refused(done, f"shut/{output}: cannot be written: Permission denied")
    assert contents(folder) == before


def test_a_file_that_may_not_be_read_is_named(folder, run):
    Path("cube.mdpa").chmod(0o000)
    assert refused(run({"nobody": True}, *STATIC), "cube.mdpa", "Permission denied")


@pytest.mark.parametrize("phase", ["reading", "reading by meshio"])
def test_a_file_that_vanishes_before_it_is_read_is_named(folder, run, phase):
    place, words = PHASES[phase]
    assert refused(run({"at": place, "remove": [words[1]]}, *words), words[1])
    assert Path("out.vtu").read_text() == "old"


def test_a_folder_of_outputs_that_vanishes_is_named(folder, run):
    Path("results").mkdir()
    place, words = PHASES["assembling"]
    done = run({"at": place, "remove": ["results"]}, *words, "-o", "results/out.vtu")
    assert refused(done, "results/out.vtu: cannot be written: there is no folder")
    assert "total load" in done.stdout  # what was computed is still told


# ---- memory ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", ["auto", "direct"])
@pytest.mark.parametrize("megabytes", [5, 200])
def test_too_little_memory_is_one_error(folder, run, megabytes, solver):
    """How much is enough depends on the machine: a run ends well, or with one error and no file."""
    kl.write("large.mdpa", kl.Model(kl.box(cells=(20, 20, 20)), STEEL))  # needs some hundred megabytes
    words = ("solve", "large.mdpa", *HELD, "--solver", solver, "-q", "-o", "new.vtu")
    done = run({"memory": megabytes * 10**6}, *words)
    if megabytes > 5 and done.returncode == 0:
        assert Path("new.vtu").read_bytes().rstrip().endswith(END)
        return
    assert done.returncode == 2, done.stderr
    *_, text = done.stderr.partition("error: ")  # SuperLU itself may say something before
    assert "memory" in text
    assert text.count("\n") == 1
    assert not Path("new.vtu").exists()


def test_enough_memory_is_enough(folder, run):
    done = run({"memory": 2 * 10**9}, *STATIC, "-o", "out.vtu")
    assert done.returncode == 0, done.stderr
