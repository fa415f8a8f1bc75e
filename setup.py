"""Build the optional compiled kernels: every `kratos_lite/native/*.cpp` is one extension module.

A machine without a compiler installs the package all the same and computes with NumPy and SciPy.
"""

import sys
from pathlib import Path

from pybind11.setup_helpers import ParallelCompile, Pybind11Extension, naive_recompile
from setuptools import setup

NATIVE = Path("kratos_lite/native")
FLAGS = ["/O2"] if sys.platform == "win32" else ["-O3", "-pthread", "-fno-math-errno", "-Wall", "-Wextra"]

ParallelCompile("MAX_JOBS", default=2, needs_recompile=naive_recompile).install()
setup(
    ext_modules=[
        Pybind11Extension(
            f"kratos_lite.native._{source.stem}",
            [str(source)],
            depends=[str(header) for header in NATIVE.glob("*.hpp")],
            cxx_std=17,
            extra_compile_args=FLAGS,
            extra_link_args=[] if sys.platform == "win32" else ["-pthread"],
            optional=True,
        )
        for source in sorted(NATIVE.glob("*.cpp"))
    ]
)
