"""The tests of `ranks_*.py` on 1, 2 and 3 ranks, by the Python named in KRATOS_LITE_MPI_PYTHON.

That Python has mpi4py and petsc4py, such as Debian's; see docs/howto/cluster.md.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
PYTHON = os.environ.get("KRATOS_LITE_MPI_PYTHON", "")
NEAR = (Path(PYTHON).with_name("mpirun"), Path("/usr/bin/mpirun"))
MPIRUN = next((str(path) for path in NEAR if PYTHON and path.exists()), shutil.which("mpirun"))
"""That of the second Python's MPI: with the one of another MPI each rank would be alone."""
OPEN_MPI = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",  # all runs would share the first processors
    "OMPI_MCA_mpi_yield_when_idle": "1",
}
LEAVE = ("PYTHONPATH", "VIRTUAL_ENV", "PETSC_DIR", "PETSC_ARCH")
FILES = sorted(path.stem for path in HERE.glob("ranks_*.py"))

pytestmark = pytest.mark.skipif(
    not PYTHON or MPIRUN is None, reason="KRATOS_LITE_MPI_PYTHON or mpirun is absent"
)


def mpirun(ranks, *words, seconds=600, **options):
    """Run the second Python on some ranks; its output is in the result."""
    environment = {name: value for name, value in os.environ.items() if name not in LEAVE}
    environment |= {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(HERE.parents[1]), **OPEN_MPI}
    return subprocess.run(
        [str(MPIRUN), "-n", str(ranks), PYTHON, *map(str, words)],
        capture_output=True,
        text=True,
        timeout=seconds,
        check=False,
        env=environment,
        **{"cwd": HERE.parents[1], **options},
    )


@pytest.mark.parametrize("ranks", [1, 2, 3])
@pytest.mark.parametrize("file", FILES)
def test_over_ranks(file, ranks):
    run = mpirun(ranks, HERE / "runner.py", HERE / f"{file}.py")
    assert run.returncode == 0, run.stdout[-6000:] + run.stderr[-3000:]
    assert " 0 failed" in run.stdout
