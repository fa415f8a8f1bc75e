"""Run the tests of `ranks_*.py` on all ranks: ``mpirun -n P python tests/distributed/runner.py [words]``.

Rank 0 runs pytest, with these words; the others work for it.
"""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parent / "fixtures"), str(HERE)]

if __name__ == "__main__":
    from kratos_lite import distributed

    distributed.start()

    import pytest

    files = [str(path) for path in (*sorted(HERE.glob("ranks_*.py")), HERE / "test_cut.py")]
    words = ["-p", "no:cacheprovider", "-p", "commands", "--noconftest"]
    sys.exit(pytest.main([*words, *files, *sys.argv[1:]]))
