"""Commands over ranks: summary, files and errors of one process; what docs/howto/cluster.md shows."""

import json
import re
import runpy
import shlex

import numpy as np
import pytest
from cluster_page import OPTIONS, SCRIPTS
from kratos_part_files import write_part_files
from over_ranks import ROOT
from run_files import CLAMP, GRAVITY, box_mdpa, materials, process, push, run_file, write

import kratos_lite as kl
from kratos_lite.distributed import petsc_system
from kratos_lite.distributed.communicator import started
from kratos_lite.distributed.equations import Equations
from kratos_lite.errors import MeshError

LAW = kl.Isotropic3D(E=210e9, nu=0.3, density=7850.0)
OWN, PETSC = ("--backend", "own"), ("--backend", "petsc")
EQUAL = ("nodes", "elements", "unknowns", "total load", "strain energy")
"""Rows of the summary that are the same on any number of ranks, in the digits shown."""


def pulled(path, *box):
    """Write a bar that is pulled; return its file."""
    model = kl.Model(kl.box(*box), LAW)
    model.fix("x-")
    model.add(kl.Traction("x+", (1e6, 0, 0)))
    kl.write(path, model)
    return path


@pytest.fixture
def beam(tmp_path):
    """Write a clamped beam under its weight; return its file."""
    model = kl.Model(kl.box((4, 1, 1), (8, 2, 2), element="20N"), LAW)
    model.fix("x-")
    model.add(kl.Gravity((0, 0, -9.81)))
    kl.write(tmp_path / "beam.mdpa", model)
    return tmp_path / "beam.mdpa"


@pytest.fixture
def parts(tmp_path):
    """Write a bar as part files, one for each rank; return their folder."""
    size, source = started().size, pulled(tmp_path / "beam.mdpa", (4, 1, 1), (8, 2, 2))
    write_part_files(source, tmp_path / "parts", size, np.arange(32) * size // 32)
    return tmp_path / "parts"


def files_of(folder):
    return sorted(path.name for path in folder.iterdir())


def alike(shared, serial, names=EQUAL):
    """Assert that two summaries have the same rows."""
    assert (shared.code, shared.err) == (0, "")
    for name in names:
        assert shared.rows[name] == serial.rows[name]
    for name in ("largest displacement", "largest von Mises"):  # at one of several nodes alike
        assert shared.rows[name].split()[0] == serial.rows[name].split()[0]


# ---- summary and files -----------------------------------------------------------------------------


def test_summary_and_files_are_those_of_one_process(beam, run, monkeypatch):
    monkeypatch.chdir(beam.parent)
    serial = run("solve", beam, *OWN, "--json", "b.json")
    shared = run("solve", beam, *PETSC, "-o", "a.vtu", "-o", "a.csv", "--json", "a.json")
    alike(shared, serial, (*EQUAL, "estimated error"))
    assert "written               a.vtu\nwritten               a.csv\nwritten" in shared.out
    assert list(shared.rows) == [name for name in serial.rows if name != "iterations" or name in shared.rows]
    assert files_of(beam.parent) == ["a.csv", "a.json", "a.vtu", "b.json", "beam.mdpa"]
    one, other = (json.loads((beam.parent / name).read_text()) for name in ("a.json", "b.json"))
    assert set(one) == set(other)
    for name in ("displacement", "reaction"):
        found, expected = (np.array(list(values[name].values())) for values in (one, other))
        assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


def test_fewer_elements_than_ranks(tmp_path, run):
    path = pulled(tmp_path / "few.mdpa", (2, 1, 1), (max(started().size - 1, 1), 1, 1))
    alike(run("solve", path, *PETSC), run("solve", path, *OWN))


def test_expected_values_are_told_once_and_give_the_exit_code(tmp_path, run):
    """A run file of Kratos with checks."""
    (tmp_path / "box.mdpa").write_text(box_mdpa())
    write(tmp_path, materials("Structure.Body", 7850.0, 2e9, 0.3), "materials.json")
    checks = [
        process("check_scalar_to_nodes_process", f"Structure.{part}", f"DISPLACEMENT_{axis}", value=value)
        for part, axis, value in (("Bottom", "X", 0.0), ("Bottom", "X", "0.001*x**2"), ("Top", "Z", 1.0))
    ]
    write(tmp_path, run_file([CLAMP], [GRAVITY, push(1e6)], checks=checks))
    serial, shared = (run("solve", tmp_path, *backend) for backend in (OWN, PETSC))
    assert serial.code == shared.code == 3
    one, other = (
        [line for line in done.out.splitlines() if line.startswith("check ")] for done in (serial, shared)
    )
    assert one == other
    assert [" passed " in line for line in other] == [True, False, False]


def test_part_files_are_solved_as_the_whole(parts, run):
    shared = run("solve", parts / "beam.mdpa", *PETSC, "-o", parts / "a.pvtu")
    alike(shared, run("solve", parts.parent / "beam.mdpa", *OWN))
    pieces = [f"a_{rank}.vtu" for rank in range(started().size)]
    assert files_of(parts) == ["a.pvtu", *pieces, "beam_partitioned"]
    run("solve", parts / "beam.mdpa", *PETSC, "-o", parts / "a.vtu").refuses(
        "a.vtu: no process has the whole of a mesh in part files; write -o OUT.pvtu"
    )


# ---- errors ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["no.mdpa"], "error: no.mdpa: there is no such file"),
        (["beam.mdpa", "-o", "none/out.pvtu"], "error: none/out.pvtu: the folder none does not exist"),
        (["beam.mdpa", "--petsc", "-pc_type nonsense"], "nonsense"),
    ],
)
def test_what_is_wrong_for_all(beam, run, monkeypatch, words, text):
    monkeypatch.chdir(beam.parent)
    run("solve", *words, *PETSC).refuses(text)


def test_an_option_that_petsc_does_not_use_is_told_once(beam, run):
    assert run("solve", beam, *PETSC, "--petsc=-pc_typo 3").out.count("pc_typo") == 1


def test_an_inverted_element_that_one_rank_holds(beam, run):
    """The first of 8 × 2 × 2 along x, far from those of the last rank."""
    text = beam.read_text()
    nodes = re.search(r"(?m)^\s*1 1 (\d+ \d+ \d+ \d+) (\d+ \d+ \d+ \d+)(.*)$", text)
    beam.write_text(text.replace(nodes[0], f"1 1 {nodes[2]} {nodes[1]}{nodes[3]}"))
    for word in ("solve", "check"):
        done = run(word, beam, *PETSC)
        assert done.code == 2
        assert (done.err + done.out).count("element 1 (") == 1


class Torn(Equations):
    """Equations that no rank can make."""

    def __init__(self, *words):
        raise MeshError("torn in two")


def replace_equations(ranks, made):
    petsc_system.Equations = made


def test_an_error_of_the_user_on_all_ranks_is_told_once(beam, run):
    started().run(replace_equations, Torn)
    try:
        done = run("solve", beam, *PETSC)
    finally:
        started().run(replace_equations, Equations)
    done.refuses("error: torn in two")
    assert done.err.count("\n") == 1


def last_part(parts):
    return parts / "beam_partitioned" / f"beam_{started().size - 1}.mdpa"


def test_a_part_file_that_is_cut_or_missing_or_too_many(parts, run):
    last, words = last_part(parts), ("solve", parts / "beam.mdpa", *PETSC)
    text = last.read_text()
    last.write_text(text[: len(text) // 2])
    run(*words).refuses(f"{last.name}:")
    last.unlink()
    run(*words).refuses("error: ", "part file")
    size = started().size + 1
    write_part_files(parts.parent / "beam.mdpa", parts, size, np.arange(32) * size // 32)
    run(*words).refuses(f"there are {size} part files", f"mpirun -n {size}")


def test_part_files_that_disagree_on_the_place_of_a_node(parts, run):
    last = last_part(parts)
    text = last.read_text()
    first = re.search(r"Begin Nodes\n (\d+) (\S+) ", text)
    last.write_text(text.replace(first[0], f"Begin Nodes\n {first[1]} {float(first[2]) + 0.01} "))
    run("solve", parts / "beam.mdpa", *PETSC).refuses(f"node {first[1]}")


# ---- docs/howto/cluster.md -------------------------------------------------------------------------


@pytest.mark.parametrize("words", OPTIONS)
def test_options_of_the_page_are_taken(words, run):
    done = run("solve", ROOT / "examples" / "gravity_cube.mdpa", *PETSC, *shlex.split(words))
    assert (done.code, done.err) == (0, "")
    assert "warning" not in done.out
    for wanted in ("gamg", "hypre"):
        assert (wanted in done.out) is (wanted in words)
    assert ("mumps" in done.out) is ("-pc_type" not in words)


def test_the_script_of_the_page_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "block.py").write_text(SCRIPTS["block"], encoding="utf-8")
    runpy.run_path("block.py", run_name="__main__")
    assert capsys.readouterr().out.count("backward error") == 1
    assert files_of(tmp_path) == ["block.py", "block.vtu"]
