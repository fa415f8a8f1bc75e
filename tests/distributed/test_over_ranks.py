"""The tests of `ranks_*.py` and `test_cut.py` on 1, 2 and 3 ranks."""

from pathlib import Path

import pytest
from over_ranks import mpirun, needs_mpi

RUNNER = Path(__file__).with_name("runner.py")

pytestmark = needs_mpi


SOME = "communicator or summary or gravity or (iterations and 8N) or (in_parts and 8N)"
ON = {
    1: f"{SOME} or (tied and slabs)",
    2: "",
    3: "not (slabs or page or slender or 4N or 6N or 10N or 13N or 15N or 27N or Enhanced or test_cut)",
}
"""What of these tests runs on so many ranks: all on two of them, on three what a third one may change."""


@pytest.mark.parametrize("ranks", ON)
def test_over_ranks(ranks):
    run = mpirun(ranks, RUNNER, "-k", ON[ranks])
    assert run.returncode == 0, run.stdout[-6000:] + run.stderr[-3000:]
    assert " passed" in run.stdout
    assert run.stderr == ""
