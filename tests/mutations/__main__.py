"""Apply each mutation to a copy of the package and run the tests that must notice it.

``python -m tests.mutations [numbers]`` takes all mutations, or those of these numbers; it ends with how many
survive.  Kernels are built again, which needs GCC.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.mutations.mutations import MUTATIONS, Mutation
from tests.native.build import build, users_of

ROOT = Path(__file__).parents[2]
LIMIT = 60
"""Processor time in s that the tests of one mutation may take, whatever else the machine does."""


def passed(folder: Path, tests: str) -> bool:
    """Return whether the tests pass in a copy of the package; a run that takes too long has not noticed."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-p",
        "no:cacheprovider",
        "--no-header",
        *tests.split(),
    ]
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        command,
        cwd=folder,
        env=environment,
        capture_output=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT)),
    )
    if done.returncode in (4, 5):
        sys.exit(f"no such tests: {tests}\n{done.stdout.decode()[-500:]}")
    return done.returncode == 0 or done.returncode == -9


def survives(folder: Path, mutation: Mutation) -> bool:
    """Return whether the tests pass with a mutation."""
    file = folder / "kratos_lite" / mutation.file
    text = file.read_text()
    if text.count(mutation.old) != 1:
        sys.exit(
            f"{mutation.file} must have {mutation.old!r} once; it has it {text.count(mutation.old)} times"
        )
    kernels = users_of(file) if file.suffix in (".cpp", ".hpp") else []
    built = [next(file.parent.glob(f"_{kernel.stem}.*.so")) for kernel in kernels]
    before = [library.read_bytes() for library in built]
    try:
        file.write_text(text.replace(mutation.old, mutation.new))
        build(kernels, file.parent, "-O1")
        return passed(folder, mutation.tests)
    finally:
        file.write_text(text)
        for library, data in zip(built, before, strict=True):
            library.write_bytes(data)


def main(numbers: list[int]) -> int:
    """Try mutations, tell the outcome of each, and return how many survive."""
    survivors = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in ("kratos_lite", "tests", "examples", "docs", "elements", "materials", "benchmarks"):
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / part, folder / part, symlinks=True, ignore=ignored)
        shutil.copy(ROOT / "pyproject.toml", folder)
        sound: dict[str, bool] = {}
        for number in numbers or range(len(MUTATIONS)):
            mutation = MUTATIONS[number]
            alive = survives(folder, mutation)
            if not alive and mutation.tests not in sound:  # tests that always fail notice nothing
                sound[mutation.tests] = passed(folder, mutation.tests)
            alive = alive or not sound[mutation.tests]
            survivors += alive
            outcome = "SURVIVES" if alive else "killed"
            sys.stdout.write(f"{number:3} {outcome:8}  {mutation.file}: {mutation.new.strip()}\n")
            sys.stdout.flush()
    return survivors


if __name__ == "__main__":
    sys.exit(main([int(word) for word in sys.argv[1:]]))
