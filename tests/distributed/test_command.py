"""`mpirun -n P kratos-lite … --backend petsc`: one command over many processes, and what goes wrong in it."""

import json
import os
import re
import subprocess

import numpy as np
import pytest
from kratos_part_files import write_part_files
from over_ranks import PYTHON, ROOT, mpirun, needs_mpi
from run_files import CLAMP, GRAVITY, box_mdpa, materials, process, push, run_file, write

import kratos_lite as kl

pytestmark = needs_mpi

LAW = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
LIMIT = 90
"""Seconds after which a command hangs."""


def command(ranks, *words, **options):
    """Run kratos-lite over some ranks; its output is in the result."""
    return mpirun(ranks, "-m", "kratos_lite", *words, seconds=LIMIT, **options)


def script(ranks, text, *words, **options):
    """Run the command from a script that changes something on one rank before."""
    start = "import sys\nfrom kratos_lite.cli import main\n"
    return mpirun(
        ranks, "-c", f"{start}{text}\nsys.exit(main(sys.argv[1:]))", *words, seconds=LIMIT, **options
    )


def said(run):
    """Return what the command itself has written on standard error, without mpirun's own lines."""
    text = re.sub(r"(?m)^-{20,}\n(.*\n)*?-{20,}\n", "", run.stderr)
    return [line for line in text.splitlines() if line.strip()]


def assert_refused(run, *texts, code=2):
    """Assert that the command has ended with one message that holds some texts."""
    lines = said(run)
    assert run.returncode == code, run.stderr
    assert sum(line.startswith(("error:", "internal error:", "rank ")) for line in lines) == 1, run.stderr
    assert all(text in "\n".join(lines) for text in texts), run.stderr
    assert "Traceback" not in run.stderr
    assert run.stdout == ""


@pytest.fixture
def beam(tmp_path):
    """Write a clamped beam under its weight; return its file."""
    model = kl.Model(kl.box((4, 1, 1), (8, 2, 2), element="20N"), LAW)
    model.fix("x-")
    model.add(kl.Gravity((0, 0, -9.81)))
    kl.write(tmp_path / "beam.mdpa", model)
    return tmp_path / "beam.mdpa"


def files_of(folder):
    return sorted(path.name for path in folder.iterdir())


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


# ---- an error, a defect or a signal on one rank -----------------------------------------------------


def test_options_that_do_not_carry_over_are_refused_before_a_file_is_read(tmp_path):
    run = command(2, "solve", "no.mdpa", "--backend", "petsc", "--modes", "3", cwd=tmp_path)
    assert_refused(run, "--modes does not go with --backend petsc")


def test_a_missing_input(tmp_path):
    run = command(2, "solve", "no.mdpa", "--backend", "petsc", cwd=tmp_path)
    assert_refused(run, "error: no.mdpa: there is no such file")


CHANGED = """import os, sys
from kratos_lite.cli.ranks import launched
from kratos_lite.distributed import equations
rank, real = launched()[0], equations.Equations
class Changed(real):
    def __init__(self, *words):
        {}
        super().__init__(*words)
import kratos_lite.distributed.petsc_system as system
system.Equations = Changed
"""


def in_equations(what):
    """Return lines by which ranks do something before they make their equations."""
    return CHANGED.format(what)


@pytest.mark.parametrize(
    ("what", "text"),
    [
        ("if rank == 1: raise KeyError('odd')", "rank 1: KeyError: 'odd'"),
        ("if rank == 1: raise MemoryError", "rank 1: MemoryError"),
        ("if rank == 1: sys.exit(0)", "rank 1: SystemExit: 0"),
    ],
)
def test_a_defect_on_one_rank_ends_all(beam, what, text):
    run = script(3, in_equations(what), "solve", beam, "--backend", "petsc")
    assert_refused(run, text)


def test_an_error_of_the_user_on_all_ranks_is_told_once(beam):
    text = "from kratos_lite.errors import MeshError; raise MeshError('torn in two')"
    run = script(3, in_equations(text), "solve", beam, "--backend", "petsc")
    assert_refused(run, "error: torn in two")


@pytest.mark.parametrize("signal", ["SIGKILL", "SIGTERM"])
def test_a_rank_that_is_killed_ends_all(beam, signal):
    text = in_equations(f"if rank == 1: import signal; os.kill(os.getpid(), signal.{signal})")
    words = ["solve", beam, "--backend", "petsc", "-o", "out.pvtu", "--json", "out.json"]
    run = script(3, text, *words, cwd=beam.parent)
    assert run.returncode != 0
    assert files_of(beam.parent) == ["beam.mdpa"]


LACKS = "if launched()[0] == 1: import sys; sys.modules[{!r}] = None"


@pytest.mark.parametrize("package", ["petsc4py", "mpi4py"])
def test_a_package_that_one_rank_lacks(beam, package):
    text = (
        "from kratos_lite.cli.ranks import launched\n"
        "from kratos_lite.distributed import petsc as module; module.DEBIAN = '/nowhere'\n"
        + LACKS.format(package)
    )
    run = script(2, text, "solve", beam, "--backend", "petsc")
    assert run.returncode != 0
    assert package in run.stderr
    assert run.stderr.count("error:") == 1
    assert run.stdout == ""


def test_words_that_one_rank_alone_gets(beam):
    text = (
        "from kratos_lite.cli.ranks import launched\n"
        "if launched()[0] == 1: sys.argv += ['--tolerance', '1e-6']"
    )
    run = script(3, text, "solve", beam, "--backend", "petsc")
    assert_refused(run, "ranks share one command", "rank 1", "--tolerance 1e-6")


@pytest.mark.parametrize("begun", [True, False])
def test_a_rank_that_leaves_early(beam, begun):
    """With 0, which mpirun does not notice; also one that has begun to communicate."""
    text = (
        "from kratos_lite.cli.ranks import launched\n"
        "from kratos_lite.distributed import communicator\n"
        "communicator.LIMIT = 3.0\n"
        + "from mpi4py import MPI\n" * begun
        + "if launched()[0] == 1: sys.exit(0)"
    )
    run = script(3, text, "solve", beam, "--backend", "petsc")
    assert run.returncode != 0
    assert run.stdout == ""


def test_an_inverted_element_that_one_rank_holds(beam):
    """The first of 8 × 2 × 2 along x, far from those of the last rank."""
    text = beam.read_text()
    nodes = re.search(r"(?m)^\s*1 1 (\d+ \d+ \d+ \d+) (\d+ \d+ \d+ \d+)(.*)$", text)
    beam.write_text(text.replace(nodes[0], f"1 1 {nodes[2]} {nodes[1]}{nodes[3]}"))
    for words in (("solve", beam), ("check", beam)):
        run = command(3, *words, "--backend", "petsc")
        assert run.returncode == 2
        assert (run.stderr + run.stdout).count("element 1 (") == 1


def test_a_folder_that_is_not_there(beam):
    run = command(2, "solve", beam, "--backend", "petsc", "-o", "none/out.pvtu", cwd=beam.parent)
    assert_refused(run, "error: none/out.pvtu: the folder none does not exist")


# ---- part files -----------------------------------------------------------------------------------


@pytest.fixture
def parts(tmp_path):
    """Write a beam that is pulled as part files of two ranks; return their folder."""
    model = kl.Model(kl.box((4, 1, 1), (8, 2, 2)), LAW)
    model.fix("x-")
    model.add(kl.Traction("x+", (1e6, 0, 0)))
    kl.write(tmp_path / "beam.mdpa", model)
    folder = tmp_path / "parts"
    write_part_files(tmp_path / "beam.mdpa", folder, 2, [0] * 16 + [1] * 16)
    return folder


def test_a_part_file_that_is_missing_or_cut(parts):
    last = parts / "beam_partitioned" / "beam_1.mdpa"
    text = last.read_text()
    last.write_text(text[: len(text) // 2])
    assert_refused(command(2, "solve", parts / "beam.mdpa", "--backend", "petsc"), "beam_1.mdpa:")
    last.unlink()
    assert_refused(command(2, "solve", parts / "beam.mdpa", "--backend", "petsc"), "error: ", "part file")


def test_part_files_that_disagree_on_the_place_of_a_node(parts):
    last = parts / "beam_partitioned" / "beam_1.mdpa"
    text = last.read_text()
    first = re.search(r"Begin Nodes\n (\d+) (\S+) ", text)
    last.write_text(text.replace(first[0], f"Begin Nodes\n {first[1]} {float(first[2]) + 0.01} "))
    assert_refused(command(2, "solve", parts / "beam.mdpa", "--backend", "petsc"), f"node {first[1]}")


# ---- what is solved and written -------------------------------------------------------------------


def rows_of(run):
    """Return the summary by its labels."""
    assert run.returncode == 0, run.stdout + run.stderr
    return {line[:22].strip(): line[22:].strip() for line in run.stdout.splitlines()}


EQUAL = ("nodes", "elements", "unknowns", "total load", "strain energy", "estimated error")
"""Rows of the summary that are the same on any number of ranks, in the digits shown."""


@pytest.mark.parametrize("ranks", [2, 3])
def test_summary_and_files_are_those_of_one_process(beam, run, ranks):
    serial = run("solve", beam, "--json", beam.parent / "b.json").rows
    words = ["solve", beam, "--backend", "petsc", "-o", "a.vtu", "-o", "a.csv", "--json", "a.json"]
    done = command(ranks, *words, cwd=beam.parent)
    shared = rows_of(done)
    assert said(done) == []
    assert done.stdout.count("largest displacement") == 1
    assert "written               a.vtu\nwritten               a.csv\nwritten" in done.stdout
    for name in EQUAL:
        assert shared[name] == serial[name].strip()
    for name in ("largest displacement", "largest von Mises"):  # at one of several nodes alike
        assert shared[name].split()[0] == serial[name].split()[0]
    assert list(shared) == [name for name in serial if name != "iterations" or name in shared]
    assert files_of(beam.parent) == ["a.csv", "a.json", "a.vtu", "b.json", "beam.mdpa"]
    one, other = (json.loads((beam.parent / name).read_text()) for name in ("a.json", "b.json"))
    assert set(one) == set(other)
    for name in ("displacement", "reaction"):
        found, expected = (np.array(list(values[name].values())) for values in (one, other))
        assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


def test_part_files_are_solved_as_the_whole(parts, run):
    serial = run("solve", parts.parent / "beam.mdpa").rows
    run = command(2, "solve", parts / "beam.mdpa", "--backend", "petsc", "-o", "a.pvtu", cwd=parts)
    shared = rows_of(run)
    for name in EQUAL[:-1]:
        assert shared[name] == serial[name].strip()
    for name in ("largest displacement", "largest von Mises"):
        assert shared[name].split()[0] == serial[name].split()[0]
    assert files_of(parts) == ["a.pvtu", "a_0.vtu", "a_1.vtu", "beam_partitioned"]
    run = command(3, "solve", parts / "beam.mdpa", "--backend", "petsc")
    assert_refused(run, "there are 2 part files", "mpirun -n 2")
    run = command(2, "solve", parts / "beam.mdpa", "--backend", "petsc", "-o", "a.vtu", cwd=parts)
    assert_refused(run, "a.vtu: no process has the whole of a mesh in part files; write -o OUT.pvtu")


def test_more_ranks_than_elements(tmp_path, run):
    model = kl.Model(kl.box((2, 1, 1), (2, 1, 1)), LAW)
    model.fix("x-")
    model.add(kl.Traction("x+", (1e6, 0, 0)))
    kl.write(tmp_path / "two.mdpa", model)
    words = ["solve", "two.mdpa", "--backend", "petsc", "--json", "two.json"]
    serial = run("solve", tmp_path / "two.mdpa").rows
    shared = rows_of(command(4, *words, cwd=tmp_path))
    for name in EQUAL[:-1]:  # the error is rounding
        assert shared[name] == serial[name].strip()


def test_one_rank_writes_as_one_process_does(beam):
    """Also without mpirun."""
    words = ["solve", beam, "--backend", "petsc", "-o", "a.vtu", "-o", "a.csv", "--json", "a.json"]
    run = command(1, *words, cwd=beam.parent)
    assert "written" in rows_of(run)
    assert files_of(beam.parent) == ["a.csv", "a.json", "a.vtu", "beam.mdpa"]
    assert len(json.loads((beam.parent / "a.json").read_text())["displacement"]) == 261


def test_options_that_petsc_does_not_know(beam):
    run = command(2, "solve", beam, "--backend", "petsc", "--petsc", "-pc_type nonsense")
    assert_refused(run, "nonsense")
    run = command(2, "solve", beam, "--backend", "petsc", "--petsc=-pc_typo 3")
    assert run.stdout.count("pc_typo") == 1


def test_expected_values_are_told_once_and_give_the_exit_code(tmp_path, run):
    """A run file of Kratos with checks; the same lines as on one process."""
    (tmp_path / "box.mdpa").write_text(box_mdpa())
    write(tmp_path, materials("Structure.Body", 7850.0, 2e9, 0.3), "materials.json")
    checks = [
        process("check_scalar_to_nodes_process", f"Structure.{part}", f"DISPLACEMENT_{axis}", value=value)
        for part, axis, value in (("Bottom", "X", 0.0), ("Bottom", "X", "0.001*x**2"), ("Top", "Z", 1.0))
    ]
    write(tmp_path, run_file([CLAMP], [GRAVITY, push(1e6)], checks=checks))
    serial, shared = run("solve", tmp_path), command(3, "solve", tmp_path, "--backend", "petsc")
    assert serial.code == shared.returncode == 3
    one, other = (
        [line for line in out.splitlines() if line.startswith("check ")]
        for out in (serial.out, shared.stdout)
    )
    assert one == other
    assert [" passed " in line for line in other] == [True, False, False]
