"""The tests of `ranks_*.py` on 1, 2 and 3 ranks."""

from pathlib import Path

import pytest
from over_ranks import mpirun, needs_mpi

HERE = Path(__file__).parent
FILES = sorted(path.stem for path in HERE.glob("ranks_*.py"))

pytestmark = needs_mpi


@pytest.mark.parametrize("ranks", [1, 2, 3])
@pytest.mark.parametrize("file", FILES)
def test_over_ranks(file, ranks):
    run = mpirun(ranks, HERE / "runner.py", HERE / f"{file}.py")
    assert run.returncode == 0, run.stdout[-6000:] + run.stderr[-3000:]
    assert " 0 failed" in run.stdout
