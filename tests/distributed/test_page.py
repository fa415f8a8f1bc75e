"""The commands and the script of docs/howto/cluster.md do what the page says."""

import re
import shlex

import pytest
from over_ranks import ROOT, mpirun, needs_mpi

TEXT = (ROOT / "docs" / "howto" / "cluster.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^mpirun -n (\d+) \S*kratos-lite ([^#\n]*)$", TEXT, re.M)
OPTIONS = re.findall(r"^\| `(--\w+ [^`]*)` \|", TEXT, re.M)
SCRIPTS = dict(re.findall(r"```\{code-block\} python\n:caption: (\w+)\.py[^\n]*\n(.*?)```", TEXT, re.DOTALL))

pytestmark = needs_mpi


@pytest.mark.parametrize(("ranks", "words"), COMMANDS)
def test_commands_run(ranks, words, tmp_path):
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    run = mpirun(ranks, "-m", "kratos_lite", *shlex.split(words), seconds=120, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert "largest displacement" in run.stdout
    for name in re.findall(r"-o (\S+)", words):
        assert (tmp_path / name).exists()


@pytest.mark.parametrize(
    ("name", "files"), [("block", ["block.vtu"]), ("giant", ["giant.pvtu", "giant_0.vtu", "giant_1.vtu"])]
)
def test_the_scripts_run(name, files, tmp_path):
    (tmp_path / f"{name}.py").write_text(SCRIPTS[name], encoding="utf-8")
    run = mpirun(2, f"{name}.py", seconds=120, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("backward error") == 1
    assert sorted(path.name for path in tmp_path.glob("*vtu")) == files


@pytest.mark.parametrize("words", OPTIONS)
def test_options_are_taken(words, tmp_path):
    words = ["solve", ROOT / "examples" / "gravity_cube.mdpa", "--backend", "petsc", *shlex.split(words)]
    run = mpirun(2, "-m", "kratos_lite", *words, seconds=120, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert "warning" not in run.stdout + run.stderr
    for wanted in ("gamg", "hypre", "mumps"):
        if wanted in " ".join(map(str, words)):
            assert wanted in run.stdout
