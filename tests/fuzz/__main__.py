"""Run damaged and random inputs through all commands: ``python -m tests.fuzz --count 10000 --seed 7``.

Each input follows from the seed and its number alone.  They run in a process with limits of memory and time;
one that dies is a finding, and the next one goes on behind it.  Findings are kept in a folder.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random

MEMORY = 3 * 10**9
"""Bytes of address space of the process."""


def main() -> int:
    """Run the inputs; return 1 if there are findings."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="number of inputs")
    parser.add_argument("--seed", type=int, default=0, help="of all random choices")
    parser.add_argument("--start", type=int, default=0, help="number of the first input")
    parser.add_argument("--keep", type=Path, help="folder for the inputs of findings")
    parser.add_argument("--write", type=Path, help="write the inputs into a folder, and run none")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        return _child(options)
    if options.write:
        with tempfile.TemporaryDirectory() as folder:
            for number, files, words in _inputs(options, Path(folder)):
                write(options.write / str(number), files, words)
        return 0
    number, end, bad = options.start, options.start + options.count, 0
    while number < end:
        number, found = _part(options, number, end)
        bad += found
    print(f"{options.count} inputs of seed {options.seed}: {bad} findings")
    return 1 if bad else 0


def _part(options: argparse.Namespace, start: int, end: int) -> tuple[int, int]:
    """Run inputs in one process until it ends; return where to go on, and the number of findings."""
    keep = ["--keep", str(options.keep.absolute())] if options.keep else []
    words = ["--child", "--seed", options.seed, "--start", start, "--count", end - start, *keep]
    root = Path(__file__).parents[2]
    environment = {
        **os.environ,
        "PYTHONPATH": str(root),
        "OPENBLAS_NUM_THREADS": "1",
        "KRATOS_LITE_THREADS": "2",
    }
    number, bad = start, 0
    with subprocess.Popen(
        [sys.executable, "-m", "tests.fuzz", *map(str, words)], stdout=subprocess.PIPE, text=True, cwd=root,
        env=environment,
    ) as child:  # fmt: skip
        assert child.stdout is not None
        for line in child.stdout:
            at, what = json.loads(line)
            if what:
                bad += 1
                print(f"input {at}: {what}", flush=True)
            else:
                number = at
    if child.returncode:
        print(f"input {number}: the process ends with code {child.returncode}", flush=True)
        return number + 1, bad + 1
    return end, bad


def _child(options: argparse.Namespace) -> int:
    """Run inputs in this process, and tell of each before it runs and of what is found."""
    _limit_memory()
    _shorten()
    from tests.fuzz.oracle import SECONDS, findings

    tell = os.fdopen(os.dup(1), "w", buffering=1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number, files, words in _inputs(options, folder):
            tell.write(json.dumps([number, ""]) + "\n")
            _limit_time(4 * SECONDS)  # where no signal reaches Python
            place = folder / "case"
            shutil.rmtree(place, ignore_errors=True)
            write(place, files)
            os.chdir(place)
            found = findings(words, list(files))
            os.chdir(folder)
            if found:
                tell.write(json.dumps([number, f"{' '.join(words)}: {'; '.join(found)}"]) + "\n")
                if options.keep:
                    write(options.keep / str(number), files, words)
    return 0


def _inputs(options: argparse.Namespace, folder: Path) -> Iterator[tuple[int, dict[str, bytes], list[str]]]:
    """Yield number, files and command of each input."""
    from tests.fuzz.grammar import generated
    from tests.fuzz.mutate import mutated
    from tests.fuzz.oracle import command_of
    from tests.fuzz.seeds import seeds

    good = seeds(folder)
    for number in range(options.start, options.start + options.count):
        rng = Random(f"{options.seed} {number}")
        seed = rng.choice(good) if rng.random() < 0.7 else generated(rng, good[0].files["mesh.mdpa"])
        files = dict(seed.files)
        if seed in good or rng.random() < 0.1:
            name = rng.choice(seed.targets())
            files[name] = mutated(name, files[name], rng)
        yield number, files, command_of(seed, rng)


def write(folder: Path, files: dict[str, bytes], words: Sequence[str] = ()) -> None:
    """Write an input, and its command if there is one, into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        (folder / name).write_bytes(data)
    if words:
        (folder / "command").write_text(" ".join(words))


def _limit_memory() -> None:
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def _limit_time(seconds: float) -> None:
    """Let this process take so much more computing time than it has taken."""
    import resource

    used = resource.getrusage(resource.RUSAGE_SELF)
    most = int(used.ru_utime + used.ru_stime + seconds)
    resource.setrlimit(resource.RLIMIT_CPU, (most, resource.RLIM_INFINITY))


def _shorten() -> None:
    """Let a run have few steps and cells, so that long ones are refused rather than waited for."""
    from kratos_lite.analysis import stepping
    from kratos_lite.io import case
    from kratos_lite.io.kratos import context
    from kratos_lite.mesh import generators

    case.MOST_STEPS = context.MAX_STEPS = 200
    stepping.MOST_SUBSTEPS = 100
    generators.MOST_NUMBERS = 3 * 10**6


if __name__ == "__main__":
    sys.exit(main())
