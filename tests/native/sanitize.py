"""Run the tests of the kernels with address and undefined-behavior sanitizers.

``python -m tests.native.sanitize [pytest arguments]`` needs GCC; kernels are built into a temporary folder.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.native.build import build

ROOT = Path(__file__).parents[2]
FLAGS = ("-O1", "-g", "-fno-omit-frame-pointer", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
TESTS = [
    "tests/native",
    "tests/ale/test_kernel.py",
    "tests/assembly/test_condensed_kernels.py",
    "tests/assembly/test_stiffness.py",
    "tests/assembly/test_finite_strain.py",
    "tests/io/formats/test_mdpa_kernel.py",
    "tests/mesh/test_topology.py",
    "tests/solvers/test_coarse_level.py",
    "tests/bodies/test_batched.py",
]
"""What runs if nothing else is asked for."""


def main(arguments: list[str]) -> int:
    """Build, run, and return the exit code of pytest."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in ("kratos_lite", "tests"):
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("*.so", "__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", copy)
        native = copy / "kratos_lite" / "native"
        build(sorted(native.glob("*.cpp")), native, *FLAGS)
        environment = {
            **os.environ,
            "PYTHONPATH": folder,
            "LD_PRELOAD": " ".join(map(library, ("libasan.so", "libubsan.so"))),
            "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1",
            "UBSAN_OPTIONS": "print_stacktrace=1",
        }
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *(arguments or TESTS)]
        return subprocess.run(command, cwd=folder, env=environment, check=False).returncode


def library(name: str) -> str:
    """Return the path of a library of the compiler."""
    found = subprocess.run(["g++", f"-print-file-name={name}"], capture_output=True, text=True, check=True)
    return found.stdout.strip()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
