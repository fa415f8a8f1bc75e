"""The tests of `ranks_*.py` on 1, 2 and 3 ranks."""

from pathlib import Path

import pytest
from over_ranks import mpirun, needs_mpi

RUNNER = Path(__file__).with_name("runner.py")

pytestmark = needs_mpi


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_over_ranks(ranks):
    alone = ("-k", "not at_random and not one_empty")  # one rank has all, however the mesh is cut
    run = mpirun(ranks, RUNNER, *(alone if ranks == 1 else ()))
    assert run.returncode == 0, run.stdout[-6000:] + run.stderr[-3000:]
    assert " passed" in run.stdout
