"""`mpirun -n P kratos-lite … --backend petsc`: what one rank does to all of them."""

import os
import re
import shlex
import subprocess

import pytest
from cluster_page import COMMANDS, SCRIPTS
from over_ranks import PYTHON, ROOT, mpirun, needs_mpi

import kratos_lite as kl

pytestmark = needs_mpi

LIMIT = 90
"""Seconds after which a command hangs."""


def command(ranks, *words, **options):
    """Run kratos-lite over some ranks; its output is in the result."""
    return mpirun(ranks, "-m", "kratos_lite", *words, seconds=LIMIT, **options)


def script(ranks, text, *words, **options):
    """Run the command from a script that changes something on one rank before."""
    start = "import sys, os\nfrom kratos_lite.cli import main\nfrom kratos_lite.cli.ranks import launched\n"
    code = f"{start}rank = launched()[0]\n{text}\nsys.exit(main(sys.argv[1:]))"
    return mpirun(ranks, "-c", code, *words, seconds=LIMIT, **options)


def said(run):
    """Return what the command itself has written on standard error, without mpirun's own lines."""
    text = re.sub(r"(?m)^-{20,}\n(.*\n)*?-{20,}\n", "", run.stderr)
    return [line for line in text.splitlines() if line.strip()]


def assert_refused(run, *texts):
    """Assert that the command has ended with one message that holds some texts."""
    lines = said(run)
    assert run.returncode == 2, run.stderr
    assert sum(line.startswith(("error:", "internal error:", "rank ")) for line in lines) == 1, run.stderr
    assert all(text in "\n".join(lines) for text in texts), run.stderr
    assert "Traceback" not in run.stderr
    assert run.stdout == ""


@pytest.fixture
def beam(tmp_path):
    """Write a clamped beam under its weight; return its file."""
    model = kl.Model(kl.box((4, 1, 1), (4, 1, 1)), kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0))
    model.fix("x-")
    model.add(kl.Gravity((0, 0, -9.81)))
    kl.write(tmp_path / "beam.mdpa", model)
    return tmp_path / "beam.mdpa"


def files_of(folder):
    return sorted(path.name for path in folder.iterdir())


# ---- what docs/howto/cluster.md shows ----------------------------------------------------------------


@pytest.mark.parametrize(("ranks", "words"), COMMANDS)
def test_commands_of_the_page_run(ranks, words, tmp_path):
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    run = command(ranks, *shlex.split(words), cwd=tmp_path)
    assert (run.returncode, said(run)) == (0, [])
    assert run.stdout.count("largest displacement") == 1
    for name in re.findall(r"-o (\S+)", words):
        assert (tmp_path / name).exists()


def test_the_script_of_ranks_that_make_their_parts_runs(tmp_path):
    (tmp_path / "giant.py").write_text(SCRIPTS["giant"], encoding="utf-8")
    run = mpirun(2, "giant.py", seconds=LIMIT, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("backward error") == 1
    assert files_of(tmp_path) == ["giant.pvtu", "giant.py", "giant_0.vtu", "giant_1.vtu"]


# ---- copies that know nothing of each other ---------------------------------------------------------


def test_copies_of_a_serial_command_are_refused_once(beam):
    run = command(3, "solve", beam, "--json", "out.json", cwd=beam.parent)
    assert_refused(run, "3 copies", "--backend petsc", "--backend own")
    assert files_of(beam.parent) == ["beam.mdpa"]


def test_copies_that_are_wanted_each_solve(beam):
    run = command(2, "solve", beam, "--backend", "own", cwd=beam.parent)
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("largest displacement") == 2


def test_processes_that_another_mpi_has_started(beam):
    """Each would be alone, and take itself for rank 0."""
    environment = {**os.environ, "PMI_RANK": "0", "PMI_SIZE": "2", "PYTHONPATH": str(ROOT)}
    run = subprocess.run(
        [PYTHON, "-m", "kratos_lite", "solve", str(beam), "--backend", "petsc"],
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
        env=environment,
    )
    assert run.returncode == 2
    assert "2 processes have been started, but mpi4py sees 1" in run.stderr


# ---- what one rank does or lacks --------------------------------------------------------------------


IN_EQUATIONS = """
import kratos_lite.distributed.petsc_system as system
class Changed(system.Equations):
    def __init__(self, *words):
        if rank == 1: {}
        super().__init__(*words)
system.Equations = Changed
"""
"""What rank 1 does before it makes its equations."""


def test_a_rank_that_exits_ends_all(beam):
    run = script(3, IN_EQUATIONS.format("sys.exit(0)"), "solve", beam, "--backend", "petsc")
    assert_refused(run, "rank 1: SystemExit: 0")


@pytest.mark.parametrize("signal", ["SIGKILL", "SIGTERM"])
def test_a_rank_that_is_killed_ends_all(beam, signal):
    text = IN_EQUATIONS.format(f"import signal; os.kill(os.getpid(), signal.{signal})")
    words = ["solve", beam, "--backend", "petsc", "-o", "out.pvtu", "--json", "out.json"]
    run = script(3, text, *words, cwd=beam.parent)
    assert run.returncode != 0
    assert files_of(beam.parent) == ["beam.mdpa"]


def test_a_package_that_one_rank_lacks(beam):
    run = script(2, "if rank == 1: sys.modules['mpi4py'] = None", "solve", beam, "--backend", "petsc")
    assert run.returncode != 0
    assert "mpi4py" in run.stderr
    assert run.stderr.count("error:") == 1
    assert run.stdout == ""


def test_words_that_one_rank_alone_gets(beam):
    text = "if rank == 1: sys.argv += ['--tolerance', '1e-6']"
    run = script(3, text, "solve", beam, "--backend", "petsc")
    assert_refused(run, "ranks share one command", "rank 1", "--tolerance 1e-6")


@pytest.mark.parametrize("begun", ["", "from mpi4py import MPI"])
def test_a_rank_that_leaves_early(beam, begun):
    """With 0, which mpirun does not notice; also one that has begun to communicate."""
    limit = "from kratos_lite.distributed import communicator\ncommunicator.LIMIT = 1.0"
    run = script(3, f"{limit}\n{begun}\nif rank == 1: sys.exit(0)", "solve", beam, "--backend", "petsc")
    assert run.returncode != 0
    assert run.stdout == ""
