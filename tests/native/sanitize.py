"""Run the tests of the kernels with sanitizers of GCC; kernels are built into a temporary folder.

``python -m tests.native.sanitize memory [pytest arguments]``: addresses and undefined behavior;
``python -m tests.native.sanitize threads [pytest arguments]``: races between threads.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.native.build import build

ROOT = Path(__file__).parents[2]
FLAGS = ("-O1", "-g", "-fno-omit-frame-pointer")
KINDS = {
    "memory": (
        ("-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
        ("libasan.so", "libubsan.so"),
        {"ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1", "UBSAN_OPTIONS": "print_stacktrace=1"},
    ),
    "threads": (
        ("-fsanitize=thread",),
        ("libtsan.so",),
        {"TSAN_OPTIONS": "halt_on_error=1", "KRATOS_LITE_THREADS": "4", "OPENBLAS_NUM_THREADS": "1"},
    ),
}
"""Flags of the compiler, libraries to load first, and variables of the environment."""
TESTS = [
    "tests/native",
    "tests/ale/test_kernel.py",
    "tests/assembly/test_gauss_point_fields.py",
    "tests/assembly/test_stiffness.py",
    "tests/assembly/test_finite_strain.py",
    "tests/io/formats/test_mdpa_kernel.py",
    "tests/mesh/test_topology.py",
    "tests/solvers/test_coarse_level.py",
    "tests/bodies/test_batched.py",
]
"""What runs if nothing else is asked for."""


def main(kind: str = "memory", *arguments: str) -> int:
    """Build, run, and return the exit code of pytest."""
    flags, libraries, variables = KINDS[kind]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / ROOT.name
        shutil.copytree(
            ROOT, copy, ignore=shutil.ignore_patterns("*.so", "__pycache__", ".git", ".venv*", "build")
        )
        native = copy / "kratos_lite" / "native"
        build(sorted(native.glob("*.cpp")), native, *FLAGS, *flags)
        preload = " ".join(map(library, libraries))
        environment = {**os.environ, **variables, "PYTHONPATH": str(copy), "LD_PRELOAD": preload}
        options = ["-q", "--capture=sys", "-p", "no:cacheprovider"]
        command = [sys.executable, "-m", "pytest", *options, *(arguments or TESTS)]
        return subprocess.run(command, cwd=copy, env=environment, check=False).returncode


def library(name: str) -> str:
    """Return the path of a library of the compiler."""
    found = subprocess.run(["g++", f"-print-file-name={name}"], capture_output=True, text=True, check=True)
    return found.stdout.strip()


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
