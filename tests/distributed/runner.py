"""Run the tests of files on all ranks: ``mpirun -n P python tests/distributed/runner.py FILE … [-k WORD]``.

A test is a function ``test_*`` that takes the ranks; its attribute ``cases``, a list of arguments, repeats
it.
It fails if it fails on any rank.  One line for each, from rank 0; the exit code is 1 if any has failed.
"""

import importlib.util
import sys
import traceback
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "fixtures"), str(ROOT / "tests" / "distributed")]


def load(path):
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def calls(module, word):
    """Yield the name of each test, and what to call with the ranks."""
    for name, test in vars(module).items():
        if name.startswith("test_"):
            for arguments in getattr(test, "cases", [()]):
                given = arguments if isinstance(arguments, tuple) else (arguments,)
                label = f"{name}[{'-'.join(str(getattr(one, '__name__', one)) for one in given)}]"
                if word in label:
                    yield label if given else name, test, given


def run(test, given, ranks):
    """Return what a test raises on any rank, by rank."""
    found = None
    try:
        with ranks.together():
            try:
                test(ranks, *given)
            except BaseException:
                found = traceback.format_exc()  # what is shared with the others does not say where
                raise
    except BaseException:
        found = found or traceback.format_exc()
    return ranks.gather(found)


def main(arguments):
    from kratos_lite.distributed.communicator import world

    word = arguments[arguments.index("-k") + 1] if "-k" in arguments else ""
    files = [one for one in arguments if one.endswith(".py")]
    ranks, failed, passed = world(), 0, 0
    for path in files:
        for label, test, given in calls(load(path), word):
            found = [one for one in run(test, given, ranks) if one]
            failed, passed = failed + bool(found), passed + (not found)
            if ranks.rank == 0:
                print(f"{'FAILED' if found else 'passed'} {Path(path).stem}::{label}", flush=True)
                print(max(found, key=len, default=""), end="", flush=True)  # that of the cause
    if ranks.rank == 0:
        print(f"{passed} passed, {failed} failed on {ranks.size} ranks", flush=True)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
