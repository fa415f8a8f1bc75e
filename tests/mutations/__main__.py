"""Apply each mutation to a copy of the package and run the tests that must notice it.

``python -m tests.mutations [numbers]`` takes all mutations, or those of these numbers; it ends with how many
were killed, survive, and were not run because their tests fail without them.  Kernels that a mutation of
C++ touches are built again, which needs GCC.  ``python -m tests.mutations --check`` only lists the mutations
whose text or tests are no longer there.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.mutations.mutations import MUTATIONS, Mutation
from tests.native.build import build, users_of

ROOT = Path(__file__).parents[2]
LIMIT = 60
"""Processor time in s that the tests of one mutation may take, whatever else the machine does."""


def passed(folder: Path, tests: str) -> bool:
    """Return whether the tests pass in a copy of the package; a run that takes too long has not noticed."""
    options = ("-q", "-x", "-p", "no:cacheprovider", "--no-header")
    command = [sys.executable, "-m", "pytest", *options, *tests.split()]
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


def stale() -> list[str]:
    """Return what is wrong with mutations: their text is not in its file once, or their tests are gone."""
    wrong = []
    for number, (file, old, new, tests) in enumerate(MUTATIONS):
        path = ROOT / "kratos_lite" / file
        count = path.read_text().count(old) if path.exists() else 0
        if count != 1 or new in (old, ""):
            wrong.append(f"{number} {file}: {old!r} must be there once, and change; it is {count} times")
        paths = [word for word in tests.split() if word.startswith(("tests", "kratos_lite"))]
        wrong += [f"{number} {file}: there is no {path}" for path in paths if not (ROOT / path).exists()]
    return wrong


def copy_sources(folder: Path) -> None:
    """Copy what the tests need into a folder."""
    for part in ("kratos_lite", "tests", "examples", "docs", "elements", "materials", "benchmarks"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / part, folder / part, symlinks=True, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", folder)


def main(numbers: list[int]) -> int:
    """Try mutations, tell the result of each, and return how many were not killed."""
    if wrong := stale():
        sys.exit("\n".join(wrong))
    results: Counter[str] = Counter()
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        copy_sources(folder)
        sound: dict[str, bool] = {}
        for number in numbers or range(len(MUTATIONS)):
            mutation, start = MUTATIONS[number], time.monotonic()
            result = "SURVIVES" if survives(folder, mutation) else "killed"
            if result == "killed" and mutation.tests not in sound:
                sound[mutation.tests] = passed(folder, mutation.tests)
            if not sound.get(mutation.tests, True):  # tests that always fail notice nothing
                result = "NOT RUN"
            results[result] += 1
            seconds = time.monotonic() - start
            sys.stdout.write(
                f"{number:3} {result:8} {seconds:4.0f} s  {mutation.file}: {mutation.new.strip()}\n"
            )
            sys.stdout.flush()
    counts = ", ".join(f"{results[word]} {word.lower()}" for word in ("killed", "SURVIVES", "NOT RUN"))
    sys.stdout.write(f"{counts}, {time.monotonic() - begin:.0f} s\n")
    return results.total() - results["killed"]


if __name__ == "__main__":
    sys.exit("\n".join(stale()) or 0 if "--check" in sys.argv else main([int(word) for word in sys.argv[1:]]))
