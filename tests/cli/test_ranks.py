"""The command line where many processes may have been started: what it sees of them without MPI."""

import subprocess
import sys

import pytest
from children import FOREVER

import kratos_lite as kl
from kratos_lite.cli.ranks import launched

LAW = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
OPEN_MPI = {"OMPI_COMM_WORLD_SIZE": "8", "OMPI_COMM_WORLD_LOCAL_SIZE": "4"}


@pytest.fixture
def beam(tmp_path, monkeypatch):
    """Write a clamped beam under its weight into the current folder."""
    monkeypatch.chdir(tmp_path)
    model = kl.Model(kl.box((4, 1, 1), (4, 1, 1)), LAW)
    model.fix("x-")
    model.add(kl.Gravity((0, 0, -9.81)))
    kl.write("beam.mdpa", model)


def test_what_the_launchers_say():
    assert launched({}) == (0, 1, 1)
    assert launched({"OMPI_COMM_WORLD_RANK": "3", **OPEN_MPI}) == (3, 8, 4)
    assert launched({"PMI_RANK": "1", "PMI_SIZE": "2"}) == (1, 2, 2)
    step = {"SLURM_PROCID": "5", "SLURM_STEP_NUM_TASKS": "6", "SLURM_NTASKS": "6"}
    assert launched(step) == (5, 6, 6)
    assert launched({"SLURM_PROCID": "0", "SLURM_NTASKS": "6"}) == (0, 1, 1)  # the script of a job


@pytest.mark.parametrize("command", ["solve", "check"])
def test_one_of_many_copies_speaks(beam, run, monkeypatch, command):
    for name, value in OPEN_MPI.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    assert run(command, "beam.mdpa").refuses("8 copies", "--backend petsc", "--backend own")
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "5")
    done = run(command, "beam.mdpa")  # with an error, mpirun would end the others before they speak
    assert (done.code, done.out, done.err) == (0, "", "")
    assert run(command, "beam.mdpa", "--backend", "own").code == 0
    assert run(command, "beam.mdpa", "--backend=own").out


def test_other_commands_do_not_mind_copies(beam, run, monkeypatch):
    for name, value in {"OMPI_COMM_WORLD_RANK": "3", **OPEN_MPI}.items():
        monkeypatch.setenv(name, value)
    assert "nodes       20" in run("info", "beam.mdpa").out


def test_options_of_petsc_belong_to_the_backend(beam, run):
    assert run("solve", "beam.mdpa", "--petsc", "-ksp_view").refuses(
        "--petsc belongs to --backend; give that too"
    )


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--modes", "3"], "--modes does not go with --backend petsc"),
        (["--time", "1e-3:5"], "--time does not go with --backend petsc"),
        (["--lumped"], "--lumped does not go with --backend petsc"),
        (["--rotation", "z:3"], "--rotation does not go with --backend petsc"),
        (["--error", "1%"], "--error is for one process"),
        (["--petsc", "-ksp_type cg gmres"], "'gmres' is no option and the value of none"),
    ],
)
def test_what_petsc_does_not_do_is_refused_before_anything_is_read(run, words, text):
    assert run("solve", "no.mdpa", "--backend", "petsc", *words).refuses(text)


def test_a_body_is_not_solved_by_petsc(run, tmp_path):
    (tmp_path / "body.py").write_text("raise SystemError('is not run')")
    assert run("solve", tmp_path / "body.py", "--backend", "petsc").refuses("scripts are for one process")


def test_without_petsc_the_cure_is_named(beam):
    text = (
        "import sys\nsys.modules['mpi4py'] = sys.modules['petsc4py'] = None\n"
        "from kratos_lite.cli import main\nsys.exit(main(sys.argv[1:]))"
    )
    words = [sys.executable, "-c", text, "solve", "beam.mdpa", "--backend", "petsc"]
    run = subprocess.run(words, capture_output=True, text=True, timeout=FOREVER, check=False)
    assert run.returncode == 2
    assert "needs petsc4py" in run.stderr
    assert "apt-get install python3-petsc4py python3-mpi4py" in run.stderr
